"""Execution of a campaign's tasks in worker processes, here or on a Dask cluster."""
