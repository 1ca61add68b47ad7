"""The codes of errors and lints, such as `FS012`: their names in the source, and their explanations for users."""
