"""Answers of the server other than diagnostics: quick fixes, hints, lenses, tokens and pictures."""
