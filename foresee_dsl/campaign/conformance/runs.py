"""The runs of the conformance suite. Each function here runs in a worker process and returns what was measured."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from foresee_dsl.campaign.conformance.observed_driver import AnswerRecord, ObservedDriver
from foresee_dsl.campaign.driving import driven, new_driver, run_test_case
from foresee_dsl.campaign.steps.clip import measure_clip
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.derive.clipping.clip import DRIVES_S
from foresee_dsl.drivers.deadlines import Deadlines
from foresee_dsl.drivers.protocol import Driver
from foresee_dsl.drivers.registry import handover_of
from foresee_dsl.forecast.foresee import ForeseeRanker
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.results.run_record import RunRecord
from foresee_dsl.simulate.results.verdict import Verdict

CLIP_S = 4.0
"""Length of the clip before and after its risky point, s. Ours: as in the first project of `foresee init`."""


@dataclass(frozen=True)
class ObservedRun(RunRecord):
    """One run of a test case.

    Attributes:
        reset_ms, step_ms: wall time of the driver's reset and of each of its steps, ms.
    """

    version: str = ""
    record: AnswerRecord = field(default_factory=AnswerRecord)
    reset_ms: float = 0.0
    step_ms: tuple[float, ...] = ()

    @property
    def ended_by_driver(self) -> bool:
        """Return whether the driver broke or hung, so that the run says nothing about its driving."""
        return self.verdict is Verdict.CRASH or self.hangs or not self.digest


@dataclass(frozen=True)
class OneProcess:
    """Runs of one process, in this order: a test case twice, another test case, and the first one again.

    Attributes:
        after: with a new driver. reused: with the driver object that drove the other test case; None for a driver with
            a method `close`, which may be used only once.
    """

    first: ObservedRun
    second: ObservedRun
    other: ObservedRun
    after: ObservedRun
    reused: ObservedRun | None


@dataclass(frozen=True)
class Handover:
    """A clip of a run that passed, driven without mutation.

    Attributes:
        ego_m: largest distance between the ego's places in the two runs, m; NaN without a clip. why: why there is none.
    """

    ego_m: float
    handover_s: float = 0.0
    why: str = ""


@dataclass(frozen=True)
class Drive:
    """The driver that is examined, and how its runs are made."""

    driver: str
    seed: int
    deadlines: Deadlines

    def case(self, case: TestCase) -> ObservedRun:
        """Run one test case with a new driver."""
        return self._observed(case, partial(new_driver, self.driver, self.deadlines))

    def in_one_process(self, cases: tuple[TestCase, TestCase]) -> OneProcess:
        """Run two test cases in turn in this process."""
        case, another = cases
        first, second = self.case(case), self.case(case)
        driver = new_driver(self.driver, self.deadlines)
        other = self._observed(another, lambda: driver)
        after = self.case(case)
        # A driver with `close` has a resource; the protocol closes it once, and the next run gets a new driver.
        reused = None if callable(getattr(driver, "close", None)) else self._observed(case, lambda: driver)
        return OneProcess(first, second, other, after, reused)

    def handover(self, case: TestCase) -> Handover:
        """Cut a clip out of a run and drive it."""
        result = run_test_case(case, self.driver, self.seed, deadlines=self.deadlines)
        if not result.passed:
            return Handover(math.nan, why=f"a clip is cut from a run that passes: {result.reason}")
        points = ForeseeRanker().rank(result.trace, seed=self.seed, before_s=CLIP_S, after_s=CLIP_S)
        if not points:
            return Handover(math.nan, why="no actor came near the ego")
        handover_s = handover_of(new_driver(self.driver, self.deadlines), CLIP_S - DRIVES_S)
        file = Path(f"{case.scenario.name}_p1.foresee")
        clip = clip_around(case, result.trace, points[0], file, before_s=CLIP_S, after_s=CLIP_S, handover_s=handover_s)
        deviation = measure_clip(
            clip, case, result.trace, file, driver=self.driver, seed=self.seed, deadlines=self.deadlines
        )[3]
        return Handover(deviation.ego_m, handover_s)

    def with_ideal_part(self, argument: tuple[TestCase, str]) -> ObservedRun:
        """Run a test case with the address of the same driver with an ideal part."""
        case, address = argument
        result = run_test_case(case, address, self.seed, deadlines=self.deadlines)
        return ObservedRun.of(result, digest=result.trace.digest)

    def _observed(self, case: TestCase, make: Callable[[], Driver]) -> ObservedRun:
        drivers = list[ObservedDriver]()

        def observed() -> Driver:
            drivers.append(ObservedDriver(make()))
            return drivers[-1]

        result = driven(case, observed, self.driver, self.seed, meta={"driver": self.driver}, deadlines=self.deadlines)
        driver = drivers[-1]  # if a run was repeated for a check, the last run counts
        return ObservedRun.of(
            result,
            digest=result.trace.digest,
            version=driver.version,
            record=driver.record,
            reset_ms=driver.reset_s * 1e3,
            step_ms=tuple(s * 1e3 for s in driver.step_s),
        )
