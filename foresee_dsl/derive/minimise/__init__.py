"""Makes a failing mutant as small as its failure allows: fewer changes and actors, smaller numbers, a shorter clip."""
