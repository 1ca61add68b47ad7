"""The layout of objects on a written network's roads: the pieces of cut edges, and the roads of each roundabout."""
