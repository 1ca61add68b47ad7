"""Warnings about texts that are valid but probably not what the author meant.

`lint.lint` calls the rules; `allowances` reads the comments that permit a warning.
"""
