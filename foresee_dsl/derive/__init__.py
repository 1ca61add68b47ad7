"""Children of a run: clips around risky points, and their mutants."""
