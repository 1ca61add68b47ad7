"""Warnings about valid texts that are probably not meant: `lint.lint` calls the rules, `allowances` reads the comments
that permit them."""
