"""Support for editors: the language server, the highlighters, the TextMate grammar."""
