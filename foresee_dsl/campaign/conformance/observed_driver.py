"""A driver that is wrapped to record its answers, and how they fit the route."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from foresee_dsl.campaign.timed_driver import TimedDriver
from foresee_dsl.drivers.parts import parts_of
from foresee_dsl.drivers.protocol import Control, Driver, Mission, Observation, Trajectory, VehicleLimits

AHEAD_M = 8.0
"""Distance of the point of the route towards which a driver is expected to steer, m. Ours: two car lengths, which a
turn of 8 m radius still bends by more than `TURN_RAD`."""
TURN_RAD = math.radians(5.0)
"""Direction of that point, relative to the ego's heading, from which a driver is expected to steer towards it, rad.
Ours: five times the error of the localisation."""
SETTLED_S = 3.0
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
        offset_m: mean distance of the ego to the left of the route from `SETTLED_S` on, m.
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


class ObservedDriver(TimedDriver):
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
            if abs(bearing_rad) > TURN_RAD and observation.ego.speed_mps > 1.0:
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
        if observation.time_s >= SETTLED_S:
            along = np.subtract(*mission.centreline[[min(nearest + 1, len(mission.s) - 1), max(nearest - 1, 0)]])
            aside = along[1] * offsets[nearest, 0] - along[0] * offsets[nearest, 1]
            self._offsets_m.append(float(aside / max(math.hypot(*along), 1e-9)))
            record.offset_m = sum(self._offsets_m) / len(self._offsets_m)
        ahead = min(int(np.searchsorted(mission.s, mission.s[nearest] + AHEAD_M)), len(mission.s) - 1)
        dx, dy = offsets[ahead]
        return math.remainder(math.atan2(dy, dx) - ego.heading_rad, math.tau)
