"""The driver `idm`: follows its route with the Intelligent Driver Model, gives way, and brakes in an emergency.

It is the baseline for other drivers: it never changes lanes, and predicts constant speeds only. Route, tracker, signals
and steering are those of `pdm`.

The model is that of Treiber, Hennecke, Helbing 2000, Physical Review E 62, equations 2 and 3. Its constants are ours,
for city traffic: those of the paper (table I) are for motorways, where acceleration to 50 km/h with 0.73 m/s^2 takes
half a minute. They are meant to be those of Treiber and Kesting 2013, Traffic Flow Dynamics, table 11.2, which could
not be looked up.

The other actors are predicted with constant speed on a straight line in the route's coordinates (length along it and
offset from it), so they follow its bends.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from foresee_dsl.drivers.bundled import BundledDriver, Memory
from foresee_dsl.drivers.parts import DriverPart, PlannedMotion
from foresee_dsl.drivers.pdm.route import DriverRoute, build_route
from foresee_dsl.drivers.pdm.situation import RoadSituation, read_situation, signal_braking
from foresee_dsl.drivers.protocol import Control, FloatArray, Mission, Observation, Reason, SignalColour, VehicleLimits
from foresee_dsl.drivers.tracking import Tracks
from foresee_dsl.kernels.arrays import BoolArray, Records
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.decision import pedals, steer
from foresee_dsl.kernels.pdm.prediction import match
from foresee_dsl.kernels.pdm.records import EgoRecord
from foresee_dsl.kernels.pdm.route import stops_before

ACCELERATION_MPS2 = 1.0
"""Acceleration of the model, m/s^2; the module's docstring has its source."""
TIME_GAP_S = 1.0
BRAKING_MPS2 = 1.5
EXPONENT = 4
LEAST_GAP_M = 0.1
"""Smallest gap with which the model computes, m. Ours: it avoids a division by zero."""

EMERGENCY_TTC_S = 1.5
"""Time to collision below which the driver brakes in an emergency, s: FHWA-HRT-08-051 (the Surrogate Safety Assessment
Model) counts a lower one as a conflict."""
PREVIEW_S = 0.5
"""The driver takes its desired speed from the place that it reaches after this time, s. Ours: drivetrain and brakes
respond 0.2 s late.
"""
LEAST_DESIRED_MPS = 0.5
"""Lowest desired speed, m/s. Ours: it avoids a division by zero."""

CORRIDOR_MARGIN_M = 0.3
"""An actor within this distance of the ego's side is in its corridor, m. Ours: a car in a lane of 3.3 m has 0.7 m of
free width on either side.
"""
TOUCH_MARGIN_M = 0.15
"""Lateral margin between the footprints for the time to collision, m. Ours: smaller than `CORRIDOR_MARGIN_M`, as a
false alarm causes full braking."""
STILL_MPS = 0.1
"""A distance that changes more slowly than this counts as constant, m/s. Ours."""
CONFLICT_MARGIN_M = 1.0
"""Distance before a conflict at which the ego waits, m. Ours: the front corners swing out in a turn."""
YIELD_BRAKING_MPS2 = 4.0
"""The hardest braking with which the ego gives way, m/s^2. Ours."""
GAP_MARGIN_S = 1.5
"""Least time between the ego clearing a conflict and the arrival of a vehicle with priority, s. Ours."""
WALKER_AIR_M = 0.8
"""A pedestrian within this distance of the lane is about to step on it, m. Ours: one stride."""
WALKER_MARGIN_S = 1.0
"""Least time between the ego and a pedestrian at the same place, s. Ours."""
WALKER_REACH_S = 6.0
"""Pedestrians that enter the corridor after this time are ignored, s. Ours: a comfortable stop from 50 km/h takes 6
s."""
LEAST_ARRIVAL_MPS = 3.0
"""Lowest speed with which the ego's time of arrival is computed, m/s. Ours: otherwise a standing ego would never arrive
anywhere, so it would see no conflict and set off."""


