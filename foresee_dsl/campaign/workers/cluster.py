"""The Dask executor: runs batches of a campaign's tasks on a cluster, each as one Dask task, in isolated workers.

A Dask worker runs no simulation itself. It starts one host (this module as a program, with the arguments LIFELINE,
MEMORY_MB and a PIPE for each of its threads), a process with as many isolated workers; so a driver's effects on its
process never reach Dask. Batches and outcomes pass through the pipes, and the host ends with the Dask worker.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import queue
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, is_dataclass, replace
from importlib import import_module
from itertools import chain
from multiprocessing.connection import Connection
from typing import Any

from foresee_dsl.campaign.settings import CampaignLimits
from foresee_dsl.campaign.workers.isolation import Task, end_with
from foresee_dsl.campaign.workers.pool import BATCH, DEATHS, BrokenTask, Executor, RunOptions, Update, WorkerPool
from foresee_dsl.errors import ForeseeError

_TICK_S = 0.2
"""Interval between calls of `stop`, s."""
CONNECT_S = 10
"""Timeout for the connection to a scheduler, s. Ours: a reachable one answers within a second."""


class ClusterError(ForeseeError):
    """Raised if the cluster cannot be reached or the package `distributed` is not installed."""


def dask(scheduler: str = "", *, dashboard: str = "") -> Callable[[RunOptions], DaskExecutor]:
    """Return a factory of executors on a scheduler's cluster (`tls://10.0.0.1:8786`), or on a cluster started here.

    `dashboard`: address of Dask's web page for a cluster started here (`:8787`); by default there is no page.
    """
    return lambda options: DaskExecutor(
        scheduler, jobs=options.jobs, memory_mb=options.limits.memory_mb, dashboard=dashboard
    )


class DaskExecutor(Executor):
    """Runs tasks on the workers of a Dask cluster."""

    def __init__(
        self, scheduler: str = "", *, jobs: int = 1, memory_mb: float = CampaignLimits.memory_mb, dashboard: str = ""
    ) -> None:
        """Connect to a scheduler, or start a cluster of `jobs` processes here; each of our workers gets `memory_mb`.

        Raises:
            ClusterError: there is no scheduler at the address, or `distributed` is not installed.
        """
        super().__init__()
        self._client = _client(scheduler, jobs, dashboard)
        self._memory_mb = memory_mb
        self._batches: dict[Any, list[int]] = {}
        self._lost: Counter[int] = Counter()
        self._ended: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def updates(self, stop: Callable[[], bool] = lambda: False) -> Iterator[list[Update]]:
        """See `Executor`; `stop` is called five times a second."""
        while self._tasks and not stop():
            self._submit()
            arrived: list[Update] = []
            with contextlib.suppress(queue.Empty):
                arrived += self._take(self._ended.get(timeout=_TICK_S))
                while True:
                    arrived += self._take(self._ended.get_nowait())
            if arrived:
                yield arrived

    def close(self) -> None:
        """Cancel the running batches and leave the cluster; a cluster started here ends."""
        with contextlib.suppress(Exception):  # the cluster may be gone already
            self._client.cancel(list(self._batches))
        self._batches.clear()
        self._tasks.clear()
        cluster = self._client.cluster
        self._client.close()
        if cluster is not None:
            cluster.close()

    def _submit(self) -> None:
        """Keep two batches per thread of the cluster submitted: one that runs, and one that waits."""
        try:
            threads = max(1, sum(self._client.nthreads().values()))
        except Exception as err:
            # Dask raises exceptions of many kinds, each of which means that the scheduler does not answer.
            raise ClusterError(
                f"the Dask scheduler does not answer any more ({err}): finished results are kept, and the same "
                "command continues from there"
            ) from err
        while self._queue and len(self._batches) < 2 * threads:
            size = max(1, min(BATCH, len(self._queue) // (2 * threads)))
            numbers = self._queue.take(size)
            tasks = [_inlined(self._tasks[number]) for number in numbers]
            # Not pure, because Dask must run a lost batch again, and must not return a remembered result.
            future = self._client.submit(run_batch, pickle.dumps(tasks), self._memory_mb, pure=False)
            self._batches[future] = numbers
            future.add_done_callback(self._ended.put)

    def _take(self, future: Any) -> Iterator[Update]:  # noqa: ANN401 - Dask's, which has no types
        numbers = self._batches.pop(future, None)
        if numbers is None:
            return
        if future.status != "finished":
            yield from self._resend(numbers, str(future.exception() if future.status == "error" else future.status))
            return
        updates: list[tuple[int, Any]] = pickle.loads(future.result())  # noqa: S301 - from our own workers
        for index, value in updates:
            number = numbers[index]
            task = self._tasks[number]
            update = Update(task, replace(value, task=task) if isinstance(value, BrokenTask) else value)
            if update.final:
                del self._tasks[number]
            yield update

    def _resend(self, numbers: list[int], why: str) -> Iterator[Update]:
        """Submit tasks again whose Dask worker or host ended; each task at most `DEATHS` times."""
        for number in numbers:
            self._lost[number] += 1
            if self._lost[number] < DEATHS:
                self._queue.push(number, (-1, number), self._tasks[number].shares)
            else:
                task = self._tasks.pop(number)
                yield Update(task, BrokenTask(task, f"lost with its Dask worker {DEATHS} times: {why}", "killed"))


def run_batch(packed: bytes, memory_mb: float) -> bytes:
    """Run a pickled list of tasks in this Dask worker's host; this is what Dask calls.

    Returns:
        A pickled list of updates: each task's index, and a part, an outcome or a `BrokenTask`.

    Raises:
        ClusterError: the host ended.
    """
    return _host(memory_mb).run(packed)


class _Host:
    """A process that runs batches of tasks (`serve`), as its Dask worker sees it."""

    def __init__(self, memory_mb: float, threads: int) -> None:
        """Start it, for as many batches at a time as the Dask worker has threads."""
        line, self._lifeline = os.pipe()
        pipes = [multiprocessing.Pipe() for _ in range(threads)]
        self._free: queue.SimpleQueue[Connection] = queue.SimpleQueue()
        passed = [theirs.fileno() for _, theirs in pipes]
        arguments = map(str, (line, memory_mb, *passed))
        command = [sys.executable, "-m", "foresee_dsl.campaign.workers.cluster", *arguments]
        # Standard output belongs to the report (`--json`); prints of drivers go to standard error.
        self._process = subprocess.Popen(  # noqa: S603 - this interpreter, our own module
            command, stdin=subprocess.DEVNULL, stdout=2, pass_fds=[line, *passed], start_new_session=True
        )
        os.close(line)
        for ours, theirs in pipes:
            theirs.close()
            self._free.put(ours)

    def run(self, packed: bytes) -> bytes:
        pipe = self._free.get()
        try:
            pipe.send_bytes(packed)
            return pipe.recv_bytes()
        except (OSError, EOFError) as err:
            self.end()
            code = self._process.wait()
            raise ClusterError(f"the host of the isolated workers ended with exit code {code}") from err
        finally:
            self._free.put(pipe)

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    def end(self) -> None:
        """End it and its isolated workers; several threads may do so."""
        with _STARTING:
            if self._lifeline >= 0:
                os.close(self._lifeline)
                self._lifeline = -1


_hosts: list[_Host] = []
"""The host of this Dask worker, if it has one."""
_STARTING = threading.Lock()


def _host(memory_mb: float) -> _Host:
    from distributed import get_worker

    with _STARTING:
        if not (_hosts and _hosts[0].alive):
            _hosts[:] = [_Host(memory_mb, get_worker().state.nthreads)]
        return _hosts[0]


def _inlined(task: Task) -> Task:
    """Return a task that contains the bytes of its files, so that it needs no file of this machine."""
    argument = task.argument
    if not is_dataclass(argument) or isinstance(argument, type):
        return task
    values = {f.name: getattr(argument, f.name) for f in fields(argument)}
    changed = {name: value.inline() for name, value in values.items() if hasattr(value, "inline")}
    return replace(task, argument=replace(argument, **changed))


def _client(scheduler: str, jobs: int, dashboard: str) -> Any:  # noqa: ANN401 - the package has no types
    """Return Dask's client.

    Anyone with access to a scheduler can run code on its workers, because it unpickles its input. So a scheduler
    started here listens on this machine only, and accepts only connections with its certificate, which is kept in
    memory.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError as err:
        raise ClusterError("Dask is not installed: pip install 'foresee-dsl[dask]'") from err
    try:
        if scheduler:
            return distributed.Client(scheduler, timeout=CONNECT_S)
        return _here(distributed, jobs, dashboard)
    except (OSError, ValueError) as err:
        raise ClusterError(f"there is no Dask scheduler at {scheduler or 'this machine'}: {err}") from err


