"""Data, models and training of the learned drivers and of SelfOracle; not part of the installed package."""
