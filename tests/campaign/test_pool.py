"""The worker pool: a task that ends its process is named, and every other one is kept."""

from __future__ import annotations

import math
import os

import pytest

from foresee_dsl.campaign.pool import Broken, Task, WorkerPool


def outcomes(jobs: int, tasks: list[Task]) -> dict[str, object]:
    pool = WorkerPool(jobs)
    pool.add(tasks)
    try:
        return {task.name: outcome for task, outcome in pool.results()}
    finally:
        pool.close()


@pytest.mark.parametrize("jobs", [1, 2])
def test_one_that_dies_does_not_take_the_others_along(jobs: int) -> None:
    tasks = [Task(f"root_{k}", math.sqrt, float(k)) for k in range(6)]
    tasks.insert(2, Task("dies", os._exit, 7))
    tasks.insert(4, Task("raises", math.sqrt, -1.0))
    found = outcomes(jobs, tasks)
    assert {name: found[name] for name in found if name.startswith("root")} == {
        f"root_{k}": math.sqrt(k) for k in range(6)
    }
    assert isinstance(found["dies"], Broken)
    assert "process died" in found["dies"].reason
    assert isinstance(found["raises"], Broken)
    assert "ValueError" in found["raises"].reason


def test_tasks_may_be_added_while_others_run() -> None:
    pool = WorkerPool(2)
    pool.add([Task("first", math.sqrt, 16.0)])
    seen = []
    for task, outcome in pool.results():
        seen.append((task.name, outcome))
        if task.name == "first":
            pool.add([Task("second", math.sqrt, outcome)])
    pool.close()
    assert seen == [("first", 4.0), ("second", 2.0)]
