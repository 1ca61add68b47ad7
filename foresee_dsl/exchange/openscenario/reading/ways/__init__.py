"""The lines that entities follow: trajectories, curves, changes of lane, and paths past who would hold them up."""
