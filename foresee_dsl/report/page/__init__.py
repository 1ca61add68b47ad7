"""A single HTML file that shows a whole campaign without other files: findings, playbacks, numbers.

`recorded` reads `campaign.json`, `runs` a failing run with its files, `playback` and `roads` make of it what the
script of `templates/report` plays, `contents` collects all that is said, `html`, `markdown` and `plain` render it;
`single` is the page of one file.
"""
