"""What is allowed and hardly meant: `lint.lint` calls the rules, `allowances` are the comments that permit it."""
