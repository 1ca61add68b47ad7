"""Measures the bundled campaign's runs on a local Dask cluster with 2 to 8 workers, compared with worker processes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.library import cases
from benchmarks.sections import table
from foresee_dsl.campaign.execution.engine import run_campaign
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers.cluster import dask
from foresee_dsl.campaign.workers.pool import RunOptions, local

WORKERS = (2, 4, 8)
SETTINGS = CampaignSettings(ranker="foresee", preset="focused", risky_points=4, repeat=2, against=())


def measure(executor: str, jobs: int) -> tuple[float, int]:
    """Run the campaign; return its wall time (with the start of the cluster), s, and the number of runs."""
    with tempfile.TemporaryDirectory() as name, Store(Path(name) / "store") as store:
        began = time.perf_counter()
        options = RunOptions(jobs=jobs, executor=dask() if executor == "dask" else local)
        result = run_campaign(cases(), SETTINGS, out=Path(name) / "out", store=store, options=options)
        took_s = time.perf_counter() - began
    if result.broken or result.interrupted:
        raise RuntimeError(f"the campaign did not go through: {result.broken}")
    return took_s, len(result.seeds) + len(result.clips) + result.row().children


def _alone(executor: str, jobs: int) -> tuple[float, int]:
    command = [sys.executable, "-m", "benchmarks.scale.cluster", executor, str(jobs)]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True)  # noqa: S603 - ourselves
    took_s, runs = json.loads(done.stdout)
    return took_s, runs


def text() -> str:
    """Measure, and return the table."""
    rows = []
    first_s = 0.0
    for executor, jobs in (("local", 2), *(("dask", jobs) for jobs in WORKERS)):
        took_s, runs = _alone(executor, jobs)
        first_s = first_s or took_s
        title = f"{jobs} worker processes" if executor == "local" else f"Dask, {jobs} workers"
        rows.append((title, f"{took_s:.1f}", f"{runs / took_s:.1f}", f"{first_s / took_s:.2f}"))
    return table((f"{runs} runs on {os.cpu_count()} cores", "s", "runs/s", "times two processes"), rows)


if __name__ == "__main__":
    sys.stdout.write(json.dumps(measure(sys.argv[1], int(sys.argv[2]))))
