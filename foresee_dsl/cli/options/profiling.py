"""The option `--profile`: measure how much time each part of a command takes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from foresee_dsl.campaign.profiling.tasks import Profiler


@contextmanager
def profiling() -> Iterator[Profiler]:
    """Measure the time that is spent inside this context, and yield the profiler."""
    from foresee_dsl.campaign.profiling.tasks import Profiler

    profiler = Profiler()
    with profiler.command():
        yield profiler
