"""Reports on the terminal: the progress of a command, and its result."""
