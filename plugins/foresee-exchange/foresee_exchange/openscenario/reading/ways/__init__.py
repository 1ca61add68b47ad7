"""The lines that entities follow: trajectories, curves, lane changes, and paths past slower traffic."""
