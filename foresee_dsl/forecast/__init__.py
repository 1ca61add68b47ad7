"""Finds moments of a run that passed at which it could have failed.

All rankers have one protocol, and see only traces.
"""
