"""The text side of the tool: reads `.foresee` files into the model, checks them and prints them. `parser` turns text
into a model, `printer` a model into text; `model`, `units`, `checks` and `messages` are what both need.

Nothing is imported here: `foresee --help` must not pay for the parser.
"""
