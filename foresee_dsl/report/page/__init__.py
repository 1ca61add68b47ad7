"""The page of a campaign: a single HTML file with findings, playbacks and numbers, which needs no other files.

`runs` reads a failing run with its files; `playback` converts it to data that the script of `templates/report` plays,
and `pictures` draws it small; `contents` collects all texts and numbers, and `html` and `markdown` render them;
`single` is the page of one file, `running` that of a campaign that still runs.
"""
