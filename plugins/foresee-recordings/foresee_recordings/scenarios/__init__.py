"""Writes situations of recordings as test cases, with the files that these use."""
