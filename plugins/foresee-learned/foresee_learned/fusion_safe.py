"""The driver `fusion_safe`: a network's waypoints, objects and stop line, and a safety controller (the role of
InterFuser)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers.protocol import (
    EgoState,
    FloatArray,
    JunctionPassage,
    Mission,
    Observation,
    Reason,
    VehicleLimits,
)
from foresee_learned import settings as cfg
from foresee_learned.decisions import Decision, Decisions
from foresee_learned.free_way import Basis, FreeWay, free_way, rules_of
from foresee_learned.inputs import LearnedInputs
from foresee_learned.outputs import FUSION_SAFE_TIMES_S, SIGNALS, Occupied, road_users
from foresee_learned.session import Answer, Network

_STOPS = SIGNALS.index("red"), SIGNALS.index("amber")


class FusionSafeState(Decisions):
    """The driver's memory since `reset`."""

    def __init__(self, network: Network, mission: Mission, vehicle: VehicleLimits) -> None:
        super().__init__(network, mission, vehicle)
        self._objects = Objects()
        self._rules, self._close = rules_of(vehicle), rules_of(vehicle, cfg.CLOSE_SIDE_M, cfg.CLOSE_SMALL_MARGIN_M)
        self._bounds = Speeds(cfg.DECISION_S, cfg.MOST_MPS, vehicle.acceleration_mps2, cfg.BRAKING_MPS2)
        self._basis: Basis | None = None
        self._creeping = Creeping()

    def decide(self, observation: Observation, answer: Answer) -> Decision:
        """Return the decision to drive at the speed of the waypoints, but not faster than is safe."""
        now_mps, waypoints = observation.ego.speed_mps, answer["waypoints"].astype(np.float64)
        planned_mps, stop = planned_speed(waypoints), self._stop(answer)
        creeps = self._creeping.begins_or_goes_on(observation.time_s, now_mps, held=stop is not None)
        if creeps and planned_mps < cfg.CREEPS_MPS:
            waypoints = along_the_route(self.mission, self.maker.place_s, observation.ego, FUSION_SAFE_TIMES_S)
            planned_mps = cfg.CREEPS_MPS
        seen = list(road_users(answer["density"][None], cfg.LEAST_OCCUPIED))
        others = self._objects.update(seen, observation.ego, observation.time_s)
        safe_mps, way = self._safe(waypoints, others, now_mps, math.inf if stop is None else stop[1])
        self._basis = Basis(planned_mps, safe_mps, way, stop)
        if safe_mps is None:
            return Decision(waypoints, 0.0, cfg.DECISION_S, hardest=True)
        if (safe_mps - now_mps) / cfg.DECISION_S < (planned_mps - now_mps) / cfg.PLANNED_S:
            return Decision(waypoints, safe_mps, cfg.DECISION_S)
        return Decision(waypoints, planned_mps, cfg.PLANNED_S)

    def reasons(self, observation: Observation, inputs: LearnedInputs, decision: Decision) -> Sequence[Reason]:  # noqa: ARG002
        """Return as reasons the waypoints, the object that limits the speed, and the stop line."""
        from foresee_learned.reasons import reasons_of_basis

        return () if self._basis is None else reasons_of_basis(observation, self._basis, self.vehicle)

    def _safe(
        self, waypoints: FloatArray, others: Sequence[Occupied], now_mps: float, room_m: float
    ) -> tuple[float | None, FreeWay]:
        """Return the highest safe speed and its free way.

        It is computed with the usual lateral clearance, and with a smaller clearance beside standing objects if that
        allows a higher speed up to creeping speed. `room_m`: distance to the stop line that applies.
        """
        way = free_way(waypoints, others, self._rules)
        safe_mps = fastest_safe_speed(now_mps, np.minimum(way.free_m, room_m), self._bounds)
        if way.first is None or (safe_mps or 0.0) >= cfg.CREEPS_MPS:
            return safe_mps, way
        beside = free_way(waypoints, [item for item in others if item.speed_mps < cfg.SPEED_ERROR_MPS], self._close)
        moving = free_way(waypoints, [item for item in others if item.speed_mps >= cfg.SPEED_ERROR_MPS], self._rules)
        free_m = np.minimum(np.minimum(beside.free_m, moving.free_m), room_m)
        slow_mps = fastest_safe_speed(now_mps, free_m, self._bounds._replace(most_mps=cfg.CREEPS_MPS))
        if slow_mps is None or (safe_mps is not None and slow_mps <= safe_mps):
            return safe_mps, way
        return slow_mps, min(beside, moving, key=lambda item: item.first_m)

    def _stop(self, answer: Answer) -> tuple[JunctionPassage, float] | None:
        """Return the route's next stop line and the distance of the front to it, m; None if, by the network's answer,
        it does not apply.
        """
        if answer["stop_line"].item(0) < cfg.STOP_PROBABILITY:
            return None
        if float(sum(answer["signal"][k] for k in _STOPS)) < cfg.STOP_PROBABILITY:
            return None
        front_s = self.maker.place_s + self.vehicle.length_m / 2
        for passage in self.mission.junctions:
            room_m = passage.stop_s - cfg.STOP_MARGIN_M - front_s
            if room_m > -cfg.STOP_PASSED_M:
                return passage, max(room_m, 0.0)
        return None


