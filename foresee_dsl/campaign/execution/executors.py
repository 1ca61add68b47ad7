"""What a campaign is run with: its options, and what runs its tasks (processes here, or a Dask cluster's workers)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Protocol

from foresee_dsl.campaign.execution.pool import Task, Update, WorkerPool
from foresee_dsl.campaign.settings import Limits, Shard


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


@dataclass(frozen=True)
class RunOptions:
    """How a campaign is done; none of it changes a result.

    Attributes:
        jobs: worker processes here. limits: what a run may take. shard: the part of the campaign.
        retry: run again what broke in an earlier campaign (died, hung, raised).
        executor: makes what runs the tasks. stop: asked ten times a second whether to stop.
    """

    jobs: int = 1
    limits: Limits = field(default_factory=Limits)
    shard: Shard = field(default_factory=Shard)
    retry: bool = False
    executor: Callable[[RunOptions], Executor] = local
    stop: Callable[[], bool] = lambda: False
