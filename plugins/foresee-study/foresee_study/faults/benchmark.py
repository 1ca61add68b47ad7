"""Runs the whole benchmark: selects test cases, and runs the searches in several processes."""

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
from foresee_dsl.language.campaign_values import RulesMode
from foresee_dsl.language.document import TestCase
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_study.faults.evidence import Evidence
from foresee_study.faults.measures import detects, weakest
from foresee_study.faults.plug_in_path import add_plug_in, address, healthy
from foresee_study.faults.sampling import library, name
from foresee_study.faults.searching import Approach, Search, searched
from foresee_study.faults.table import Benchmark
from foresee_study.halves import Half

_FIRST = 12
"""Minimum number of test cases that the healthy drivers drive at once. Ours."""
_ATTEMPTS = 5
"""Number of attempts after a process has died. Ours: a library that crashes in one of some thousand runs must not cost
the results of the others."""

T = TypeVar("T")
R = TypeVar("R")
Say = Callable[[str], None]


@dataclass(frozen=True)
class Plan:
    """The settings of the benchmark.

    Attributes:
        faults: names such as `pdm/late_objects`. strengths: in ascending order; approaches are compared at the middle
            strength.
        cases: number of test cases per fault. simulated_s: simulated time of each search. judges: drivers that judge
            the failures at the middle strength.
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
    """Time, as `time.time` returns it, after which no search begins."""

    @property
    def reference(self) -> float:
        """Return the strength at which approaches are compared."""
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
    """The weakest strength at which the fault is detected (infinite if it is not), and the evidence of all searches."""

    fault: str
    approach: str
    threshold: float
    evidences: tuple[Evidence, ...]


def measure(plan: Plan, say: Say, write: Callable[[Benchmark], None]) -> Benchmark:
    """Run the whole benchmark; results of earlier searches are read from the folder.

    `write` is called with the results so far after each fault.
    """
    started = time.monotonic()
    cases = _cases_of(plan, say)
    skipped = [f"the fault {fault}: it has no effect in any test case" for fault in plan.faults if not cases[fault]]
    for line in skipped:
        say(line)
    # All approaches search for a fault before the next fault begins, and the faults are in mixed order: if time runs
    # out, the results so far can be compared.
    faults = sorted((fault for fault in plan.faults if cases[fault]), key=_mixed)
    chains = [_Chain(plan, fault, approach, cases[fault]) for fault in faults for approach in plan.approaches]
    done: dict[str, list[_Searched]] = defaultdict(list)
    late: set[str] = set()
    for number, (chain, search) in enumerate(_spread(plan.jobs, _search, chains), start=1):
        if search is None:
            late.add(chain.fault)
        elif isinstance(search, str):
            skipped.append(f"the fault {chain.fault}: its search by {chain.approach.name} failed: {search}")
            say(skipped[-1])
        else:
            done[chain.fault].append(search)
            strengths = ", ".join(f"{evidence.strength:g}" for evidence in search.evidences)
            say(f"{number}/{len(chains)} {chain.fault} by {chain.approach.name}: found from {search.threshold:g} on "
                f"(tried {strengths}; {time.monotonic() - started:.0f} s)")  # fmt: skip
            if len(done[chain.fault]) == len(plan.approaches):
                write(_benchmark(plan, cases, done, skipped))
    if late:
        skipped.append(f"{len(late)} of {len(faults)} faults, because time ran out: {', '.join(sorted(late))}")
    result = _benchmark(plan, cases, done, skipped)
    write(result)
    return result


def _benchmark(
    plan: Plan,
    cases: Mapping[str, tuple[str, ...]],
    done: Mapping[str, Sequence[_Searched]],
    skipped: Sequence[str],
) -> Benchmark:
    """Return the figures of the faults for which all approaches have searched."""
    order = [approach.name for approach in plan.approaches]
    faults = tuple(fault for fault in plan.faults if len(done.get(fault, ())) == len(order) > 0)
    searches = [
        search for fault in faults for search in sorted(done[fault], key=lambda search: order.index(search.approach))
    ]
    return Benchmark(
        approaches=tuple(order),
        faults=faults,
        strengths=plan.strengths,
        reference=plan.reference,
        simulated_s=plan.simulated_s,
        thresholds={(search.fault, search.approach): search.threshold for search in searches},
        compared=tuple(each for search in searches for each in search.evidences if each.strength == plan.reference),
        skipped=tuple(skipped),
        cases={fault: len(cases[fault]) for fault in faults},
        half=plan.half.value,
        wall_s=sum(each.wall_s for search in searches for each in search.evidences),
    )


def _mixed(fault: str) -> str:
    return hashlib.sha256(fault.encode()).hexdigest()


class _LateError(Exception):
    """Raised when the time has run out."""


def _search(chain: _Chain) -> _Searched | str | None:
    """Search at one strength after the other; return the error in words if the search fails, None if time has
    run out.
    """
    plan, library = chain.plan, _library(chain.plan.half)
    cases = [library[each] for each in chain.cases]
    evidence: dict[float, Evidence] = {}

    def finds(strength: float) -> bool:
        judges = plan.judges if strength == plan.reference else ()
        if time.time() > plan.ends_s:
            raise _LateError
        search = Search(chain.fault, strength, chain.approach, plan.simulated_s, judges)
        evidence[strength] = searched(search, cases, plan.out / "searches")
        return detects(evidence[strength], plan.simulated_s)

    try:
        if plan.bisects:
            threshold = weakest(plan.strengths, finds)
        else:
            threshold = min([strength for strength in plan.strengths if finds(strength)], default=math.inf)
    except _LateError:
        return None
    except Exception as err:  # an exception in one search must not stop the others
        return f"{type(err).__name__}: {err}"
    evidences = tuple(evidence[strength] for strength in sorted(evidence))
    return _Searched(chain.fault, chain.approach.name, threshold, evidences)


def _cases_of(plan: Plan, say: Say) -> dict[str, tuple[str, ...]]:
    """Return, for each fault, test cases that the healthy driver passes and that the fault at full strength changes.

    In other test cases no search can detect the fault. They are taken in the stratified order, up to `plan.cases`.
    """
    drivers = sorted({healthy(fault) for fault in plan.faults})
    names = [name(case) for case in library(plan.half)]
    # Every fault needs the first test cases, so they are driven once in advance; only few of the other test cases are
    # needed.
    first = names[: max(_FIRST, 3 * plan.cases)]
    runs = [(plan.half, each, driver) for driver in drivers for each in first]
    digests = {run[1:]: digest for run, digest in _spread(plan.jobs, _digest, runs)}
    say(f"{len(names)} test cases; of the first {len(first)} passed by " + ", ".join(
        f"{driver}: {sum(bool(digests[each, driver]) for each in first)}" for driver in drivers))  # fmt: skip
    tasks = [
        (plan.half, fault, plan.cases, tuple((each, digests.get((each, healthy(fault)))) for each in names))
        for fault in plan.faults
    ]
    return {task[1]: affected for task, affected in _spread(plan.jobs, _affected, tasks)}


def _digest(run: tuple[Half, str, str]) -> str:
    """Return the digest of a driver's run of a test case; "" if it does not pass."""
    half, case, driver = run
    result = run_test_case(_library(half)[case], driver, 0, rules=RulesMode.OFF)
    return result.trace.digest if result.verdict is Verdict.PASS else ""


