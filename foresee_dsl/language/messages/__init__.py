"""Diagnostics: their places, their words and their rendering."""
