"""Findings: failures that tell one story, the one that represents them made small, and its review."""
