"""Finds, in a run that passed, the moments at which it could have failed.

All rankers have one protocol, and see only traces.
"""
