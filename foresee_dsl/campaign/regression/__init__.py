"""A regression suite: test cases with expected results, kept in a folder of their own, run again and compared."""
