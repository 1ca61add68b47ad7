"""Compiles and simulates test cases with a driver; also times the driver, names a test case's files and bounds its
simulated time."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from foresee_dsl import __version__
from foresee_dsl.campaign.workers.processes import end_below_this
from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.deadlines import DEADLINES, Deadlines
from foresee_dsl.drivers.external.process import kept_programs
from foresee_dsl.drivers.kept import forget, nothing_kept, one_run
from foresee_dsl.drivers.parts import DriverPart, ideal_parts
from foresee_dsl.drivers.process_state import put_back, seed_globals
from foresee_dsl.drivers.protocol import (
    Closing,
    Control,
    Driver,
    Mission,
    Observation,
    OwnDeadline,
    Trajectory,
    VehicleLimits,
)
from foresee_dsl.drivers.registry import find_driver, load_driver, recorded_address, sees_all
from foresee_dsl.errors import DriverError
from foresee_dsl.language.campaign_values import RULES_MODE, RulesMode
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import End, Quantity
from foresee_dsl.language.model.scenario import DEFAULT_END_S
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.printed import printed_here
from foresee_dsl.simulate.results.verdict import DriverNotes, RunResult, Verdict
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.sensing.settings import IDEAL, STANDARD, SensorSettings
from foresee_dsl.simulate.trace import Trace

REMEMBERS = "keeps data from one run to the next that changes its behaviour"
"""What reports say about a driver if its run, repeated without the values that the driver had kept, ends differently.
The result of the repeated run counts.
"""


Wrapper = TypeVar("Wrapper", bound=Driver)


@dataclass(frozen=True)
class DriverSetup:
    """A driver, and how it drives test cases.

    Attributes:
        driver: its address, which determines its sensors. seed: seed of all random choices of a run.
        deadlines: limits of wall time; None: no limits. rules: what a broken traffic rule means.
        ends_early: a run ends as soon as it can only pass.
    """

    driver: str
    seed: int = 0
    deadlines: Deadlines | None = DEADLINES
    rules: RulesMode = RULES_MODE
    ends_early: bool = False

    def run(self, case: TestCase, make: Callable[[], Driver] | None = None) -> RunResult:
        """Compile a test case and simulate it with a new driver, or with the one that `make` returns.

        The driver's changes to the process are undone.
        """
        bundle, ideal = compile_test_case(case), ideal_parts(self.driver)
        meta = {
            "test_case": case.id,
            "meaning": case.meaning,
            "tool": __version__,
            "seed": self.seed,
            "driver": self.driver,
        }

        def with_parts(parts: frozenset[DriverPart], futures: Trace | None = None) -> RunResult:
            driver_made = make() if make is not None else new_driver(self.driver, self.deadlines)
            # A driver's package may draw random numbers when it is imported, which happens only in the first run of a
            # process.
            seed_globals(self.seed)
            return run(bundle, driver_made, seed=self.seed, meta=meta, sensors=sensors_of(self.driver),
                       deadlines=self.deadlines, rules=self.rules, goal=case.goal,
                       ends_early=self.ends_early, ideal=parts, futures=futures)  # fmt: skip

        def once() -> RunResult:
            if DriverPart.PREDICTION not in ideal:
                return with_parts(ideal)
            # The ideal prediction is read from a run. Because the other actors react to the ego, it is made twice:
            # first from the run without the ideal prediction, then from the run with it.
            first = with_parts(ideal - {DriverPart.PREDICTION})
            second = with_parts(ideal, first.trace)
            return with_parts(ideal, second.trace) if second.verdict.is_failure else second

        with put_back(self.seed) as changed:
            try:
                began_s, most_s = time.monotonic(), (self.deadlines or DEADLINES).for_run_s(longest_s(case))
                with one_run() as to_be_checked:
                    result = once()
                # A run that took half of its deadline leaves no time for a second one; a later run is checked instead.
                if time.monotonic() - began_s < most_s / 2 and to_be_checked():
                    with nothing_kept():
                        again = once()
                    if not _same(result, again):
                        forget()
                        result = again
                        changed.append(REMEMBERS)
            finally:
                changed.extend(_left_behind())
        return replace(result, notes=replace(result.notes, changed=tuple(changed))) if changed else result

    def run_in(
        self, wrapper: Callable[[Driver], Wrapper], case: TestCase, make: Callable[[], Driver] | None = None
    ) -> tuple[RunResult, Wrapper]:
        """Run a test case with a driver in a wrapper; return the run, and the wrapper of its driver.

        If the run is repeated for a check, the last run counts.
        """
        wrappers: list[Wrapper] = []

        def wrapped() -> Wrapper:
            wrappers.append(wrapper(make() if make is not None else new_driver(self.driver, self.deadlines)))
            return wrappers[-1]

        result = self.run(case, wrapped)
        return result, wrappers[-1]


def run_test_case(
    case: TestCase,
    driver: str,
    seed: int,
    *,
    deadlines: Deadlines | None = DEADLINES,
    rules: RulesMode = RULES_MODE,
) -> RunResult:
    """Compile a test case and simulate it with a fresh driver; see `DriverSetup`."""
    return DriverSetup(driver, seed, deadlines, rules).run(case)


def _same(first: RunResult, other: RunResult) -> bool:
    """Return whether two runs are equal; runs that hung count as equal, because wall time ended them."""
    hung = first.notes.hang is not None or other.notes.hang is not None
    return hung or (first.verdict, first.trace.digest) == (other.verdict, other.trace.digest)


def _left_behind() -> list[str]:
    """End the processes that a driver has left behind.

    Only in a worker, where all child processes belong to drivers.
    """
    left = printed_here() is not None and end_below_this(kept_programs())
    return ["left processes behind"] if left else []


def sensors_of(driver: str) -> SensorSettings:
    """Return the sensors of a driver's address: `pdm+ideal` has ideal ones."""
    return IDEAL if sees_all(driver) else STANDARD


