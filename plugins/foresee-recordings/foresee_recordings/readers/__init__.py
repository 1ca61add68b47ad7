"""Readers of recordings, a module for each format."""
