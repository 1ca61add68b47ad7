"""Code that several commands share: exit codes, errors, options, the choice of test cases, output formats."""
