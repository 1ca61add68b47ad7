"""The speed-up of a real campaign by a second worker, and its memory.

Each campaign is a process of its own, begins with an empty store, and runs test cases of the library with `pdm`. The
two alternate, and the fastest run of each counts.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.figures import Figure, costs, peak_mb
from benchmarks.library import cases
from foresee_dsl.campaign.execution.engine import run_campaign
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.storage.store import Store
from foresee_dsl.campaign.workers.isolation import Worker
from foresee_dsl.campaign.workers.pool import RunOptions, WorkerPool

ROUNDS = 3
SETTINGS = CampaignSettings(ranker="foresee", preset="focused", risky_points=4, repeat=2)
"""Ours: 170 runs, so that the start of each worker (0.6 s of CPU for imports and the network) matters little."""
_LEAST = 1.85
"""Target of the speed-up (docs/background/performance.md)."""


class Measured(WorkerPool):
    """A pool that records the peak memory of its workers at the end."""

    peaks_mb: tuple[float, ...] = ()

    def close(self) -> None:
        """Record the workers' peak memory, and end them."""
        self.peaks_mb = tuple(peak_mb(str(pid)) for pid in self.pids)
        super().close()


def figures() -> Iterator[Figure]:
    """Measure, and return the speed-up and the memory."""
    taken = costs({"one": lambda: _campaign(1), "two": lambda: _campaign(2)}, ROUNDS)
    one_s, two_s = (min(taken[name][0]) for name in ("one", "two"))
    runs = round(taken["two"][1][0])
    means = f"throughput of a campaign of {runs} runs with pdm on two workers over one, wall time"
    yield Figure("two_worker_speedup", one_s / two_s, "ratio", means, _LEAST, more=True)
    yield Figure("runs_per_s_two_workers", runs / two_s, "runs/s", "the same campaign's throughput on two workers")
    for name, kind, process in (("parent_mb", 2, "its own process"), ("worker_mb", 3, "a worker, the largest")):
        means = f"memory that the same campaign takes at most: {process}"
        yield Figure(name, max(taken["two"][kind]), "MB", means)


def _campaign(jobs: int) -> tuple[float, ...]:
    command = [sys.executable, "-m", "benchmarks.bench_workers", str(jobs)]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True)  # noqa: S603 - ourselves
    return tuple(json.loads(done.stdout))


def measure(jobs: int) -> tuple[float, int, float, float]:
    """Run the campaign; return its wall time, s, the number of runs, and peak memory of this process and of the largest
    worker, MB."""
    loaded, pools = cases(), list[Measured]()

    def pool(options: RunOptions) -> Measured:
        pools.append(Measured(options.jobs))
        return pools[-1]

    Worker().kill()  # starts the fork server, which a campaign of any length does once
    with tempfile.TemporaryDirectory() as name, Store(Path(name) / "store") as store:
        began = time.perf_counter()
        options = RunOptions(jobs=jobs, executor=pool)
        result = run_campaign(loaded, SETTINGS, out=Path(name) / "out", store=store, options=options)
        took_s = time.perf_counter() - began
    if result.broken or result.interrupted:
        raise RuntimeError(f"the campaign did not go through: {result.broken}")
    runs = len(result.seeds) + len(result.clips) + result.row().children
    return took_s, runs, peak_mb(), max(pools[0].peaks_mb)


if __name__ == "__main__":
    sys.stdout.write(json.dumps(measure(int(sys.argv[1]))))
