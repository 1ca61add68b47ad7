"""Execution of a campaign's steps, and of single test cases, in worker processes."""
