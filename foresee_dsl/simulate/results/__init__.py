"""The parts of a run's result: contacts, verdict, near misses."""
