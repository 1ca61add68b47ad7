"""Measures the time that each part of the tool takes, only with `--profile`."""
