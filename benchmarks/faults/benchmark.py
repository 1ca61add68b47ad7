"""The whole benchmark: which test cases, which searches, in how many processes."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import TypeVar

from benchmarks.faults.approaches import Approach
from benchmarks.faults.evidence import Evidence
from benchmarks.faults.measures import detects, weakest
from benchmarks.faults.plug_in_path import add_plug_in, address, healthy
from benchmarks.faults.sampling import Half, library, name
from benchmarks.faults.searching import Search, searched
from benchmarks.faults.table import Benchmark
from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.results.verdict import Verdict

_ATTEMPTS = 5
"""Ours: how often processes may die. A library that crashes in one of some thousand runs must not cost the others."""

T = TypeVar("T")
R = TypeVar("R")
Say = Callable[[str], None]


@dataclass(frozen=True)
class Plan:
    """What is measured.

    Attributes:
        faults: as `pdm/late_objects`. strengths: ascending; the middle one is where approaches are compared.
        cases: how many test cases of each fault. simulated_s: of each search. judges: drivers that judge the failures
            at that strength.
    """

    faults: tuple[str, ...]
    strengths: tuple[float, ...]
    approaches: tuple[Approach, ...]
    half: Half
    cases: int
    simulated_s: float
    judges: tuple[str, ...]
    jobs: int
    out: Path
    bisects: bool = True
    ends_s: float = math.inf
    """No search begins later than that, as `time.time` has it."""

    @property
    def reference(self) -> float:
        """The strength at which approaches are compared."""
        return self.strengths[len(self.strengths) // 2]


@dataclass(frozen=True)
class _Chain:
    """The searches of one approach for one fault, one strength after the other."""

    plan: Plan
    fault: str
    approach: Approach
    cases: tuple[str, ...]


def measure(plan: Plan, say: Say) -> Benchmark:
    """Measure everything; what was searched before is read from the folder."""
    started, skipped = time.monotonic(), []
    usable = []
    for approach in plan.approaches:
        if approach.missing:
            skipped.append(f"the approach {approach.name}: {approach.missing}")
            say(skipped[-1])
        else:
            usable.append(approach)
    cases = _cases_of(plan, say)
    for fault in plan.faults:
        if not cases[fault]:
            skipped.append(f"the fault {fault}: it changes nothing in any test case")
            say(skipped[-1])
    faults = tuple(fault for fault in plan.faults if cases[fault])
    # A fault with all approaches before the next one: where time runs out, what was measured can be compared.
    chains = [_Chain(plan, fault, approach, cases[fault]) for fault in faults for approach in usable]
    thresholds, compared, core_s = {}, [], 0.0
    late: set[str] = set()
    broken: dict[str, str] = {}
    for number, (chain, found) in enumerate(_spread(plan.jobs, _search, chains), start=1):
        if isinstance(found, str):
            broken[chain.fault] = f"the fault {chain.fault}: its search by {chain.approach.name} broke, {found}"
            say(broken[chain.fault])
            continue
        if found is None:
            late.add(chain.fault)
            continue
        threshold, evidences = found
        thresholds[chain.fault, chain.approach.name] = threshold
        compared += [one for one in evidences if one.strength == plan.reference]
        core_s += sum(one.wall_s for one in evidences)
        tried = ", ".join(f"{one.strength:g}" for one in evidences)
        say(f"{number}/{len(chains)} {chain.fault} by {chain.approach.name}: found from {threshold:g} on "
            f"(tried {tried}; {time.monotonic() - started:.0f} s)")  # fmt: skip
    if late:
        skipped.append(f"{len(late)} of {len(faults)} faults, as time ran out: {', '.join(sorted(late))}")
    skipped += broken.values()
    faults = tuple(fault for fault in faults if fault not in late and fault not in broken)
    compared = [one for one in compared if one.fault in faults]
    order = {approach.name: k for k, approach in enumerate(usable)}
    compared.sort(key=lambda one: (faults.index(one.fault), order[one.approach]))
    return Benchmark(tuple(order), faults, plan.strengths, plan.reference, plan.simulated_s, thresholds,
                     tuple(compared), tuple(skipped), {fault: len(cases[fault]) for fault in faults}, plan.half,
                     core_s)  # fmt: skip


class _LateError(Exception):
    """Time has run out."""


def _search(chain: _Chain) -> tuple[float, tuple[Evidence, ...]] | str | None:
    """Return the weakest strength that is found, and the evidence of the strengths that were tried; in words why there
    is none; None: time has run out."""
    plan, known = chain.plan, _library(chain.plan.half)
    cases = [known[each] for each in chain.cases]
    tried: dict[float, Evidence] = {}

    def finds(strength: float) -> bool:
        judges = plan.judges if strength == plan.reference else ()
        if time.time() > plan.ends_s:
            raise _LateError
        search = Search(chain.fault, strength, chain.approach, plan.simulated_s, judges)
        tried[strength] = searched(search, cases, plan.out / "searches")
        return detects(tried[strength], plan.simulated_s)

    try:
        if plan.bisects:
            threshold = weakest(plan.strengths, finds)
        else:
            threshold = min([strength for strength in plan.strengths if finds(strength)], default=math.inf)
    except _LateError:
        return None
    except Exception as err:  # one search that breaks must not cost the others
        return f"{type(err).__name__}: {err}"
    return threshold, tuple(tried[strength] for strength in sorted(tried))


def _cases_of(plan: Plan, say: Say) -> dict[str, tuple[str, ...]]:
    """Return for each fault test cases that the healthy driver passes and in which its coarsest form changes anything:
    elsewhere nobody can find it. They are taken in the stratified order, as many as asked for."""
    drivers = sorted({healthy(fault) for fault in plan.faults})
    names = [name(case) for case in library(plan.half)]
    runs = [(plan.half, each, driver) for driver in drivers for each in names]
    passed = {run[1:]: digest for run, digest in _spread(plan.jobs, _digest, runs) if digest}
    say(f"{len(names)} test cases; passed by " + ", ".join(
        f"{driver}: {sum(key[1] == driver for key in passed)}" for driver in drivers))  # fmt: skip
    asked = [
        (plan.half, fault, plan.cases,
         tuple((each, passed[each, healthy(fault)]) for each in names if (each, healthy(fault)) in passed))
        for fault in plan.faults
    ]  # fmt: skip
    return {task[1]: found for task, found in _spread(plan.jobs, _affected, asked)}


def _digest(run: tuple[Half, str, str]) -> str:
    """Return what a driver does in a test case, as a hash; "" where it does not pass."""
    half, case, driver = run
    result = run_test_case(_library(half)[case], driver, 0)
    return result.trace.digest if result.verdict is Verdict.PASS else ""


def _affected(task: tuple[Half, str, int, tuple[tuple[str, str], ...]]) -> tuple[str, ...]:
    """Return the first test cases in which the coarsest form of a fault changes anything."""
    half, fault, most, healthily = task
    found: list[str] = []
    for case, digest in healthily:
        if len(found) == most:
            break
        if run_test_case(_library(half)[case], address(fault, 1.0), 0).trace.digest != digest:
            found.append(case)
    return tuple(found)


@cache
def _library(half: Half) -> Mapping[str, TestCase]:
    return {name(case): case for case in library(half)}


def _begin() -> None:
    """Prepare a process."""
    add_plug_in()
    logging.disable(logging.WARNING)


def _spread(jobs: int, work: Callable[[T], R], given: Sequence[T]) -> Iterator[tuple[T, R]]:
    """Yield what each gives, in the order in which they are done; where a process dies, the rest is given to new ones.

    Raises:
        BrokenProcessPool: processes die again and again.
    """
    left = dict(enumerate(given))
    for attempt in range(_ATTEMPTS):
        with ProcessPoolExecutor(min(jobs, max(len(left), 1)), get_context("spawn"), _begin) as pool:
            running: dict[Future[R], int] = {pool.submit(work, each): number for number, each in left.items()}
            try:
                for done in as_completed(running):
                    result = done.result()
                    yield left.pop(running[done]), result
            except BrokenProcessPool:
                if attempt == _ATTEMPTS - 1:
                    raise
        if not left:
            return


def all_kinds(kinds: Iterable[str]) -> tuple[str, ...]:
    """Return every kind seeded into `pdm`, and some into `idm`."""
    return (*(f"pdm/{kind}" for kind in kinds), *(f"idm/{kind}" for kind in IN_IDM))


IN_IDM = (
    "late_objects", "blind_to_walkers", "forgets_hidden", "underrates_speed", "runs_amber", "ignores_priority",
    "weak_brakes_wet", "overspeeds",
)  # fmt: skip
"""Ours: two kinds of each sort; `idm` has other defences than `pdm`, so the same fault has other consequences."""
