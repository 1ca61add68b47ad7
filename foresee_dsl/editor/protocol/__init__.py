"""Parts of the Language Server Protocol: messages, positions in a text, and names of files."""
