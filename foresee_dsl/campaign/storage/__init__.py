"""Storage of a campaign's results: rows by key, traces as files."""
