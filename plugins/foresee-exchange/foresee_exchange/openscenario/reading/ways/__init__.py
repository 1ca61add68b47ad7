"""The lines that entities follow: trajectories, curves, and paths past slower traffic."""
