"""A campaign's schedule on 1 to 1,000 workers, worked out from the times of a real one's steps.

List scheduling: a worker that is free takes the first task that can be done, in the campaign's order. The campaign's
own process handles one result after the other, and only then are the tasks known that follow from it.
"""

from __future__ import annotations

import heapq
import json
import sqlite3
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks import bench_campaign
from benchmarks.sections import table

WORKERS = (1, 2, 10, 100, 1000)
REPEAT = 29
"""As often as `make study` mutates each clip."""
WORTH = 0.5
"""A number of workers is of use while they are busy for so large a share of the time (ours)."""
STORE = Path("out/store")
"""Where `make campaign` keeps its results."""
_LATEST = Path(__file__).parents[1] / "latest.json"


@dataclass(eq=False)
class Task:
    """What a worker does at once.

    Attributes:
        took_s: by the store. results: rows that the campaign's process stores. order: smaller ones go first.
        then: tasks that are known when its results are stored. kind: of its first step.
    """

    took_s: float
    results: int
    order: tuple[int, int]
    then: list[Task] = field(default_factory=list)
    kind: str = ""


@dataclass(frozen=True)
class Work:
    """A campaign: what it begins with, and what is known when all that follows from these is done."""

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
        found: defaultdict[str, dict[str, float]] = defaultdict(dict)
        for kind, name, took_s in rows.execute("SELECT kind, name, wall_s FROM runs ORDER BY kind, name"):
            found[kind][name] = took_s
    seeds = {n: Task(t + found["forecast"].get(n, 0.0), 2, (0, 0), [], "test case") for n, t in found["seed"].items()}
    clips, children, small = {}, {}, {}
    for name, took_s in found["clip"].items():
        case, _, rank = name.rpartition("_p")
        clips[name] = Task(took_s + found["mutants"].get(name, 0.0), 2, (int(rank), 1), [], "clip")
        seeds[case].then.append(clips[name])
    for name, took_s in found["child"].items():
        clip = name.rpartition("_m")[0]
        clip = clip if clip in clips else clip.rpartition("_s")[0]
        children[name] = Task(took_s, 1, (clips[clip].order[0], 2), [], "child")
        clips[clip].then += [children[name], *(Task(took_s, 1, children[name].order) for _ in range(repeat - 1))]
    for name, took_s in found["minimise"].items():
        small[name] = Task(took_s, 1, (1000, 3), [], "minimising")
    above = {"reference": children, "case_reference": seeds, "minimised_reference": small}
    for kind, by_name in above.items():
        for name, took_s in found[kind].items():
            failure = next(n for n in (name[:k] for k in range(len(name), 0, -1)) if n in by_name)
            by_name[failure].then.append(Task(took_s, 1, (by_name[failure].order[0], 3), [], "reference driver"))
    return Work(tuple(seeds.values()), tuple(small.values()))


@dataclass(frozen=True)
class Own:
    """What the campaign's own process takes for a result, s: when it comes, and at the end, to write it out."""

    comes_s: float
    ends_s: float

    def of(self, work: Work) -> float:
        """Return what it takes for all."""
        return sum(task.results for task in work.tasks()) * (self.comes_s + self.ends_s)


def scheduled_s(work: Work, workers: int, own: Own) -> float:
    """Return how long a campaign takes on so many workers."""
    now_s = _run(work.first, workers, own.comes_s, 0.0)
    now_s = _run(work.last, workers, own.comes_s, now_s)
    return now_s + sum(task.results for task in work.tasks()) * own.ends_s


def _run(first: tuple[Task, ...], workers: int, result_s: float, now_s: float) -> float:
    ready = [(task.order, k, task) for k, task in enumerate(first)]
    heapq.heapify(ready)
    number = len(ready)
    under_way: list[tuple[float, int, Task]] = []  # when it is done
    free = workers
    handled_s = now_s  # until when the campaign's process is busy
    while ready or under_way:
        while ready and free:
            _, k, task = heapq.heappop(ready)
            heapq.heappush(under_way, (now_s + task.took_s, k, task))
            free -= 1
        done_s, _, task = heapq.heappop(under_way)
        free += 1
        handled_s = max(handled_s, done_s) + task.results * result_s
        # A worker that has nothing to do waits for what follows; the others go on meanwhile.
        now_s = done_s if ready else max(done_s, handled_s)
        for new in task.then:
            number += 1
            heapq.heappush(ready, (new.order, number, new))
    return max(now_s, handled_s)


def longest_chain(work: Work) -> list[Task]:
    """Return the tasks that follow from each other and take longest: no number of workers makes that shorter."""

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
    for workers in WORKERS:
        took_s = scheduled_s(work, workers, own)
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
        f"is {limit}.\n"
    )
