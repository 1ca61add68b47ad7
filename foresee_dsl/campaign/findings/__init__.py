"""Findings: failures with the same story, their minimised representative, and its review."""
