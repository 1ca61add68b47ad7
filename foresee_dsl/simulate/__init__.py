"""Runs a concrete scenario in SUMO with the driver under test: world, dynamics, triggers, trace, verdict."""
