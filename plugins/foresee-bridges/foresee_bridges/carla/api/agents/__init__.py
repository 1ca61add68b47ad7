"""Stands in for the package `agents` of CARLA, where that is not installed."""
