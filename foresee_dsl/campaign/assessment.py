"""Compares drivers on plain test cases (without mutations): runs every case with every driver and sums the figures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby

import numpy as np

from foresee_dsl.campaign.driving import DriverSetup, TimedDriver, longest_s
from foresee_dsl.campaign.execution.runs import broken_run, or_driver_error
from foresee_dsl.campaign.workers.pool import BrokenTask, Task, WorkerPool
from foresee_dsl.compile import placement_mistakes
from foresee_dsl.documents import rounded
from foresee_dsl.drivers.deadlines import DEADLINES, Deadlines
from foresee_dsl.errors import DriverError, InputError
from foresee_dsl.language.campaign_values import RULES_MODE, RulesMode
from foresee_dsl.language.document import TestCase, family_order
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunRecord, Verdict
from foresee_dsl.simulate.trace import ACCELERATION, SPEED, STEP_S, Trace

HARSH_BRAKING_MPS2 = 3.0
"""Braking harder than this is counted, m/s^2: the initial threshold of harsh braking in the naturalistic driving study
UDRIVE (Jansen and Wesseling, Harsh braking by truck drivers, 6th Humanist Conference, 2018).
"""
APART_S = 0.5
"""Two brakings with less time than this between them count as one braking, s. Ours: half a second is a reaction time.
"""


@dataclass(frozen=True)
class DriverRun(RunRecord):
    """One test case driven by one driver.

    Attributes:
        driver: the driver's address. version: the driver's version. way_m: distance driven by the ego. hard_brakings:
            number of hard brakings. step_ms: mean wall time of the driver's decision.
    """

    case: str
    family: str
    driver: str
    version: str = ""
    way_m: float = 0.0
    hard_brakings: int = 0
    step_ms: float = 0.0

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "case": self.case,
            "family": self.family,
            "driver": self.driver,
            "version": self.version,
            "verdict": self.verdict,
            "broken_expectations": self.broken_expectations,
            "infractions": self.infractions,
            "near_misses": self.near,
            "reason": self.reason,
            "duration_s": self.duration_s,
            "way_m": self.way_m,
            "hard_brakings": self.hard_brakings,
            "step_ms": self.step_ms,
            "digest": self.digest,
            "output": self.notes.output,
            "traceback": self.notes.traceback,
            "hang": self.notes.hang,
        }


@dataclass(frozen=True)
class DriverRow:
    """The figures of one driver, for one family or for all; all shares refer to the number of cases."""

    driver: str
    family: str
    cases: int
    verdicts: Counter[Verdict]
    duration_s: float
    way_m: float
    hard_brakings: int
    step_ms: float

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "driver": self.driver,
            "family": self.family,
            "cases": self.cases,
            "verdicts": self.by_verdict,
            "arrived": rounded(self.arrived, 4),
            "failed": rounded(self.failed, 4),
            "mean_mps": rounded(self.mean_mps, 3),
            "hard_brakings_per_km": rounded(self.hard_brakings_per_km, 3),
            "step_ms": rounded(self.step_ms, 3),
        }

    def share(self, *verdicts: Verdict) -> float:
        """Return the share of the cases that ended in one of these verdicts."""
        return sum(self.verdicts[v] for v in verdicts) / self.cases if self.cases else 0.0

    @property
    def by_verdict(self) -> dict[Verdict, int]:
        """Return the number of runs by verdict, in the order of `Verdict`."""
        return {verdict: self.verdicts[verdict] for verdict in Verdict if self.verdicts[verdict]}

    @property
    def arrived(self) -> float:
        """Return the share of the cases that passed, 0 to 1."""
        return self.share(Verdict.PASS)

    @property
    def failed(self) -> float:
        """Return the share of the cases that ended in a collision or off the road (F1 to F5), 0 to 1."""
        return self.share(*(v for v in Verdict if v.is_collision))

    @property
    def mean_mps(self) -> float:
        """Return the mean speed of the ego, including the time in which it stood, m/s."""
        return self.way_m / self.duration_s if self.duration_s else 0.0

    @property
    def hard_brakings_per_km(self) -> float:
        """Return the number of hard brakings per km."""
        return self.hard_brakings / self.way_m * 1000 if self.way_m else 0.0


@dataclass(frozen=True)
class Assessment:
    """All runs with their figures; `step_ms` is measured on the clock, so it differs from run to run."""

    runs: tuple[DriverRun, ...]
    seed: int
    broken: tuple[str, ...] = ()
    """Steps that could not be run. An assessment has none, because a run whose process died counts as a crash among the
    runs."""

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "seed": self.seed,
            "drivers": self.drivers,
            "families": self.families,
            "runs": self.runs,
            "broken": self.broken,
        }

    @property
    def drivers(self) -> tuple[DriverRow, ...]:
        """Return a row of figures for each driver."""
        return rows_of(self.runs)

    @property
    def families(self) -> tuple[DriverRow, ...]:
        """Return a row of figures for each driver and family."""
        return rows_of(self.runs, families=True)


def assess_drivers(
    cases: Sequence[TestCase],
    drivers: Sequence[str],
    *,
    jobs: int,
    seed: int = 0,
    on_run: Callable[[DriverRun], None] = lambda _: None,
    deadlines: Deadlines = DEADLINES,
    rules: RulesMode = RULES_MODE,
    fail_fast: bool = False,
) -> tuple[DriverRun, ...]:
    """Run every case with every driver.

    `on_run` is called with each finished run. The result does not depend on `jobs`, unless `fail_fast` ends it at the
    first run that does not arrive.

    Returns:
        The runs, sorted by driver (in the given order) and case.

    Raises:
        InputError: a test case is impossible on its network; no run was started.
        DriverError: the address of a driver names nothing that can drive.
    """
    if mistakes := placement_mistakes(cases):
        raise InputError(mistakes)
    runs: list[DriverRun] = []
    pairs = [(case, driver) for case in cases for driver in drivers]
    with WorkerPool(jobs) as pool:
        pool.add(
            Task(f"{case.id} with {driver}",
                 partial(or_driver_error, run_one, case.id), DriverSetup(driver, seed, deadlines, rules),
                 deadlines.for_run_s(longest_s(case)), key=str(k))
            for k, (case, driver) in enumerate(pairs)
        )  # fmt: skip
        for task, outcome in pool.results():
            if isinstance(outcome, DriverError):
                raise outcome
            case, driver = pairs[int(task.key)]
            driver_run = (
                broken_run(DriverRun, outcome, case=case.id, family=case.family, driver=driver)
                if isinstance(outcome, BrokenTask)
                else outcome
            )
            runs.append(driver_run)
            on_run(driver_run)
            if fail_fast and not driver_run.passed:
                break
    runs.sort(key=lambda driver_run_: (list(drivers).index(driver_run_.driver), driver_run_.case))
    return tuple(runs)


def run_one(address: str, setup: DriverSetup) -> DriverRun:
    """Run one case with one driver."""
    case = load_test_case(address)
    result, timed = setup.run_in(TimedDriver, case)
    return DriverRun.of(
        result,
        case=case.id,
        family=case.family,
        driver=setup.driver,
        version=timed.version,
        way_m=float(np.nansum(result.trace.states[:, 0, SPEED])) * STEP_S,
        hard_brakings=hard_brakings(result.trace),
        step_ms=sum(timed.step_s) / max(len(timed.step_s), 1) * 1000,
        digest=result.trace.digest,
        near=result.near_misses,
    )


def hard_brakings(trace: Trace) -> int:
    """Return the number of the ego's brakings over 3 m/s^2; two within half a second count as one."""
    frames = np.flatnonzero(trace.states[:, 0, ACCELERATION] < -HARSH_BRAKING_MPS2)
    return 0 if not len(frames) else 1 + int((np.diff(frames) * STEP_S > APART_S + STEP_S / 2).sum())


def rows_of(runs: Iterable[DriverRun], *, families: bool = False) -> tuple[DriverRow, ...]:
    """Return a row for each driver, or for each driver and family, in the order of the runs."""
    rows = []
    for driver, mine in groupby(runs, key=lambda run: run.driver):
        listed = list(mine)
        parts = sorted({run.family for run in listed}, key=family_order) if families else ["all"]
        rows += [_row(driver, f, [run for run in listed if f in ("all", run.family)]) for f in parts]
    return tuple(rows)


def _row(driver: str, family: str, runs: Sequence[DriverRun]) -> DriverRow:
    steps = [run.duration_s for run in runs]
    return DriverRow(
        driver=driver,
        family=family,
        cases=len(runs),
        verdicts=Counter(run.verdict for run in runs),
        duration_s=sum(steps),
        way_m=sum(run.way_m for run in runs),
        hard_brakings=sum(run.hard_brakings for run in runs),
        step_ms=sum(run.step_ms * run.duration_s for run in runs) / sum(steps) if sum(steps) else 0.0,
    )
