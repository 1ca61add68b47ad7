"""What differs in meaning between two files, in words and as an edit script.

    changes = diff_models(a, b)     # runner.speed: 50 km/h => 60 km/h (+10 km/h)
    apply(a, changes)               # means what b means

`compare` finds the differences, `matching` says which statement is which, `wording` words them, `applying` makes them,
`rendering` shows them, `addresses` reads the files, `plain` writes a file for `git diff`.
"""
