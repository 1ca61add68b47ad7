"""How a campaign's tasks are run: worker processes here or on a Dask cluster."""
