"""Runs the importers on folders of files that others wrote, and writes what came of each into a table."""
