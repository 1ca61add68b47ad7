"""Regression suites: test cases with expected results in a folder, which are run again and compared."""