@Part.START.measured
def new_driver(driver: str, deadlines: Deadlines | None = DEADLINES) -> Driver:
    """Return a new driver; if creating it raises an error, return one whose `reset` raises this error.

    Raises:
        DriverError: there is no driver of this name.
    """
    find_driver(driver)
    try:
        loaded = load_driver(driver)
    except DriverError as err:
        if err.__cause__ is None:
            raise
        return _NotMade(driver, err.__cause__)
    if deadlines is not None and deadlines.step_s is not None and isinstance(loaded, OwnDeadline):
        loaded.step_deadline_s = deadlines.step_s
    return loaded


class _NotMade:
    """Stands in for a driver that could not be created: its `reset` raises the error."""

    def __init__(self, name: str, why: BaseException) -> None:
        self.name, self.version, self._why = name, "", why

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:  # noqa: ARG002 - the protocol's
        raise self._why

    def step(self, observation: Observation) -> Control:
        raise NotImplementedError


def notes_of(result: RunResult) -> DriverNotes:
    """Return the driver's notes on a run that are stored; for a run that passed, only its changes to the process."""
    return result.notes if result.verdict is not Verdict.PASS else DriverNotes(changed=result.notes.changed)


def recorded_setup(case: TestCase | None) -> DriverSetup:
    """Return the driver and seed that the file of a mutant records; by default `pdm` and 0."""
    origin = case.mutant.origin if case is not None and case.mutant is not None else None
    driver = recorded_address((origin.driver if origin else None) or "pdm")
    return DriverSetup(driver, int(origin.seed.value) if origin and origin.seed else 0)


def case_name(case: TestCase) -> str:
    """Return the beginning of the names of a test case's files: `red_light_runner_r02`."""
    if case.mutant is not None:
        return case.mutant.name
    if case.clip is not None:
        return case.clip.name
    return case_file_name(case.id, case.scenario.name)


def case_file_name(address: str, scenario: str) -> str:
    """Return the beginning of the names of the files of a scenario's case, from its address."""
    case = address.partition("::")[2]
    return f"{scenario}_{case}" if case else scenario


def longest_s(case: TestCase) -> float:
    """Return the longest simulated time of a test case, s."""
    end = case.scenario.first(End)
    return float(end.after.si) if end is not None and isinstance(end.after, Quantity) else DEFAULT_END_S


def relative_path(target: Path, folder: Path) -> str:
    """Return the path of `target` from `folder`, relative and with forward slashes."""
    return Path(os.path.relpath(target.resolve(), folder.resolve())).as_posix()


class TimedDriver:
    """Passes every call on to a driver and measures how long its answers take.

    Attributes:
        reset_s: wall time of the last reset, s. step_s: wall time of each step since the last reset, s.
    """

    def __init__(self, driver: Driver) -> None:
        self._driver = driver
        self.name, self.version = driver.name, driver.version
        self.reset_s, self.step_s = 0.0, list[float]()

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Reset the driver, whose name and version may change with that."""
        self.step_s.clear()
        started = time.perf_counter()
        self._driver.reset(mission, vehicle, seed)
        self.reset_s = time.perf_counter() - started
        self.name, self.version = self._driver.name, self._driver.version

    def step(self, observation: Observation) -> Control | Trajectory:
        """Return the driver's answer."""
        # Sensors are evaluated when the driver reads them, which must not count as the driver's time.
        _ = (observation.actors, observation.signals, observation.ego)
        started = time.perf_counter()
        try:
            return self._driver.step(observation)
        finally:
            self.step_s.append(time.perf_counter() - started)

    def close(self) -> None:
        """Close the driver, if it has a method `close`."""
        if isinstance(self._driver, Closing):
            self._driver.close()
