"""SUMO networks: written by netconvert, read back, with their signals."""
