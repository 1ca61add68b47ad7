"""Joins files to test cases: resolves addresses, catalogues, extensions, clips, mutants and parameters."""
