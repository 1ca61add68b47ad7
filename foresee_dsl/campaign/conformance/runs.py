"""The runs of the conformance suite, with a driver that is wrapped to record its answers. Each public function runs in
a worker process and returns what was measured."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from foresee_dsl.campaign.driving import DriverSetup, TimedDriver, new_driver
from foresee_dsl.campaign.steps.clip import measure_clip
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.derive.clipping.clip import DRIVES_S
from foresee_dsl.drivers.parts import parts_of
from foresee_dsl.drivers.protocol import Control, Driver, Mission, Observation, Trajectory, VehicleLimits
from foresee_dsl.drivers.registry import handover_of
from foresee_dsl.forecast.foresee import ForeseeRanker
from foresee_dsl.language.document import TestCase
from foresee_dsl.simulate.results.verdict import RunRecord, Verdict

_AHEAD_M = 8.0
"""Distance of the point of the route towards which a driver is expected to steer, m. Ours: two car lengths, which a
turn of 8 m radius still bends by more than `_TURN_RAD`."""
_TURN_RAD = math.radians(5.0)
"""Direction of that point, relative to the ego's heading, from which a driver is expected to steer towards it, rad.
Ours: five times the error of the localisation."""
_SETTLED_S = 3.0
"""Time after which the ego is expected in the middle of its lane, s. Ours: the ego starts there."""
LIMITS = {"steer": (-1.0, 1.0), "throttle": (0.0, 1.0), "brake": (0.0, 1.0)}
"""The allowed values of each part of an answer."""
_ROUNDING = 1e-6


@dataclass
class AnswerRecord:
    """What was measured from outside while a driver drove one test case.

    Attributes:
        lowest, highest: smallest and largest value of each part of the answers (`LIMITS`); empty without controls.
        outside: number of answers outside the allowed values, by part.
        turning: number of steps in which the route ahead lies to one side. right_side: those in which the driver steers
            to this side.
        fastest_share: largest quotient of the ego's speed and the limit there.
        offset_m: mean distance of the ego to the left of the route from `_SETTLED_S` on, m.
        moved_m: distance between the ego's first and last position, m.
        parts: parts of the driver that can be replaced by ideal ones, after its reset.
    """

    steps: int = 0
    lowest: dict[str, float] = field(default_factory=dict)
    highest: dict[str, float] = field(default_factory=dict)
    outside: dict[str, int] = field(default_factory=dict)
    turning: int = 0
    right_side: int = 0
    fastest_share: float = 0.0
    offset_m: float = 0.0
    moved_m: float = 0.0
    parts: tuple[str, ...] = ()

    def add(self, answer: Control) -> None:
        """Record the values of an answer."""
        for part, (least, most) in LIMITS.items():
            value = float(getattr(answer, part))
            self.lowest[part] = min(value, self.lowest.get(part, value))
            self.highest[part] = max(value, self.highest.get(part, value))
            if not least - _ROUNDING <= value <= most + _ROUNDING:
                self.outside[part] = self.outside.get(part, 0) + 1


class _ObservedDriver(TimedDriver):
    """Passes every call on to a driver, and records its answers and their times."""

    def __init__(self, driver: Driver) -> None:
        super().__init__(driver)
        self.record = AnswerRecord()

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Begin a new record."""
        self.record, self._mission, self._offsets_m = AnswerRecord(), mission, list[float]()
        super().reset(mission, vehicle, seed)
        self.record.parts = tuple(map(str, parts_of(self._driver)))

    def step(self, observation: Observation) -> Control | Trajectory:
        """Return the driver's answer, after recording it."""
        if not self.record.steps:
            self._first = observation.ego
        answer = super().step(observation)
        self.record.steps += 1
        bearing_rad = self._place(observation)
        if isinstance(answer, Control):
            self.record.add(answer)
            if abs(bearing_rad) > _TURN_RAD and observation.ego.speed_mps > 1.0:
                self.record.turning += 1
                self.record.right_side += answer.steer * bearing_rad > 0
        return answer

    def _place(self, observation: Observation) -> float:
        """Record where the ego is on the route; return the direction of the point ahead, rad, left positive."""
        ego, mission, record = observation.ego, self._mission, self.record
        offsets = mission.centreline - (ego.x, ego.y)
        nearest = int(np.einsum("ij,ij->i", offsets, offsets).argmin())
        limit_mps = float(mission.speed_limit_mps[nearest])
        record.fastest_share = max(record.fastest_share, ego.speed_mps / max(limit_mps, 1.0))
        record.moved_m = math.hypot(ego.x - self._first.x, ego.y - self._first.y)
        if observation.time_s >= _SETTLED_S:
            along = np.subtract(*mission.centreline[[min(nearest + 1, len(mission.s) - 1), max(nearest - 1, 0)]])
            aside = along[1] * offsets[nearest, 0] - along[0] * offsets[nearest, 1]
            self._offsets_m.append(float(aside / max(math.hypot(*along), 1e-9)))
            record.offset_m = sum(self._offsets_m) / len(self._offsets_m)
        ahead = min(int(np.searchsorted(mission.s, mission.s[nearest] + _AHEAD_M)), len(mission.s) - 1)
        dx, dy = offsets[ahead]
        return math.remainder(math.atan2(dy, dx) - ego.heading_rad, math.tau)


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
class ExaminedDriver(DriverSetup):
    """The driver that is examined, and its runs."""

    def case(self, case: TestCase) -> ObservedRun:
        """Run one test case with a new driver."""
        return self._observed(case)

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
        result = self.run(case)
        if not result.passed:
            return Handover(math.nan, why=f"a clip is cut from a run that passes: {result.reason}")
        points = ForeseeRanker().rank(result.trace, seed=self.seed, before_s=CLIP_S, after_s=CLIP_S)
        if not points:
            return Handover(math.nan, why="no actor came near the ego")
        handover_s = handover_of(new_driver(self.driver, self.deadlines), CLIP_S - DRIVES_S)
        file = Path(f"{case.scenario.name}_p1.foresee")
        clip = clip_around(case, result.trace, points[0], file, before_s=CLIP_S, after_s=CLIP_S, handover_s=handover_s)
        deviation = measure_clip(clip, case, result.trace, file, self)[3]
        return Handover(deviation.ego_m, handover_s)

    def with_ideal_part(self, argument: tuple[TestCase, str]) -> ObservedRun:
        """Run a test case with the address of the same driver with an ideal part."""
        case, address = argument
        result = replace(self, driver=address).run(case)
        return ObservedRun.of(result, digest=result.trace.digest)

    def _observed(self, case: TestCase, make: Callable[[], Driver] | None = None) -> ObservedRun:
        result, driver = self.run_in(_ObservedDriver, case, make)
        return ObservedRun.of(
            result,
            digest=result.trace.digest,
            version=driver.version,
            record=driver.record,
            reset_ms=driver.reset_s * 1e3,
            step_ms=tuple(s * 1e3 for s in driver.step_s),
        )
