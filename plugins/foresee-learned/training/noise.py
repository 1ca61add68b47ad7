"""Disturbances, from which a driver learns to recover: a start beside the lane's middle, and short bursts of wrong
controls."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.drivers.protocol import Control, Observation, VehicleLimits

START_SIDE_M, START_SIDE_MOST_M = 0.4, 0.9
START_TURN_RAD, START_TURN_MOST_RAD = math.radians(4.0), math.radians(12.0)
START_SPEED = (0.4, 1.15)
"""Standard deviation and most; share of the start speed. Ours: the ego stays on the road, mostly in its lane."""
PAUSE_S = 9.0
"""Mean time between two bursts, s."""
BURST_S = (0.3, 1.2)
TURN_RAD = (math.radians(2.0), math.radians(9.0))
"""Angle by which a burst turns the ego, rad. Ours: 9 degrees at 10 m/s give an offset of 1.5 m within a second."""
WHEELS_RAD = 0.35
PEDALS = 0.35
"""Probability that a burst also has wrong pedals."""
SPEED_LEAST_MPS = 1.5


@dataclass(frozen=True)
class _Burst:
    until_s: float
    steer: float
    throttle: float | None
    brake: float


def disturbed_start(bundle: SumoBundle, rng: np.random.Generator) -> SumoBundle:
    """Return a test case whose ego starts a little beside its lane's middle, turned, and at another speed."""
    ego = bundle.scene.ego
    side = float(np.clip(rng.normal(0.0, START_SIDE_M), -START_SIDE_MOST_M, START_SIDE_MOST_M))
    turn = float(np.clip(rng.normal(0.0, START_TURN_RAD), -START_TURN_MOST_RAD, START_TURN_MOST_RAD))
    heading = ego.heading_rad
    moved = replace(
        ego,
        x=ego.x - side * math.sin(heading),
        y=ego.y + side * math.cos(heading),
        heading_rad=math.remainder(heading + turn, math.tau),
        speed_mps=ego.speed_mps * float(rng.uniform(*START_SPEED)),
    )
    return replace(bundle, scene=replace(bundle.scene, actors=(moved, *bundle.scene.actors[1:])))


class Bursts:
    """Bursts of wrong controls at random times; the same generator gives the same bursts."""

    def __init__(self, rng: np.random.Generator, vehicle: VehicleLimits, pause_s: float = PAUSE_S) -> None:
        self._rng, self._vehicle, self._pause_s = rng, vehicle, pause_s
        self._next_s = float(rng.exponential(pause_s)) * 0.5
        self._now: _Burst | None = None
        self.ended_s = -math.inf
        """When the last one ended, or ends."""

    def put_into(self, control: Control, observation: Observation) -> Control:
        """Return a control, disturbed during a burst."""
        time_s, speed = observation.time_s, observation.ego.speed_mps
        if self._now is None and time_s >= self._next_s and speed > SPEED_LEAST_MPS:
            self._now = self._drawn(time_s, speed)
            self.ended_s = self._now.until_s
        now = self._now
        if now is None:
            return control
        if time_s >= now.until_s:
            self._now = None
            self._next_s = time_s + 2.0 + float(self._rng.exponential(self._pause_s))
            return control
        steer = max(-1.0, min(1.0, control.steer + now.steer))
        if now.throttle is None:
            return Control(steer, control.throttle, control.brake)
        return Control(steer, now.throttle, now.brake)

    def _drawn(self, time_s: float, speed_mps: float) -> _Burst:
        rng = self._rng
        lasts = float(rng.uniform(*BURST_S))
        turn = float(rng.uniform(*TURN_RAD)) * (1 if rng.random() < 0.5 else -1)
        wheels = math.atan(turn * self._vehicle.wheelbase_m / (speed_mps * lasts))
        wheels = max(-WHEELS_RAD, min(WHEELS_RAD, wheels))
        throttle, brake = None, 0.0
        if rng.random() < PEDALS:
            gas = rng.random() < 0.5
            throttle, brake = (float(rng.uniform(0.2, 0.6)), 0.0) if gas else (0.0, float(rng.uniform(0.1, 0.4)))
        return _Burst(time_s + lasts, wheels / self._vehicle.steer_max_rad, throttle, brake)
