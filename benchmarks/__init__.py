"""Benchmarks of the tool's costs: `make bench`."""
