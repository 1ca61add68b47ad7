"""The worker pool: a task that dies, hangs or takes all memory is named, and every other one is kept."""

from __future__ import annotations

import ctypes
import math
import os
import signal
import time
from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path

import pytest

from foresee_dsl.campaign.workers.pool import BrokenTask, Task, TaskPart, WorkerPool


def outcomes(jobs: int, tasks: Iterable[Task], **limits: float) -> dict[str, object]:
    pool = WorkerPool(jobs, **limits)
    pool.add(tasks)
    try:
        return {task.name: outcome for task, outcome in pool.results()}
    finally:
        pool.close()


def roots(count: int) -> list[Task]:
    return [Task(f"root_{k}", math.sqrt, float(k)) for k in range(count)]


def kept(found: dict[str, object]) -> bool:
    return all(found[name] == math.sqrt(float(name[5:])) for name in found if name.startswith("root"))


@pytest.mark.parametrize("jobs", [1, 2])
def test_one_that_dies_does_not_take_the_others_along(jobs: int) -> None:
    tasks = roots(20)
    tasks.insert(2, Task("dies", os._exit, 7))
    tasks.insert(4, Task("raises", math.sqrt, -1.0))
    tasks.insert(9, Task("crashes", ctypes.string_at, 0))
    found = outcomes(jobs, tasks)
    assert len(found) == 23 and kept(found)
    dies, raises, crashes = found["dies"], found["raises"], found["crashes"]
    assert isinstance(dies, BrokenTask) and dies.how == "crash" and "exit code 7" in dies.reason
    assert isinstance(raises, BrokenTask) and raises.how == "raised" and "ValueError" in raises.reason
    assert isinstance(crashes, BrokenTask) and "SIGSEGV" in crashes.reason


def test_one_that_hangs_is_ended() -> None:
    found = outcomes(2, [*roots(6), Task("hangs", time.sleep, 60, deadline_s=0.3), *roots(6)])
    hangs = found["hangs"]
    assert isinstance(hangs, BrokenTask) and hangs.how == "timeout" and "0.3 s of wall time" in hangs.reason
    assert kept(found)


def all_memory(size: int) -> int:
    data = bytearray(b"x") * size
    time.sleep(30)
    return len(data)


def test_one_that_takes_too_much_memory_is_ended() -> None:
    found = outcomes(2, [*roots(3), Task("grows", all_memory, 700_000_000), *roots(3)], memory_mb=500)
    grows = found["grows"]
    assert isinstance(grows, BrokenTask) and grows.how == "memory" and "500 MB" in grows.reason
    assert kept(found)


def killed_once(file: str) -> str:
    """End this process from outside, as somebody's `kill` does, unless that was done before."""
    if not Path(file).exists():
        Path(file).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "done"


def test_one_whose_process_is_killed_once_is_run_again(tmp_path: Path) -> None:
    found = outcomes(1, [Task("again", killed_once, str(tmp_path / "was")), *roots(3)])
    assert found["again"] == "done"
    assert kept(found)


def two_parts(last: int) -> Iterator[int]:
    yield 1
    if last < 0:
        os._exit(1)
    yield last


def test_parts_come_as_they_are_done_and_outlive_what_breaks_later() -> None:
    pool = WorkerPool(1)
    pool.add([Task("whole", two_parts, 2), Task("half", two_parts, -1)])
    try:
        found = [(u.task.name, u.value) for u in chain.from_iterable(pool.updates())]
    finally:
        pool.close()
    assert [v.value for name, v in found if name == "whole" and isinstance(v, TaskPart)] == [1, 2]
    assert ("whole", None) in found
    half = [value for name, value in found if name == "half"]
    assert half[0] == TaskPart(1)
    assert isinstance(half[-1], BrokenTask)


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


def test_smaller_priorities_go_first() -> None:
    pool = WorkerPool(1)
    pool.add([Task("later", math.sqrt, 1.0)], (2,))
    pool.add([Task("sooner", math.sqrt, 1.0)], (1,))
    try:
        assert [task.name for task, _ in pool.results()] == ["sooner", "later"]
    finally:
        pool.close()


def test_a_process_goes_on_with_the_clip_that_it_has_at_hand() -> None:
    """What follows from a clip comes before a third clip, which is as urgent; the second was handed out already."""
    pool = WorkerPool(1)

    def add(clip: str, step: str, turn: int) -> None:
        pool.add([Task(f"{clip}_{step}", math.sqrt, 4.0, shares=("town", clip))], (1, turn))

    for clip in ("a", "b", "c"):
        add(clip, "clip", 1)
    seen = []
    for task, outcome in pool.results():
        assert outcome == 2.0
        seen.append(task.name)
        if task.name.endswith("clip"):
            add(task.name[0], "child", 2)
    pool.close()
    assert seen == ["a_clip", "b_clip", "a_child", "b_child", "c_clip", "c_child"]


def test_it_stops_when_it_is_told_and_leaves_no_process() -> None:
    pool = WorkerPool(2)
    pool.add([Task("sleeps", time.sleep, 3600), Task("too", time.sleep, 3600)])
    began = time.monotonic()
    assert list(pool.updates(lambda: time.monotonic() - began > 0.5)) == []
    pids = pool.pids
    pool.close()
    assert len(pids) == 2
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
