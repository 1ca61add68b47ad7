"""The commands `foresee study` and `foresee fuzz`."""
