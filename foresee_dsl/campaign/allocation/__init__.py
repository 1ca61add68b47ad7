"""Allocates mutants to clips in rounds: clips whose earlier mutants were more useful get more of the next ones."""
