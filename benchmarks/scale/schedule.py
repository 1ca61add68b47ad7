"""Computes the duration of a campaign on 1 to 1,000 workers from the durations of a real campaign's steps.

It uses list scheduling: a free worker takes the first ready task in the campaign's order. The campaign's own process
handles the results one after the other; the tasks that follow from a result are ready only after that.
"""

from __future__ import annotations

import heapq
import json
import sqlite3
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from benchmarks import bench_campaign
from benchmarks.sections import table

WORKERS = (1, 2, 10, 100, 1000)
REPEAT = 29
"""Number of repeats of each clip's mutation in `make study`."""
WORTH = 0.5
"""A number of workers is useful if they are busy for at least this share of the time (ours)."""
STORE = Path("out/store")
"""The store of the results of `make campaign`."""
_LATEST = Path(__file__).parents[1] / "latest.json"


@dataclass(eq=False)
class Task:
    """The work that a worker does without interruption.

    Attributes:
        took_s: duration by the store, s. results: number of rows that the campaign's process stores.
        order: priority; smaller values are first. then: tasks that follow when its results are stored.
        kind: kind of its first step.
    """

    took_s: float
    results: int
    order: tuple[int, int]
    then: list[Task] = field(default_factory=list)
    kind: str = ""


@dataclass(frozen=True)
class Work:
    """A campaign: its first tasks, and the tasks that are ready after all that follow from these."""

    first: tuple[Task, ...]
    last: tuple[Task, ...]

    def tasks(self) -> Iterator[Task]:
        """Yield all tasks."""
        ahead = [*self.first, *self.last]
        while ahead:
            yield (task := ahead.pop())
            ahead += task.then


def work_of(store: Path, repeat: int = 1) -> Work:
    """Return the tasks of the campaign in a store; each child counts `repeat` times, as with other seeds."""
    with sqlite3.connect(f"file:{store / 'runs.sqlite'}?mode=ro", uri=True) as rows:
        durations: defaultdict[str, dict[str, float]] = defaultdict(dict)
        for kind, name, took_s in rows.execute("SELECT kind, name, wall_s FROM runs ORDER BY kind, name"):
            durations[kind][name] = took_s
    seeds = {
        n: Task(t + durations["forecast"].get(n, 0.0), 2, (0, 0), [], "test case") for n, t in durations["seed"].items()
    }
    clips, children, small = {}, {}, {}
    for name, took_s in durations["clip"].items():
        case, _, rank = name.rpartition("_p")
        clips[name] = Task(took_s + durations["mutants"].get(name, 0.0), 2, (int(rank), 1), [], "clip")
        seeds[case].then.append(clips[name])
    for name, took_s in durations["child"].items():
        clip = name.rpartition("_m")[0]
        clip = clip if clip in clips else clip.rpartition("_s")[0]
        children[name] = Task(took_s, 1, (clips[clip].order[0], 2), [], "child")
        clips[clip].then += [children[name], *(Task(took_s, 1, children[name].order) for _ in range(repeat - 1))]
    for name, took_s in durations["minimise"].items():
        small[name] = Task(took_s, 1, (1000, 3), [], "minimising")
    above = {"reference": children, "case_reference": seeds, "minimised_reference": small}
    for kind, by_name in above.items():
        for name, took_s in durations[kind].items():
            failure = next(n for n in (name[:k] for k in range(len(name), 0, -1)) if n in by_name)
            by_name[failure].then.append(Task(took_s, 1, (by_name[failure].order[0], 3), [], "reference driver"))
    return Work(tuple(seeds.values()), tuple(small.values()))


def begun_early(work: Work) -> Work:
    """Return the same work as if no clip had to wait for its test case's own run: more than could be gained by clips
    that begin while that run goes on.
    """
    first: list[Task] = []
    for case in work.first:
        waiting = [task for task in case.then if task.kind != "clip"]
        first += (replace(case, then=waiting), *(task for task in case.then if task.kind == "clip"))
    return Work(tuple(first), work.last)


@dataclass(frozen=True)
class Own:
    """Time of the campaign's own process per result, s: on its arrival, and for the report at the end."""

    comes_s: float
    ends_s: float

    def of(self, work: Work) -> float:
        """Return the time for all results, s."""
        return sum(task.results for task in work.tasks()) * (self.comes_s + self.ends_s)


