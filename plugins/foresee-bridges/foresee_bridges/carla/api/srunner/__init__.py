"""Stands in for the package `srunner` (ScenarioRunner) of CARLA, where that is not installed."""
