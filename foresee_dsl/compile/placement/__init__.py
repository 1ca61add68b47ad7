"""The placement of actors at the first frame."""
