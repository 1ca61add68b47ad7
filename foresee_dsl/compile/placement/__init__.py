"""Where everybody is at the first frame."""
