"""Which moments of a run hide a failure that a careful driver avoids: behaviours, their roll-outs, the ranker."""