class _IdmState:
    """The state of the driver from one `reset` to the next.

    Attributes:
        route: the route that it follows.
        tracker: tracks the other actors.
    """

    route: DriverRoute

    def __init__(self, mission: Mission, vehicle: VehicleLimits, memory: Memory) -> None:
        self.follow(build_route(mission, vehicle))
        self._vehicle = vehicle
        self.tracker, self._signals = memory.tracker, memory.signals
        self._last: tuple[RoadSituation, Tracks] | None = None
        self._plan: PlannedMotion | None = None

    def follow(self, route: DriverRoute) -> None:
        """Follow this route from the next step on."""
        self.route = route

    def step(self, observation: Observation) -> Control:
        """Answer an observation: keep the middle of the lane, with the model's acceleration."""
        tracks, signals = self.tracker.update(observation), self._signals.update(observation)
        situation = read_situation(self.route, self._vehicle, observation, tracks, signals)
        self._last = situation, tracks
        angle, acceleration = steer(situation.egos, self.route.points, 0.0), _acceleration(situation)
        self._plan = PlannedMotion(acceleration, angle)
        return Control(*pedals(situation.egos, angle, acceleration))

    def planned(self) -> PlannedMotion | None:
        """Return the model's acceleration and the wheel angle of the last step."""
        return self._plan

    def explain(self) -> Sequence[Reason]:
        """Return the reasons for the last answer: decide once more for each signal and object alone
        (`drivers.pdm.reasons`).
        """
        # Imported here, because driving does not need it.
        from foresee_dsl.drivers.pdm.reasons import Wish, reasons_alone, situation_of

        if self._last is None:
            return ()
        now, tracks = self._last

        def decided(others: Tracks, colours: Mapping[str, SignalColour]) -> Wish:
            return Wish(_acceleration(situation_of(now, others, colours)))

        return reasons_alone(now, tracks, decided)


class IdmDriver(BundledDriver[_IdmState]):
    """Follows its lane with the Intelligent Driver Model, gives way, emergency brake (the floor).

    Its answer is a function of the observations since `reset`, the mission and the vehicle; `seed` has no effect.
    """

    name = "idm"
    version = "1"
    state_type = _IdmState
    parts = (DriverPart.PERCEPTION, DriverPart.TRACKING, DriverPart.RULES, DriverPart.CONTROL)


def _acceleration(situation: RoadSituation) -> float:
    """Return the acceleration that the driver wants, m/s^2."""
    ego, route = situation.ego, situation.route
    speed, others = ego.forward, read_others(situation)
    if speed > cfg.SENSED_STANDS_MPS and time_to_collision(others, speed) < EMERGENCY_TTC_S:
        return -ego.strongest
    allowed = float(route.between("profile", ego.s + PREVIEW_S * speed))
    desired = max(allowed, LEAST_DESIRED_MPS)
    # Brake for bends in time: the free term of the IDM has only one desired speed, and would begin to brake in the
    # bend.
    wish = min(free_acceleration(speed, desired), (allowed - speed) / PREVIEW_S)
    # A waiting place is treated as a standing leader. Because the IDM keeps a gap to a leader, this leader is put that
    # gap beyond the waiting place.
    waits = (
        (walkers(situation, others), 0.0),
        (stop_line(situation), cfg.MINIMUM_GAP_M),
        (giving_way(situation), cfg.MINIMUM_GAP_M),
    )
    places = [IdmLeader(gap + farther, 0.0) for gap, farther in waits if gap is not None]
    ahead = leader(others)
    for place in places if ahead is None else [ahead, *places]:
        wish = min(wish, idm_acceleration(speed, desired, place.gap_m, place.speed_mps))
    return max(wish, -ego.strongest)


def free_acceleration(speed_mps: float, desired_mps: float) -> float:
    """Return the acceleration on a free road, m/s^2: a (1 - (v / v0)^4)."""
    return ACCELERATION_MPS2 * (1.0 - (speed_mps / desired_mps) ** EXPONENT)


def desired_gap(speed_mps: float, closing_mps: float) -> float:
    """Return the desired gap, m: s0 + max(0, v T + v dv / (2 sqrt(a b))), with dv the driver's speed minus the
    leader's.
    """
    dynamic = speed_mps * (TIME_GAP_S + closing_mps / (2.0 * math.sqrt(ACCELERATION_MPS2 * BRAKING_MPS2)))
    return cfg.MINIMUM_GAP_M + max(0.0, dynamic)


def idm_acceleration(speed_mps: float, desired_mps: float, gap_m: float, leader_mps: float) -> float:
    """Return the IDM's acceleration, m/s^2: a (1 - (v / v0)^4 - (s* / s)^2); it has no lower bound.

    `desired_mps`: the desired speed v0, which must be above 0. `gap_m`: the gap s from bumper to bumper; infinite if
    there is no leader.
    """
    wish = desired_gap(speed_mps, speed_mps - leader_mps) / max(gap_m, LEAST_GAP_M)
    return free_acceleration(speed_mps, desired_mps) - ACCELERATION_MPS2 * wish * wish


