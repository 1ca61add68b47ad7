"""CARLA's leaderboard routes: import and export."""
