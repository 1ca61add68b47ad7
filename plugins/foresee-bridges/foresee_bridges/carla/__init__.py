"""CARLA: agents written for CARLA's leaderboard as drivers (`--driver carla:my_agent.py`)."""
