"""Children where they pay: rounds, what each child of the rounds before was worth, and who gets the next ones."""
