"""Commands for authors: init, check, fmt, draw, compare."""
