"""The parts of CARLA's packages `leaderboard`, `srunner` and `agents` that agents import.

`loading.py` puts this folder at the end of the module search path, so that an installed package comes first.
"""
