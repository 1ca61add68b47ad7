"""Measures alternative tools on the most similar scene that each can express (`python -m benchmarks.peers`).

Each tool is installed into an environment of its own and measured by a script that runs there (`in_NAME.py`). No part
of these tools belongs to this project.
"""
