"""Routes, and what only CARLA has."""
