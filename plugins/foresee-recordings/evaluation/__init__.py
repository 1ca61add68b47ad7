"""Measurements of mining; not part of the wheel."""
