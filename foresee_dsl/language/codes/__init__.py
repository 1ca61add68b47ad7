"""Codes of mistakes and lints: their names in the source, what each means, and the files around the examples."""
