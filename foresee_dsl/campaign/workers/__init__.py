"""Worker processes that run tasks of a campaign, here or on a Dask cluster."""

from __future__ import annotations

import os

CPUS = os.cpu_count() or 1
"""Default number of worker processes: one for each core."""
