"""`--profile`: what a command does is measured by part."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from foresee_dsl.campaign.profiling.tasks import Profiler


@contextmanager
def profiling() -> Iterator[Profiler]:
    """Measure what is done within it."""
    from foresee_dsl.campaign.profiling.tasks import Profiler

    profiler = Profiler()
    with profiler.command():
        yield profiler