def planned_speed(waypoints: FloatArray) -> float:
    """Return the speed, m/s, of waypoints at the times `FUSION_SAFE_TIMES_S`."""
    first, last = cfg.PLANNED_BETWEEN
    steps = waypoints[first + 1 : last + 1] - waypoints[first:last]
    return float(np.hypot(steps[:, 0], steps[:, 1]).sum()) / (FUSION_SAFE_TIMES_S[last] - FUSION_SAFE_TIMES_S[first])


# ---- objects, remembered for a moment --------------------------------------------------------------------------------


class _Remembered(NamedTuple):
    """An object at the place where it was last seen: x, y (m) and heading (rad) in the world, and the time."""

    x: float
    y: float
    heading_rad: float
    time_s: float
    was: Occupied


class Objects:
    """The road users of the density map, with a short memory, because the network sometimes misses an object for a
    frame. Such an object is added at the place to which its speed has moved it.
    """

    def __init__(self) -> None:
        self._remembered: list[_Remembered] = []

    def update(self, seen: Sequence[Occupied], ego: EgoState, time_s: float) -> list[Occupied]:
        """Return the objects that are seen now, with plausible sizes, and those that were seen shortly before."""
        sized = [_with_a_size(occupied) for occupied in seen]
        kept: list[_Remembered] = []
        remembered: list[Occupied] = []
        for earlier in self._remembered:
            if time_s - earlier.time_s > cfg.OBJECT_KEPT_S:
                continue
            again = _moved(earlier, ego, time_s)
            if not any(_apart_m(occupied, again) < cfg.SAME_OBJECT_M for occupied in sized):
                kept.append(earlier)
                remembered.append(again)
        self._remembered = kept + [
            _in_world(occupied, ego, time_s) for occupied in sized if occupied.probability >= cfg.SURE
        ]
        return sized + remembered


def _with_a_size(occupied: Occupied) -> Occupied:
    if min(occupied.length_m, occupied.width_m) >= cfg.LEAST_M:
        return occupied
    return replace(occupied, length_m=max(occupied.length_m, cfg.LEAST_M), width_m=max(occupied.width_m, cfg.LEAST_M))


def _in_world(occupied: Occupied, ego: EgoState, time_s: float) -> _Remembered:
    cos, sin = math.cos(ego.heading_rad), math.sin(ego.heading_rad)
    x, y = (
        ego.x + cos * occupied.ahead_m - sin * occupied.left_m,
        ego.y + sin * occupied.ahead_m + cos * occupied.left_m,
    )
    return _Remembered(x, y, occupied.heading_rad + ego.heading_rad, time_s, occupied)


def _apart_m(occupied: Occupied, other: Occupied) -> float:
    return math.hypot(occupied.ahead_m - other.ahead_m, occupied.left_m - other.left_m)


def _moved(remembered: _Remembered, ego: EgoState, time_s: float) -> Occupied:
    """Return an object in the ego's present frame, moved by its speed since it was seen."""
    way = remembered.was.speed_mps * (time_s - remembered.time_s)
    dx = remembered.x + way * math.cos(remembered.heading_rad) - ego.x
    dy = remembered.y + way * math.sin(remembered.heading_rad) - ego.y
    cos, sin = math.cos(ego.heading_rad), math.sin(ego.heading_rad)
    return replace(
        remembered.was,
        ahead_m=dx * cos + dy * sin,
        left_m=dy * cos - dx * sin,
        heading_rad=remembered.heading_rad - ego.heading_rad,
    )


# ---- driving on after a long stand
# ------------------------------------------------------------------------------------


