"""Commands for what is written: beginning, checking, formatting, drawing, comparing."""