def scheduled_s(work: Work, workers: int, own: Own) -> float:
    """Return the duration of a campaign on a number of workers, s."""
    now_s = _run(work.first, workers, own.comes_s, 0.0)
    now_s = _run(work.last, workers, own.comes_s, now_s)
    return now_s + sum(task.results for task in work.tasks()) * own.ends_s


def _run(first: tuple[Task, ...], workers: int, result_s: float, now_s: float) -> float:
    ready = [(task.order, k, task) for k, task in enumerate(first)]
    heapq.heapify(ready)
    number = len(ready)
    under_way: list[tuple[float, int, Task]] = []  # with the time at which the task ends
    free = workers
    handled_s = now_s  # time until which the campaign's process is busy
    while ready or under_way:
        while ready and free:
            _, k, task = heapq.heappop(ready)
            heapq.heappush(under_way, (now_s + task.took_s, k, task))
            free -= 1
        done_s, _, task = heapq.heappop(under_way)
        free += 1
        handled_s = max(handled_s, done_s) + task.results * result_s
        # A worker without a ready task waits for one; the others continue.
        now_s = done_s if ready else max(done_s, handled_s)
        for new in task.then:
            number += 1
            heapq.heappush(ready, (new.order, number, new))
    return max(now_s, handled_s)


def longest_chain(work: Work) -> list[Task]:
    """Return the longest chain of tasks that follow from each other; more workers cannot shorten it."""

    def chain(task: Task) -> list[Task]:
        return [task, *max(map(chain, task.then), key=_took_s, default=[])]

    return [*max(map(chain, work.first), key=_took_s), *max(map(chain, work.last), key=_took_s, default=[])]


def _took_s(tasks: list[Task]) -> float:
    return sum(task.took_s for task in tasks)


def largest_useful(work: Work, own: Own) -> int:
    """Return the largest number of workers that are busy for at least `WORTH` of the time."""
    busy_s = sum(task.took_s for task in work.tasks())
    fits, too_many = 1, 1 << 14
    while too_many - fits > 1:
        middle = (fits + too_many) // 2
        worth = busy_s >= WORTH * middle * scheduled_s(work, middle, own)
        fits, too_many = (middle, too_many) if worth else (fits, middle)
    return fits


def text(store: Path = STORE) -> str:
    """Return the tables for the campaign in a store and for one as large as the study."""
    if not (store / "runs.sqlite").is_file():
        raise SystemExit(f"{store} holds no results: `make campaign` first")
    latest = json.loads(_LATEST.read_text(encoding="utf-8"))["ratios"]
    runs = bench_campaign.CASES * (1 + 4 + 16 * bench_campaign.REPEAT)
    own = Own(latest["engine_ms_per_run"] / 1000, latest["resume_s"] / runs)
    return "\n".join(_text(work_of(store, repeat), title, own)
                     for repeat, title in ((1, "`make campaign`"), (REPEAT, "`make study`")))  # fmt: skip


def _text(work: Work, title: str, own: Own) -> str:
    tasks = list(work.tasks())
    busy_s = sum(task.took_s for task in tasks)
    rows = []
    gains = []
    for workers in WORKERS:
        took_s = scheduled_s(work, workers, own)
        gains.append(1 - scheduled_s(begun_early(work), workers, own) / took_s)
        rows.append((workers, f"{took_s:.1f}", f"{busy_s / took_s:.1f}", f"{busy_s / took_s / workers:.0%}"))
    most, chain, parent_s = largest_useful(work, own), longest_chain(work), own.of(work)
    chain_s, steps = _took_s(chain), ", ".join(f"{task.kind} {task.took_s:.1f} s" for task in chain)
    limit = "its own process, which handles one result after the other" if parent_s > chain_s else (
        "the longest chain of steps that follow from each other"
    )  # fmt: skip
    return (
        f"{table((f'{title}: workers', 's', 'times one', 'busy'), rows)}\n"
        f"{len(tasks):,} tasks of {busy_s:.0f} s together; the longest chain takes {chain_s:.1f} s ({steps}), the "
        f"campaign's own process {parent_s:.1f} s. Up to {most} workers are busy for half of the time; what limits it "
        f"is {limit}. If no clip had to wait for its test case's run, a campaign would take {max(gains):.1%} less "
        "time at most.\n"
    )
