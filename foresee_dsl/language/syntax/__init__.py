"""Turns text into a tree and the tree into a model, with the places of all parts, and explains the errors of a broken
file."""
