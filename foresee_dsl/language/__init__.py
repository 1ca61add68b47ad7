"""The text side: `parser` (text to model), `printer` (model to text), `model`, `units`, `diagnostics`, `checks`.

Nothing is imported here: `foresee --help` must not pay for the parser.
"""
