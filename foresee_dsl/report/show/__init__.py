"""The command `foresee show`: one run as sentences, a timeline and a strip of pictures.

`sources` finds the run (and simulates it if there is no trace), `measures` computes the values of the timeline,
`moments` chooses the moments of the strip, `panels` puts the map and the actors of a moment into a window. A panel is
drawn by `characters` (terminal) or, through the shapes of `drawing`, as SVG or PNG; `terminal_pictures` sends a PNG to
a terminal. `steps` replays the driver's observations and reasons, and `page` combines all of it.
"""
