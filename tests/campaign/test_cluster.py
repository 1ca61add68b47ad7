"""A Dask cluster of two workers with two threads each: the same results as without, also when one is killed."""

from __future__ import annotations

import ctypes
import math
import os
import signal
import socket
import time
import warnings
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import pytest

from foresee_dsl.campaign.storage.store import StoredResult
from foresee_dsl.campaign.workers.cluster import ClusterError, DaskExecutor, dask
from foresee_dsl.campaign.workers.pool import BrokenTask, RunOptions, Task
from tests.support.small_campaign import SETTINGS, Heard, campaign, published, write_project

distributed = pytest.importorskip("distributed", reason="the extra `dask` is not installed")
pytestmark = pytest.mark.filterwarnings("default")  # a cluster that loses a worker warns of much


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        made = distributed.LocalCluster(n_workers=2, threads_per_worker=2, processes=True, dashboard_address=None)
        yield made
        made.close()


def test_a_task_that_dies_takes_no_dask_worker_along(cluster: Any) -> None:
    executor = DaskExecutor(cluster.scheduler_address)
    with distributed.Client(cluster) as client:
        before = client.run(os.getpid)
        executor.add([Task(f"root_{k}", math.sqrt, float(k)) for k in range(12)])
        executor.add([Task("dies", ctypes.string_at, 0), Task("hangs", time.sleep, 60, deadline_s=0.5)])
        try:
            found = {update.task.name: update.value for update in chain.from_iterable(executor.updates())}
        finally:
            executor.close()
        assert client.run(os.getpid) == before
    assert [found[f"root_{k}"] for k in range(12)] == [math.sqrt(k) for k in range(12)]
    dies, hangs = found["dies"], found["hangs"]
    assert isinstance(dies, BrokenTask) and "SIGSEGV" in dies.reason and dies.task.argument == 0
    assert isinstance(hangs, BrokenTask) and hangs.how == "timeout"


def test_all_threads_of_a_dask_worker_share_one_host(cluster: Any) -> None:
    executor = DaskExecutor(cluster.scheduler_address)
    executor.add(Task(f"status_{k}", Path.read_text, Path("/proc/self/stat")) for k in range(40))
    try:
        states = [update.value.rpartition(")")[2].split() for update in chain.from_iterable(executor.updates())]
    finally:
        executor.close()
    parents = {parent for _, parent, *_ in states}
    assert 1 <= len(parents) <= 2  # the fork server of each host, not of each thread


class Killer(Heard):
    """Kills a Dask worker when the first clip is done."""

    def __init__(self, pid: int) -> None:
        super().__init__()
        self.pid = pid

    def done(self, row: StoredResult, *, new: bool = True) -> None:
        super().done(row, new=new)
        if row.kind == "clip" and self.pid:
            os.kill(self.pid, signal.SIGKILL)
            self.pid = 0


def test_the_same_results_when_a_worker_is_killed_half_way(cluster: Any, tmp_path: Path) -> None:
    file = write_project(tmp_path / "project")
    with distributed.Client(cluster) as client:
        killer = Killer(sorted(client.run(os.getpid).values())[0])
    options = RunOptions(executor=dask(cluster.scheduler_address))
    adaptive = replace(SETTINGS, allocation="adaptive")
    campaign(file, tmp_path / "cluster", adaptive, options=options, heard=killer)
    assert killer.pid == 0  # it was killed
    assert [killer.count(kind) for kind in ("seed", "clip", "child")] == [3, 3, 12] and "minimise" in killer.kinds
    campaign(file, tmp_path / "here", adaptive, options=RunOptions(jobs=2))
    assert published(tmp_path / "cluster") == published(tmp_path / "here")


def test_no_scheduler_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("foresee_dsl.campaign.workers.cluster.CONNECT_S", 0.5)
    with pytest.raises(ClusterError, match=r"no Dask scheduler at tcp://127\.0\.0\.1:9"):
        DaskExecutor("tcp://127.0.0.1:9")


def test_a_cluster_that_is_started_here_takes_nobody_else() -> None:
    executor = DaskExecutor(jobs=1)
    try:
        address = executor._client.scheduler_info()["address"]
        assert address.startswith("tls://127.0.0.1:")
        with (
            pytest.raises(OSError, match="refused"),
            socket.create_connection(
                ("127.0.0.1", executor._client.scheduler_info()["services"]["dashboard"]), timeout=2
            ),
        ):
            pass  # no web page either
        with pytest.raises((OSError, TypeError, RuntimeError)):  # no certificate, or one of its own
            distributed.Client(address, timeout=2, security=distributed.Security.temporary())
        executor.add([Task("root", math.sqrt, 4.0)])
        assert [update.value for update in chain.from_iterable(executor.updates())] == [2.0]
    finally:
        executor.close()
