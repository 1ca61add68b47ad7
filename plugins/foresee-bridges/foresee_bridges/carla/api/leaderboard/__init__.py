"""Stands in for the package `leaderboard` of CARLA, where that is not installed."""
