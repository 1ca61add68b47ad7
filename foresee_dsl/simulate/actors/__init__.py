"""The actors of a run and how each kind moves."""
