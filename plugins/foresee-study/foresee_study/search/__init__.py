"""Searches from the literature, with which the rankers are compared: each proposes mutants and learns from their runs.

All of them search one space (`space`), at an equal simulated time, with the steps and the store of a campaign.
"""
