"""Where a campaign's results are kept: rows by key, traces as files."""
