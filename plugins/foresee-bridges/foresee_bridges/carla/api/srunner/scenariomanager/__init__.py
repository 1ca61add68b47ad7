"""Time, and what only CARLA has."""
