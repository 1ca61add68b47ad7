"""Recorded traffic for foresee-dsl: readers of data sets, `foresee mine`, and test cases made of recordings."""
