"""What a user would pick instead, on the nearest scene that each can express (`python -m benchmarks.peers`).

Each peer is installed into an environment of its own and measured by a script that runs there (`in_NAME.py`). Nothing
of them is part of this project.
"""
