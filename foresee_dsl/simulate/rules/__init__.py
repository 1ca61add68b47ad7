"""Traffic rules: which of them an actor breaks in a run, when, and where."""
