"""Who runs a campaign's tasks: processes here, or the workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Protocol

from foresee_dsl.campaign.execution.pool import Task, Update, WorkerPool

if TYPE_CHECKING:
    from foresee_dsl.campaign.execution.engine import RunOptions


class Executor(Protocol):
    """Runs tasks, isolated from each other."""

    def add(self, tasks: Iterable[Task], priority: tuple[int, ...] = ()) -> None:
        """Queue more tasks; smaller priorities go first."""

    def updates(self, stop: Callable[[], bool]) -> Iterator[Update]:
        """Yield what becomes of them until none is left, or `stop` says so."""

    def close(self) -> None:
        """End; what is under way is lost."""


def local(options: RunOptions) -> Executor:
    """Return the executor that runs tasks in processes here."""
    return WorkerPool(options.jobs, memory_mb=options.limits.memory_mb)
