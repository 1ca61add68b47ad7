"""The actors of a run, and how each kind of them moves."""
