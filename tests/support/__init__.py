"""Shared parts of the tests: worlds, traces, drivers, checkers."""
