"""One page of HTML that holds a whole campaign and needs nothing else: findings, playbacks, numbers.

`recorded` reads `campaign.json`, `runs` a failing run with its files, `playback` and `roads` make of it what the
script of `templates/report` plays, `contents` collects all that is said, `html`, `markdown` and `plain` render it;
`single` is the page of one file.
"""
