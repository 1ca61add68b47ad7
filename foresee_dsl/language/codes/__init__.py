"""Codes of errors and lints: their names in the source, and their explanations."""
