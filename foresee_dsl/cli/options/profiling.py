"""`--profile`: what a command does is measured by part."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from foresee_dsl.campaign.profiling.tasks import Profiler


@contextmanager
def profiling(*, runs: bool = False, campaign: bool = False) -> Iterator[Profiler]:
    """Measure what is done within it. What it measures has to be imported within it as well.

    `runs`: runs are simulated in this process. `campaign`: it is a campaign's own process.
    """
    from foresee_dsl.campaign.profiling import seams
    from foresee_dsl.campaign.profiling.tasks import Profiler

    profiler = Profiler()
    functions = seams.CAMPAIGN if campaign else (*seams.COMMANDS, *(seams.RUNS if runs else ()))
    with profiler.command(functions, runs=runs):
        yield profiler
