"""Codes of mistakes and lints: their names in the source, and what each means."""