def _here(distributed: Any, jobs: int, dashboard: str) -> Any:  # noqa: ANN401 - Dask's, as above
    """Start a cluster here and return its client. Its web server serves pages only with a dashboard."""
    security = _certificates(distributed)
    pages: dict[str, list[str]] = {"distributed.scheduler.http.routes": [], "distributed.worker.http.routes": []}
    with import_module("dask").config.set({} if dashboard else pages):
        cluster = distributed.LocalCluster(
            n_workers=1,
            threads_per_worker=jobs,
            processes=True,
            host="127.0.0.1",
            protocol="tls://",
            security=security,
            dashboard_address=(f"127.0.0.1{dashboard}" if dashboard.startswith(":") else dashboard) or None,
            worker_dashboard_address=None,
        )
    if not dashboard:
        cluster.scheduler.http_server.stop()  # Dask 2026.8 starts the dashboard even without routes
    return distributed.Client(cluster, security=security)


def _certificates(distributed: Any) -> Any:  # noqa: ANN401 - Dask's, as above
    try:
        return distributed.Security.temporary()
    except ImportError as err:
        raise ClusterError("a cluster here needs certificates: pip install 'foresee-dsl[dask]'") from err


def serve(lifeline: int, memory_mb: float, descriptors: Sequence[int]) -> None:
    """Serve as a host until the other ends of all pipes are closed, or the process that started this one ends."""
    end_with(lifeline)
    threads = [threading.Thread(target=_serve_batches, args=(descriptor, memory_mb)) for descriptor in descriptors]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def _serve_batches(descriptor: int, memory_mb: float) -> None:
    """Run the batches that come through a pipe, one after the other, in an isolated worker."""
    with (
        WorkerPool(1, memory_mb=memory_mb) as pool,
        Connection(descriptor) as pipe,
        contextlib.suppress(EOFError, ConnectionError),
    ):
        while True:
            tasks: list[Task] = pipe.recv()
            numbers = {id(task): index for index, task in enumerate(tasks)}
            pool.add(tasks)
            pipe.send(
                [
                    (numbers[id(update.task)], _without_argument(update.value))
                    for update in chain.from_iterable(pool.updates())
                ]
            )


def _without_argument(value: Any) -> Any:  # noqa: ANN401 - what a task gave
    """Return a task's outcome without the task's argument if the task broke; the sender has the argument already."""
    return replace(value, task=replace(value.task, argument=None)) if isinstance(value, BrokenTask) else value


if __name__ == "__main__":
    serve(int(sys.argv[1]), float(sys.argv[2]), [int(descriptor) for descriptor in sys.argv[3:]])
