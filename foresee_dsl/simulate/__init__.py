"""Run a concrete scenario in SUMO with a driver at the wheel: world, dynamics, behaviours, trace, verdict."""
