"""Allocation of mutants in rounds: each round gives more mutants to the clips whose earlier ones were worth more."""
