"""Where a campaign's results are stored: rows by key, traces as files."""
