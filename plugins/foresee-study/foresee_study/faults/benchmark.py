"""The whole benchmark: which test cases, which searches, in how many processes."""

from __future__ import annotations

import hashlib
import logging
import math
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import TypeVar

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_study.faults.approaches import Approach
from foresee_study.faults.evidence import Evidence
from foresee_study.faults.measures import detects, weakest
from foresee_study.faults.plug_in_path import add_plug_in, address, healthy
from foresee_study.faults.sampling import library, name
from foresee_study.faults.searching import Search, searched
from foresee_study.faults.table import Benchmark
from foresee_study.halves import Half

_FIRST = 12
"""Ours: so many test cases are driven by the healthy drivers at once, at least."""
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


@dataclass(frozen=True)
class _Searched:
    """The weakest strength that is found, infinite: none, and the evidence of all that were tried."""

    fault: str
    approach: str
    threshold: float
    evidences: tuple[Evidence, ...]


def measure(plan: Plan, say: Say, write: Callable[[Benchmark], None]) -> Benchmark:
    """Measure everything; what was searched before is read from the folder. `write` gets the tables of the faults that
    are done, after each of them."""
    started = time.monotonic()
    usable = tuple(approach for approach in plan.approaches if not approach.missing)
    skipped = [f"the approach {one.name}: {one.missing}" for one in plan.approaches if one.missing]
    cases = _cases_of(plan, say)
    skipped += [f"the fault {fault}: it changes nothing in any test case" for fault in plan.faults if not cases[fault]]
    for line in skipped:
        say(line)
    # A fault with all approaches before the next one, and unlike ones first: where time runs out, what was measured can
    # be compared.
    faults = sorted((fault for fault in plan.faults if cases[fault]), key=_mixed)
    chains = [_Chain(plan, fault, approach, cases[fault]) for fault in faults for approach in usable]
    done: dict[str, list[_Searched]] = defaultdict(list)
    late: set[str] = set()
    for number, (chain, found) in enumerate(_spread(plan.jobs, _search, chains), start=1):
        if found is None:
            late.add(chain.fault)
        elif isinstance(found, str):
            skipped.append(f"the fault {chain.fault}: its search by {chain.approach.name} broke, {found}")
            say(skipped[-1])
        else:
            done[chain.fault].append(found)
            tried = ", ".join(f"{one.strength:g}" for one in found.evidences)
            say(f"{number}/{len(chains)} {chain.fault} by {chain.approach.name}: found from {found.threshold:g} on "
                f"(tried {tried}; {time.monotonic() - started:.0f} s)")  # fmt: skip
            if len(done[chain.fault]) == len(usable):
                write(_benchmark(plan, usable, cases, done, skipped))
    if late:
        skipped.append(f"{len(late)} of {len(faults)} faults, as time ran out: {', '.join(sorted(late))}")
    result = _benchmark(plan, usable, cases, done, skipped)
    write(result)
    return result


def _benchmark(
    plan: Plan,
    usable: Sequence[Approach],
    cases: Mapping[str, tuple[str, ...]],
    done: Mapping[str, Sequence[_Searched]],
    skipped: Sequence[str],
) -> Benchmark:
    """Return the figures of the faults in which all approaches have searched."""
    order = [approach.name for approach in usable]
    faults = tuple(fault for fault in plan.faults if len(done.get(fault, ())) == len(order) > 0)
    found = [one for fault in faults for one in sorted(done[fault], key=lambda one: order.index(one.approach))]
    return Benchmark(
        approaches=tuple(order),
        faults=faults,
        strengths=plan.strengths,
        reference=plan.reference,
        simulated_s=plan.simulated_s,
        thresholds={(one.fault, one.approach): one.threshold for one in found},
        compared=tuple(each for one in found for each in one.evidences if each.strength == plan.reference),
        skipped=tuple(skipped),
        cases={fault: len(cases[fault]) for fault in faults},
        half=plan.half.value,
        wall_s=sum(each.wall_s for one in found for each in one.evidences),
    )


def _mixed(fault: str) -> str:
    return hashlib.sha256(fault.encode()).hexdigest()


class _LateError(Exception):
    """Time has run out."""


def _search(chain: _Chain) -> _Searched | str | None:
    """Search at one strength after the other; return in words why that broke, None where time has run out."""
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
    evidences = tuple(tried[strength] for strength in sorted(tried))
    return _Searched(chain.fault, chain.approach.name, threshold, evidences)


def _cases_of(plan: Plan, say: Say) -> dict[str, tuple[str, ...]]:
    """Return for each fault test cases that the healthy driver passes and in which its coarsest form changes anything:
    elsewhere nobody can find it. They are taken in the stratified order, as many as asked for."""
    drivers = sorted({healthy(fault) for fault in plan.faults})
    names = [name(case) for case in library(plan.half)]
    # The first ones are looked at by every fault, so that they are driven once; of the others few are needed.
    first = names[: max(_FIRST, 3 * plan.cases)]
    runs = [(plan.half, each, driver) for driver in drivers for each in first]
    known = {run[1:]: digest for run, digest in _spread(plan.jobs, _digest, runs)}
    say(f"{len(names)} test cases; of the first {len(first)} passed by " + ", ".join(
        f"{driver}: {sum(bool(known[each, driver]) for each in first)}" for driver in drivers))  # fmt: skip
    asked = [
        (plan.half, fault, plan.cases, tuple((each, known.get((each, healthy(fault)))) for each in names))
        for fault in plan.faults
    ]
    return {task[1]: found for task, found in _spread(plan.jobs, _affected, asked)}


def _digest(run: tuple[Half, str, str]) -> str:
    """Return what a driver does in a test case, as a hash; "" where it does not pass."""
    half, case, driver = run
    result = run_test_case(_library(half)[case], driver, 0)
    return result.trace.digest if result.verdict is Verdict.PASS else ""


def _affected(task: tuple[Half, str, int, tuple[tuple[str, str | None], ...]]) -> tuple[str, ...]:
    """Return the first test cases in which the coarsest form of a fault changes anything; the given digests are those
    of the healthy driver, None: not known yet."""
    half, fault, most, healthily = task
    found: list[str] = []
    for case, known in healthily:
        if len(found) == most:
            break
        digest = _digest((half, case, healthy(fault))) if known is None else known
        if digest and run_test_case(_library(half)[case], address(fault, 1.0), 0).trace.digest != digest:
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
