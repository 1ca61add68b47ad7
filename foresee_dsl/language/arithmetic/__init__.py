"""Expressions: their dimensions, their values in a case, and which of them mean the same."""
