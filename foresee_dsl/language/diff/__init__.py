"""Compares two files by meaning: returns the differences in words and as an edit script.

    changes = compare.diff_models(a, b)     # runner.speed: 50 km/h => 60 km/h (+10 km/h)
    parts.apply(a, changes)                 # means what b means

`compare` pairs the statements and finds the differences, `wording` words them, `parts` has their records and applies
them, `rendering` renders them, `addresses` reads the files, `plain` writes a file for `git diff`.
"""
