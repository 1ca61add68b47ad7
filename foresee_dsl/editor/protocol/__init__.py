"""Parts of the Language Server Protocol: messages, positions in a text, and addresses of files."""
