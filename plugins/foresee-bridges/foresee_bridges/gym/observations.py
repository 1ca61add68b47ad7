"""The object list of a step as numbers between -1 and 1, for policies that take a vector."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from foresee_bridges.route import AHEAD_M, RouteTracker, in_frame
from foresee_dsl.drivers.protocol import ActorClass, Control, FloatArray, Mission, Observation, SeenActor, VehicleLimits
from foresee_dsl.language.model_classes import CLASSES

RANGE_M = 80.0
"""Distance that is 1 in the vector, m: the range of the ideal sensors."""
SPEED_MPS = 30.0
"""Speed that is 1 in the vector, m/s. Ours: 108 km/h, above the limits of the bundled scenarios' city streets."""
ACCELERATION_MPS2 = 10.0
"""Acceleration that is 1 in the vector, m/s^2: above the hardest braking of a car on dry road."""
YAW_RATE_RAD_S = 1.0
"""Yaw rate that is 1 in the vector, rad/s. Ours: a turn with 8 m radius at 30 km/h."""
LENGTH_M, WIDTH_M = 20.0, 4.0
"""Length and width of an actor that are 1 in the vector, m: above those of the catalogue's longest bus."""
ACTORS = 16
"""Number of actors in the vector, the nearest first. Ours: more are seldom within 30 m."""
ROUTE_POINTS = 12
"""Number of points of the route ahead. Ours: they reach 60 m, the way to stop from 90 km/h."""
ROUTE_STEP_M = 5.0
"""Distance between two points of the route, m. Ours: a right turn of 8 m radius has three."""
KINDS: tuple[ActorClass, ...] = CLASSES
COLOURS = ("red", "amber", "green")
_EGO, _PER_ACTOR = 8 + len(COLOURS), 8 + len(KINDS)


@dataclass(frozen=True)
class ObjectList:
    """Turns the observations of one mission into vectors of `SIZE` numbers, float32, each from -1 to 1.

    In order: the ego's speed, acceleration, yaw rate and wheel angle; the distance to the left of the route, the speed
    limit, the distances to the next stop line and to the goal; whether the signal there is red, amber, green (all 0:
    none in sight). `ROUTE_POINTS` times x and y of a point of the route ahead. `ACTORS` times 1 for an actor, its x, y,
    cosine and sine of its heading, speed, length, width, and 1 at its class of `KINDS`. Positions and headings are
    relative to the ego's centre, x ahead, y to the left. What is missing is 0.
    """

    mission: Mission
    vehicle: VehicleLimits

    SIZE = _EGO + 2 * ROUTE_POINTS + _PER_ACTOR * ACTORS

    @cached_property
    def _tracker(self) -> RouteTracker:
        return RouteTracker(self.mission)

    def place(self, observation: Observation, after_s: float | None = None) -> float:
        """Return the length along the route at which the ego is, m.

        Args:
            observation: the observation at this step.
            after_s: the place at the step before, m, so that a route that crosses itself is followed; None: the start.
        """
        mission = self.mission
        begin = mission.start_s if after_s is None else after_s
        first, last = np.searchsorted(mission.s, (begin - AHEAD_M, begin + AHEAD_M))
        points = mission.centreline[first : last + 1]
        offsets = points - (observation.ego.x, observation.ego.y)
        nearest = first + int(np.argmin(np.einsum("ij,ij->i", offsets, offsets)))
        return float(mission.s[nearest])

    def vector(self, observation: Observation, place_s: float) -> NDArray[np.float32]:
        """Return the vector of an observation, [SIZE] float32, for an ego at this length along the route, m."""
        vector = np.zeros(self.SIZE, dtype=np.float32)
        vector[:_EGO] = self._ego(observation, place_s)
        vector[_EGO : _EGO + 2 * ROUTE_POINTS] = self._route(observation, place_s).ravel()
        ego = observation.ego
        nearest = sorted(
            observation.actors, key=lambda actor: (math.hypot(actor.x - ego.x, actor.y - ego.y), actor.track)
        )
        for k, actor in enumerate(nearest[:ACTORS]):
            at = _EGO + 2 * ROUTE_POINTS + k * _PER_ACTOR
            vector[at : at + _PER_ACTOR] = self._actor(observation, actor)
        return np.clip(vector, -1.0, 1.0, out=vector)

    def _ego(self, observation: Observation, place_s: float) -> list[float]:
        ego, mission = observation.ego, self.mission
        k = min(int(np.searchsorted(mission.s, place_s)), len(mission.s) - 2)
        along = mission.centreline[k + 1] - mission.centreline[k]
        offset = np.array((ego.x, ego.y)) - mission.centreline[k]
        left_m = float(along[0] * offset[1] - along[1] * offset[0]) / max(math.hypot(*along), 1e-9)
        ahead = self._tracker.next_junction(place_s)
        stop_m = min(ahead.stop_s - place_s, RANGE_M) if ahead is not None else RANGE_M
        colour = observation.signals.get(ahead.signal) if ahead is not None and ahead.signal is not None else None
        return [
            ego.speed_mps / SPEED_MPS,
            ego.acceleration_mps2 / ACCELERATION_MPS2,
            ego.yaw_rate_rad_s / YAW_RATE_RAD_S,
            ego.steer_rad / self.vehicle.steer_max_rad,
            left_m / ROUTE_STEP_M,
            float(mission.speed_limit_mps[k]) / SPEED_MPS,
            stop_m / RANGE_M,
            min(mission.goal_s - place_s, RANGE_M) / RANGE_M,
            *(float(colour == name) for name in COLOURS),
        ]

    def _route(self, observation: Observation, place_s: float) -> NDArray[np.float64]:
        """Return x and y of the route's next points relative to the ego, [ROUTE_POINTS, 2]."""
        marks: FloatArray = place_s + ROUTE_STEP_M * np.arange(1, ROUTE_POINTS + 1, dtype=np.float64)
        return _relative(observation, self._tracker.points(marks)) / RANGE_M

    def _actor(self, observation: Observation, actor: SeenActor) -> list[float]:
        x, y = _relative(observation, np.array([(actor.x, actor.y)]))[0] / RANGE_M
        turned = actor.heading_rad - observation.ego.heading_rad
        return [
            1.0, x, y, math.cos(turned), math.sin(turned), actor.speed_mps / SPEED_MPS,
            actor.length_m / LENGTH_M, actor.width_m / WIDTH_M, *(float(actor.kind == kind) for kind in KINDS),
        ]  # fmt: skip


def control_of(action: NDArray[np.floating]) -> Control:
    """Return the control of an action: steer from -1 (right) to 1 (left); pedals from -1 (full brake) to 1 (throttle).

    Raises:
        ValueError: the action does not have two numbers, or one is a NaN.
    """
    numbers = np.asarray(action, dtype=np.float64).ravel()
    if numbers.shape != (2,) or np.isnan(numbers).any():
        raise ValueError(f"an action has two numbers, steer and pedals, each from -1 to 1, not {action!r}")
    steer, pedals = np.clip(numbers, -1.0, 1.0)
    return Control(float(steer), max(float(pedals), 0.0), max(-float(pedals), 0.0))


def _relative(observation: Observation, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points relative to the ego's centre, x ahead and y to the left, [N, 2] m."""
    ego = observation.ego
    return in_frame(points, ego.x, ego.y, ego.heading_rad)
