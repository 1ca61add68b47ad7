"""Commands for authors of scenarios: init, check, fmt, draw, compare and others."""
