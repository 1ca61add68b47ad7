"""Runs campaigns: test cases are run, clipped around near misses and mutated in parallel, and the failures are kept."""
