"""Profiles: time by part of the tool, measured only with `--profile`."""
