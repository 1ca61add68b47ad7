"""What a run's result is made of: contacts, verdict, near misses."""
