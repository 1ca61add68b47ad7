"""Children of a run: clips around risky points, and the mutants of the clips."""
