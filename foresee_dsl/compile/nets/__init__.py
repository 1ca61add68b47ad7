"""SUMO networks: netconvert writes them, and modules here read them back, with their signals."""