def _affected(task: tuple[Half, str, int, tuple[tuple[str, str | None], ...]]) -> tuple[str, ...]:
    """Return the first test cases that a fault at full strength changes.

    The digests in `task` are digests of the healthy driver's runs; None for a run that was not done yet.
    """
    half, fault, most, healthily = task
    affected: list[str] = []
    for case, known_digest in healthily:
        if len(affected) == most:
            break
        digest = _digest((half, case, healthy(fault))) if known_digest is None else known_digest
        if digest and run_test_case(_library(half)[case], address(fault, 1.0), 0).trace.digest != digest:
            affected.append(case)
    return tuple(affected)


@cache
def _library(half: Half) -> Mapping[str, TestCase]:
    return {name(case): case for case in library(half)}


def _begin() -> None:
    """Prepare a worker process."""
    add_plug_in()
    logging.disable(logging.WARNING)


def _spread(jobs: int, work: Callable[[T], R], arguments: Sequence[T]) -> Iterator[tuple[T, R]]:
    """Yield each argument with its result, in the order of completion; if a process dies, new processes do the
    remaining work.

    Raises:
        BrokenProcessPool: processes have died in all attempts.
    """
    left = dict(enumerate(arguments))
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
"""Kinds of fault that are also seeded into `idm`. Ours: two of each sort; `idm` reacts differently from `pdm`, so the
same fault has other consequences."""
