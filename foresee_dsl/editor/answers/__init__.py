"""Answers of the language server other than diagnostics: quick fixes, hints, lenses, tokens and pictures."""