class Creeping:
    """Decides when the ego creeps.

    It stores the time from which the ego has stood, and the time until which it creeps.
    """

    def __init__(self) -> None:
        self._stands_since_s: float | None = None
        self._until_s = -math.inf

    def begins_or_goes_on(self, now_s: float, speed_mps: float, *, held: bool) -> bool:
        """Return whether the ego is to creep at a time; to be called at each decision, with increasing times.

        `held`: whether a stop line applies.
        """
        if held:
            self._until_s = -math.inf
        elif now_s < self._until_s:
            return True
        if held or speed_mps >= cfg.TARGET_STANDS_MPS:
            self._stands_since_s = None
            return False
        if self._stands_since_s is None:
            self._stands_since_s = now_s
        if now_s - self._stands_since_s < cfg.CREEPS_AFTER_S:
            return False
        self._stands_since_s, self._until_s = None, now_s + cfg.CREEPS_FOR_S
        return True


def along_the_route(mission: Mission, at_s: float, ego: EgoState, times_s: Sequence[float]) -> FloatArray:
    """Return waypoints along the route at the speed of creeping, [N, 2] m ahead of the ego and to its left.

    Args:
        mission: the mission with the route. at_s: the ego's length along the route, m. ego: the ego's place. times_s:
            times of the waypoints, from now, s.
    """
    s = at_s + cfg.CREEPS_MPS * np.array(times_s)
    dx = np.interp(s, mission.s, mission.centreline[:, 0]) - ego.x
    dy = np.interp(s, mission.s, mission.centreline[:, 1]) - ego.y
    cos, sin = math.cos(ego.heading_rad), math.sin(ego.heading_rad)
    return np.column_stack([dx * cos + dy * sin, dy * cos - dx * sin])


# ---- the fastest safe speed ------------------------------------------------------------------------------------------


class Speeds(NamedTuple):
    """Limits of the speeds. `step_s`: duration of a step (T); `most_mps`: highest speed; `acceleration_mps2`,
    `braking_mps2`: both positive."""

    step_s: float
    most_mps: float
    acceleration_mps2: float
    braking_mps2: float


def fastest_safe_speed(now_mps: float, free_m: FloatArray, bounds: Speeds) -> float | None:
    """Return the highest speed for the end of the first step, m/s; None if no speed is safe.

    A small linear programme in closed form (after InterFuser's safety controller):

        maximise v1, where for each step k = 1 .. N of T seconds
            the way driven, (v0 + v1) T/2 + ... + (v(k-1) + vk) T/2, is at most free_m[k]
            -braking T <= vk - v(k-1) <= acceleration T,   0 <= vk <= most_mps

    InterFuser has two steps of 0.5 s, and drives at most 5 m/s. With more steps it looks farther ahead: N T seconds of
    braking.

    Whatever v1 is, the ways of all later steps are shortest when the ego brakes as hard as allowed from then on. So v1
    is feasible if these shortest ways keep their limits. The way of step k is a sum of the speeds max(0, v1 - (i-1)
    braking T), weighted 2 for i < k and 1 for i = k. This sum keeps a limit if, for every m, the sum of its first m
    terms without the max keeps the same limit. Each of these conditions is a linear bound on v1; the smallest bound is
    the answer.

    Args:
        now_mps: v0. free_m: [N] how far the ego may have come at the end of each step, infinite if nothing limits it.
            bounds: limits of speed, acceleration and braking, and the duration of a step.
    """
    step, fall = bounds.step_s, bounds.braking_mps2 * bounds.step_s
    weights, falls = _sums(len(free_m))
    room = 2.0 * free_m / step - now_mps
    binding = ((room[:, None] + fall * falls) / weights).min(initial=np.inf)
    highest = min(float(binding), bounds.most_mps, now_mps + bounds.acceleration_mps2 * step)
    return highest if highest >= max(now_mps - fall, 0.0) else None


@lru_cache(maxsize=4)
def _sums(steps: int) -> tuple[FloatArray, FloatArray]:
    """Return sums of the first m speeds of step k ([k, m]): of their weights, and of the weighted multiples of `fall`
    by which they are below v1. For m > k the values are those of m = k."""
    term = np.arange(steps)
    weight = np.where(term[None, :] < term[:, None], 2.0, np.where(term[None, :] == term[:, None], 1.0, 0.0))
    return np.cumsum(weight, axis=1), np.cumsum(weight * term, axis=1)
