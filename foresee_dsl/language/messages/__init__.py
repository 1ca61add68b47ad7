"""Diagnostics: how they are placed, worded and rendered."""
