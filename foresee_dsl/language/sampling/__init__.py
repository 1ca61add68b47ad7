"""Logical scenarios: drawn values (`draws`), `require` (`requirements`), what of the ranges is reached (`coverage`)."""
