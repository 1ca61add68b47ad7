"""Data, models and training of the learned drivers and of SelfOracle; no part of the installed package."""
