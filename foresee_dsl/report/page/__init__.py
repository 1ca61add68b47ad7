"""The page of a campaign: a single HTML file with findings, playbacks and numbers, which needs no other files.

`recorded` reads `campaign.json`, `runs` a failing run with its files; `playback` and `roads` convert it to data that
the script of `templates/report` plays; `contents` collects all texts and numbers, and `html`, `markdown` and `plain`
render them; `single` is the page of one file.
"""
