"""Sensors for closed-loop driver tests: what a driver gets, late and noisy, without a simulator."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import numpy as np

from foresee_dsl.drivers.protocol import Control, Driver, EgoState, Mission, Observation, SeenActor, VehicleLimits

LATE_FRAMES = 2
PLACE_M, PLACE_SHARE, ANGLE_RAD = 0.1, 0.003, math.radians(0.2)
SPEED_MPS, SPEED_SHARE, SPEED_MOST_MPS, SIZE_SHARE = 0.03, 0.03, 0.2, 0.03
HEADING_RAD, WALKER_HEADING_RAD = math.radians(2.0), math.radians(10.0)
LOST_SHARE, LOST_SHARE_FAR, FAR_M = 0.01, 0.1, 80.0


def blurred(actor: SeenActor, ego: EgoState, rng: np.random.Generator) -> SeenActor | None:
    """An object as the standard sensors measure it, or None where they miss it."""
    n = rng.standard_normal(6).tolist()
    dx, dy = actor.x - ego.x, actor.y - ego.y
    away = math.hypot(dx, dy)
    if rng.random() < LOST_SHARE + (LOST_SHARE_FAR - LOST_SHARE) * (away / FAR_M) ** 2:
        return None
    along, across = n[0] * (PLACE_M + PLACE_SHARE * away), n[1] * ANGLE_RAD * away
    cos, sin = (dx / away, dy / away) if away else (1.0, 0.0)
    return replace(
        actor,
        x=actor.x + along * cos - across * sin,
        y=actor.y + along * sin + across * cos,
        heading_rad=actor.heading_rad + n[2] * (WALKER_HEADING_RAD if actor.kind == "pedestrian" else HEADING_RAD),
        speed_mps=max(actor.speed_mps + n[3] * min(SPEED_MPS + SPEED_SHARE * actor.speed_mps, SPEED_MOST_MPS), 0.0),
        length_m=actor.length_m * (1 + n[4] * SIZE_SHARE),
        width_m=actor.width_m * (1 + n[5] * SIZE_SHARE),
    )


class Sensed:
    """A driver that sees what sensors leave. The noise depends on the object and the time alone."""

    def __init__(self, driver: Driver, seed: int) -> None:
        self._driver, self._seed = driver, seed
        self.name, self.version = driver.name, driver.version

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        self._late: deque[Observation] = deque(maxlen=LATE_FRAMES + 1)
        self._driver.reset(mission, vehicle, seed)

    def step(self, observation: Observation) -> Control:
        return self._driver.step(self.sense(observation))

    def sense(self, observation: Observation) -> Observation:
        """What the driver is told."""
        if not self._late:  # nothing is known of before: everybody came at a constant speed
            self._late.extend(_before(observation, frames) for frames in range(LATE_FRAMES, 0, -1))
        self._late.append(observation)
        measured = self._late[0]
        frame = round(measured.time_s / 0.05) + LATE_FRAMES
        draws = (np.random.default_rng((self._seed, actor.track, frame)) for actor in measured.actors)
        seen = (blurred(a, observation.ego, rng) for a, rng in zip(measured.actors, draws, strict=True))
        return replace(observation, actors=tuple(a for a in seen if a is not None), measured_s=measured.time_s)


def _before(observation: Observation, frames: int) -> Observation:
    way = -frames * 0.05
    actors = tuple(
        replace(
            a,
            x=a.x + way * a.speed_mps * math.cos(a.heading_rad),
            y=a.y + way * a.speed_mps * math.sin(a.heading_rad),
        )
        for a in observation.actors
    )
    return replace(observation, time_s=observation.time_s + way, actors=actors)