# ---- the other actors ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ActorsOnRoute:
    """The other actors in the route's coordinates; every array is [A].

    Attributes:
        ahead: distance from the ego's front bumper to their near end, m; negative beside or behind it.
        far: distance from the ego's rear bumper to their far end, m. d: offset of their centre, m, left positive.
        speed_s, speed_d: speeds along and across the route, m/s. side: half the sum of both widths, m.
    """

    ahead: FloatArray
    far: FloatArray
    d: FloatArray
    speed_s: FloatArray
    speed_d: FloatArray
    side: FloatArray


@dataclass(frozen=True)
class IdmLeader:
    """The actor that the ego must stay behind: the gap to it (m), and its speed along the route (m/s)."""

    gap_m: float
    speed_mps: float


def read_others(situation: RoadSituation) -> ActorsOnRoute:
    """Return the other actors in the route's coordinates."""
    ego, actors = situation.ego, situation.actors
    road = situation.route.points[actors["point"]]
    along = actors["cos"] * road["cos"] + actors["sin"] * road["sin"]
    across = actors["sin"] * road["cos"] - actors["cos"] * road["sin"]
    reach_s = actors["half_length"] * np.abs(along) + actors["half_width"] * np.abs(across)
    reach_d = actors["half_length"] * np.abs(across) + actors["half_width"] * np.abs(along)
    return ActorsOnRoute(
        ahead=actors["s"] - reach_s - ego.front_s,
        far=actors["s"] + reach_s - ego.rear_s,
        d=actors["d"],
        speed_s=actors["speed"] * along,
        speed_d=actors["speed"] * across,
        side=reach_d + ego.width / 2,
    )


def leader(others: ActorsOnRoute) -> IdmLeader | None:
    """Return the nearest actor ahead in the corridor; None if there is none. An oncoming actor counts as standing."""
    inside = (np.abs(others.d) < others.side + CORRIDOR_MARGIN_M) & (others.ahead > -1.0)
    if not inside.any():
        return None
    nearest = int(np.where(inside, others.ahead, np.inf).argmin())
    return IdmLeader(float(others.ahead[nearest]), max(float(others.speed_s[nearest]), 0.0))


def time_to_collision(others: ActorsOnRoute, speed_mps: float) -> float:
    """Return the time until the ego, at constant speed in its corridor, first touches an actor, s; infinite if it never
    does.
    """
    enters, leaves = _span(others.ahead, others.far, speed_mps - others.speed_s)
    comes, goes = _sideways(others, TOUCH_MARGIN_M)
    first = np.maximum(np.maximum(enters, comes), 0.0)
    touch = (first <= np.minimum(leaves, goes)) & (others.far > 0) & ((enters > 0) | (comes > 0))
    return float(np.where(touch, first, np.inf).min(initial=np.inf))


def walkers(situation: RoadSituation, others: ActorsOnRoute) -> float | None:
    """Return the gap (m) to the nearest pedestrian that is in the corridor now, or will be when the ego arrives; None
    if there is none.
    """
    if not situation.actors["pedestrian"].any():
        return None
    comes, goes = _sideways(others, WALKER_AIR_M)
    moving = np.abs(others.speed_d) > STILL_MPS
    comes, goes = np.maximum(comes, 0.0), np.where(moving, goes, -np.inf)  # a pedestrian that stands waits for the ego
    speed = max(situation.ego.forward, LEAST_ARRIVAL_MPS)
    enters, leaves = np.maximum(others.ahead, 0.0) / speed, others.far / speed
    meets = (enters < goes + WALKER_MARGIN_S) & (comes < leaves + WALKER_MARGIN_S) & (goes > 0)
    # An ego that cannot stop any more passes in front of a pedestrian that arrives later.
    stops_in = situation.ego.forward**2 / (2 * situation.ego.strongest)
    meets &= (comes < leaves) | (others.ahead > stops_in)
    in_way = situation.actors["pedestrian"] & meets & (others.ahead > -0.5) & (comes < WALKER_REACH_S)
    return float(others.ahead[in_way].min()) if in_way.any() else None


def stop_line(situation: RoadSituation) -> float | None:
    """Return the distance (m) to the first stop line at which a signal makes the ego stop, and at which it can stop;
    None if there is none.
    """
    ego = situation.ego
    for k in np.flatnonzero(_near_junctions(situation)).tolist():
        passage = situation.route.passages[k]
        braking = signal_braking(passage, ego.strongest, situation.signals)
        if braking is None or ego.front_s > passage.stop_s + cfg.STOP_MARGIN_M:
            continue
        if stops_before(situation.egos, passage.stop_s, braking):
            return passage.stop_s - cfg.STOP_MARGIN_M - ego.front_s
    return None


