"""The text side: `parser` (text to model), `printer` (model to text), `model`, `units`, `checks`, `messages`.

Nothing is imported here: `foresee --help` must not pay for the parser.
"""
