"""Measures how costs grow with actors in a scene, test cases in a campaign, and workers (`python -m
benchmarks.scale`)."""