def giving_way(situation: RoadSituation) -> float | None:
    """Return the distance (m) to the place where the ego waits for a gap in a stream with priority; None if it
    may go.
    """
    ego, route = situation.ego, situation.route
    yields = route.foes["has_priority"] & ~route.foes["walking"]
    ahead = route.foes["own_s"] - CONFLICT_MARGIN_M > ego.front_s - cfg.STOP_MARGIN_M
    foes = route.foes[yields & ahead & _near_junctions(situation)[route.foes["junction"]]]
    if not len(foes) or not len(situation.actors):
        return None
    matches = match(situation.actors, foes, route.paths)
    waiting = sorted(
        place
        for k, place in enumerate(_waiting_places(foes, ego))
        if _no_gap(ego, situation.actors, foes[k], matches[:, k])
    )
    for place in waiting:
        if stops_before(situation.egos, place + CONFLICT_MARGIN_M / 2, YIELD_BRAKING_MPS2):
            return place - ego.front_s
    return None


def _near_junctions(situation: RoadSituation) -> BoolArray:
    """Return, for each junction, whether the ego is in or near it, [J]."""
    ego, junctions = situation.ego, situation.route.junctions
    return np.asarray((ego.rear_s < junctions["end_s"]) & (junctions["stop_s"] - ego.front_s < cfg.JUNCTION_REACH_M))


def _waiting_places(foes: Records, ego: EgoRecord) -> list[float]:
    """Return the place, along the route, at which the ego waits for each stream. If there is no room for the ego
    between the stream's conflict and earlier ones, the place lies before the first of these.
    """
    length = ego.front_s - ego.rear_s
    conflicts = list(zip(foes["own_s"].tolist(), foes["own_until_s"].tolist(), strict=True))
    places = [0.0] * len(foes)
    wait, last = -math.inf, -math.inf
    for k in sorted(range(len(foes)), key=conflicts.__getitem__):
        first, until = conflicts[k]
        if first - last > length + CONFLICT_MARGIN_M:
            wait = first - CONFLICT_MARGIN_M
        last = max(last, until)
        places[k] = wait if ego.front_s <= wait + cfg.STOP_MARGIN_M else first - CONFLICT_MARGIN_M
    return places


def _no_gap(ego: EgoRecord, actors: Records, foe: np.void, matches: Records) -> bool:
    """Return whether an actor of a stream is in the conflict zone at the same time as the ego, with a margin.

    `matches`: [A] the actors' matches with this stream.
    """
    enters = _travel_time(float(foe["own_s"]) - ego.front_s, ego.speed)
    clears = _travel_time(float(foe["own_until_s"]) - ego.rear_s, ego.speed)
    speed = np.maximum(matches["speed"], 1e-3)
    half = actors["half_length"]
    arrives = (foe["meets"] - matches["s"] - half) / speed
    leaves = (foe["leaves"] - matches["s"] + half) / speed
    comes = matches["on"] & (matches["speed"] > cfg.SENSED_STANDS_MPS)
    return bool((comes & (leaves > enters) & (arrives < clears + GAP_MARGIN_S)).any())


def _travel_time(distance_m: float, speed_mps: float) -> float:
    """Return the time (s) that the ego takes for a distance with the IDM's acceleration on a free road."""
    return (math.sqrt(speed_mps**2 + 2 * ACCELERATION_MPS2 * max(distance_m, 0.0)) - speed_mps) / ACCELERATION_MPS2


def _span(ahead: FloatArray, far: FloatArray, closing: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the interval of time in which the ego is level with each actor, s; (inf, -inf) if it never is."""
    level = (ahead <= 0) & (far >= 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        near, last = ahead / closing, far / closing
    still = np.abs(closing) < STILL_MPS
    enters = np.where(still, np.where(level, -np.inf, np.inf), np.minimum(near, last))
    leaves = np.where(still, np.where(level, np.inf, -np.inf), np.maximum(near, last))
    return enters, leaves


def _sideways(others: ActorsOnRoute, margin_m: float) -> tuple[FloatArray, FloatArray]:
    """Return the interval of time in which each actor is in the ego's corridor, s; (inf, -inf) if it never is."""
    width = others.side + margin_m
    return _span(others.d - width, others.d + width, -others.speed_d)
