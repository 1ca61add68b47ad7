"""Where each actor is at the first frame."""
