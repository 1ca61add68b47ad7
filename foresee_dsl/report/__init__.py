"""What people read: the terminal report."""
