"""`foresee show`: one run as sentences, a timeline and a strip of pictures.

`sources` finds what is to be shown (and simulates it where no trace is kept), `measures` computes what the timeline
shows, `moments` picks those of the strip, `panels` puts the map and the road users of a moment into a window. A panel
is drawn by `characters` (terminal) or, through the shapes of `drawing`, as SVG or PNG; `terminal_pictures` sends a PNG
to a terminal. `differences` compares a mutant's run with its clip's, `steps` replays what the driver saw and said, and
`page` lays all of it out.
"""
