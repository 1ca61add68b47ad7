"""Support for editors of `.foresee` files: the language server, the highlighters and the TextMate grammar."""
