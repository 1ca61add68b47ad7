"""What editors need: the language server, the highlighters, the TextMate grammar."""
