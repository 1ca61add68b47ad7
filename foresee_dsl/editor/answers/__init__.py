"""What the server shows beside mistakes: quick fixes, hints, lenses, tokens and pictures."""
