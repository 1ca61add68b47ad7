"""A process that runs batches of tasks in isolated workers for `campaign.execution.cluster`.

Batches come on its standard input; their outcomes leave on its standard output. Started as
`python -m foresee_dsl.campaign.execution.batch_host LIFELINE MEMORY_MB`.
"""

from __future__ import annotations

import os
import pickle
import sys
from dataclasses import replace
from typing import Any

from foresee_dsl.campaign.execution.cluster import read, write
from foresee_dsl.campaign.execution.lifeline import end_with
from foresee_dsl.campaign.execution.pool import Broken, Task, WorkerPool


def main(lifeline: int, memory_mb: float) -> None:
    """Work until standard input ends, or the process that started this one does."""
    end_with(lifeline)
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what a driver prints must not get between the answers
    with WorkerPool(1, memory_mb=memory_mb) as pool:
        while (packed := read(sys.stdin.buffer)) is not None:
            tasks: list[Task] = pickle.loads(packed)  # noqa: S301 - from the process that started this one
            write(answers, pickle.dumps(_run(pool, tasks)))


def _run(pool: WorkerPool, tasks: list[Task]) -> list[tuple[int, Any]]:
    numbers = {id(task): index for index, task in enumerate(tasks)}
    pool.add(tasks)
    found = []
    for update in pool.updates():
        value = update.value
        if isinstance(value, Broken):  # its task is known there
            value = replace(value, task=replace(value.task, argument=None))
        found.append((numbers[id(update.task)], value))
    return found


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]))
