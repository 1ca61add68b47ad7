"""Worker processes that run tasks of a campaign, here or on a Dask cluster."""
