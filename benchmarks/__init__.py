"""What the tool costs, measured: `make bench`."""
