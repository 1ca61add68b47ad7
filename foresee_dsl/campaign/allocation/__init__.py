"""Allocates mutants to clips in rounds: a clip whose earlier mutants were more useful gets more of the next ones."""
