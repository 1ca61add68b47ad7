"""What the Language Server Protocol asks for: messages, positions in a text, and names of files."""
