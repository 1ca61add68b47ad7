"""Commands that this plug-in adds to `foresee`."""
