"""What a terminal shows: while a command works, and at its end."""
