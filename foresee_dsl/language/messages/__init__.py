"""Diagnostics for the author of a file: collects them with their places, words them and renders them."""
