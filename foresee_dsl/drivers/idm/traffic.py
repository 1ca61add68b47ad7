"""What the `idm` driver reads from the others: which are in its corridor, which enter it, which have priority.

All are predicted with constant speed in a straight line of the route's own coordinates (length along it and offset from
it), so that they follow its bends; nothing else is predicted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from foresee_dsl.drivers.pdm.situation import Situation, signal_braking
from foresee_dsl.drivers.protocol import FloatArray
from foresee_dsl.kernels.arrays import BoolArray, Records
from foresee_dsl.kernels.pdm.prediction import match
from foresee_dsl.kernels.pdm.records import Ego
from foresee_dsl.kernels.pdm.route import stops_before

ACCELERATION_MPS2 = 1.0
"""See the package's docstring."""
CORRIDOR_MARGIN_M = 0.3
"""Ours: an actor this near to the ego's side counts as in its corridor; a lane of 3.3 m has 0.7 m beside a car."""
TOUCH_MARGIN_M = 0.15
"""Ours: the same for the time to collision, where a false alarm means full braking."""
STANDS_MPS = 0.5
STILL_MPS = 0.1
"""Ours: below this relative speed a distance is taken to be constant."""
STOP_MARGIN_M = 0.5
"""Ours: the front bumper stops this far before a stop line."""
JUNCTION_REACH_M = 80.0
"""Ours: junctions nearer than this are considered; the stopping distance from 50 km/h at 1.5 m/s^2, and 15 m."""
CONFLICT_MARGIN_M = 1.0
"""Ours: it waits this far before a conflict (the front corners swing out in a turn)."""
YIELD_BRAKING_MPS2 = 4.0
"""Ours: an ego that would need more braking than this does not give way any more."""
GAP_MARGIN_S = 1.5
"""Ours: a gap is accepted when the vehicle with priority arrives this long after the ego has cleared the conflict."""
WALKER_AIR_M = 0.8
"""Ours: about to step on the lane: within a stride of it."""
WALKER_MARGIN_S = 1.0
"""Ours: least time between the ego and a pedestrian at the same place."""
WALKER_REACH_S = 6.0
"""Ours: pedestrians that enter the corridor later than this are ignored; 6 s are a comfortable stop from 50 km/h."""
LEAST_ARRIVAL_MPS = 3.0
"""Ours: a slow or standing ego is assumed to arrive with this speed: else, as it never arrives, it would set off."""


@dataclass(frozen=True)
class Others:
    """The others in the route's coordinates; every array is [A].

    Attributes:
        ahead: m from the ego's front bumper to their near end, below 0 where it is beside or behind.
        far: m from the ego's rear bumper to their far end. d: offset of their centre, m, left positive.
        speed_s, speed_d: m/s along and across the route. side: m, half of both widths.
    """

    ahead: FloatArray
    far: FloatArray
    d: FloatArray
    speed_s: FloatArray
    speed_d: FloatArray
    side: FloatArray


@dataclass(frozen=True)
class Leader:
    """What the ego must stay behind: the gap (m) to its front bumper, and the speed along the route (m/s)."""

    gap_m: float
    speed_mps: float


def read_others(situation: Situation) -> Others:
    """Return the others in the route's coordinates."""
    ego, actors = situation.ego, situation.actors
    road = situation.route.points[actors["point"]]
    along = actors["cos"] * road["cos"] + actors["sin"] * road["sin"]
    across = actors["sin"] * road["cos"] - actors["cos"] * road["sin"]
    reach_s = actors["half_length"] * np.abs(along) + actors["half_width"] * np.abs(across)
    reach_d = actors["half_length"] * np.abs(across) + actors["half_width"] * np.abs(along)
    return Others(
        ahead=actors["s"] - reach_s - ego.front_s,
        far=actors["s"] + reach_s - ego.rear_s,
        d=actors["d"],
        speed_s=actors["speed"] * along,
        speed_d=actors["speed"] * across,
        side=reach_d + ego.width / 2,
    )


def leader(others: Others) -> Leader | None:
    """Return the nearest actor ahead in the corridor; an oncoming one counts as standing."""
    inside = (np.abs(others.d) < others.side + CORRIDOR_MARGIN_M) & (others.ahead > -1.0)
    if not inside.any():
        return None
    nearest = int(np.where(inside, others.ahead, np.inf).argmin())
    return Leader(float(others.ahead[nearest]), max(float(others.speed_s[nearest]), 0.0))


def time_to_collision(others: Others, speed_mps: float) -> float:
    """Return the time until the ego, at constant speed in its corridor, first touches an actor, s; infinite: never."""
    enters, leaves = _span(others.ahead, others.far, speed_mps - others.speed_s)
    comes, goes = _sideways(others, TOUCH_MARGIN_M)
    first = np.maximum(np.maximum(enters, comes), 0.0)
    touch = (first <= np.minimum(leaves, goes)) & (others.far > 0) & ((enters > 0) | (comes > 0))
    return float(np.where(touch, first, np.inf).min(initial=np.inf))


def walkers(situation: Situation, others: Others) -> float | None:
    """Return the gap, m, to the nearest pedestrian that is, or will be, in the corridor when the ego is there."""
    if not situation.actors["pedestrian"].any():
        return None
    comes, goes = _sideways(others, WALKER_AIR_M)
    moving = np.abs(others.speed_d) > STILL_MPS
    comes, goes = np.maximum(comes, 0.0), np.where(moving, goes, -np.inf)  # a standing one waits
    speed = max(situation.ego.forward, LEAST_ARRIVAL_MPS)
    enters, leaves = np.maximum(others.ahead, 0.0) / speed, others.far / speed
    meets = (enters < goes + WALKER_MARGIN_S) & (comes < leaves + WALKER_MARGIN_S) & (goes > 0)
    # The ego passes in front of a pedestrian that comes after it if it cannot stop any more.
    stops_in = situation.ego.forward**2 / (2 * situation.ego.strongest)
    meets &= (comes < leaves) | (others.ahead > stops_in)
    found = situation.actors["pedestrian"] & meets & (others.ahead > -0.5) & (comes < WALKER_REACH_S)
    return float(others.ahead[found].min()) if found.any() else None


def stop_line(situation: Situation) -> float | None:
    """Return the distance to the first stop line whose signal asks to stop and where the ego can, m."""
    ego = situation.ego
    for k in np.flatnonzero(_near_junctions(situation)).tolist():
        passage = situation.route.passages[k]
        braking = signal_braking(passage, ego.strongest, situation.signals)
        if braking is None or ego.front_s > passage.stop_s + STOP_MARGIN_M:
            continue
        if stops_before(situation.egos, passage.stop_s, braking):
            return passage.stop_s - STOP_MARGIN_M - ego.front_s
    return None


def giving_way(situation: Situation) -> float | None:
    """Return the distance to where the ego waits for a gap in a stream with priority, m; None: it may go."""
    ego, route = situation.ego, situation.route
    yields = route.foes["has_priority"] & ~route.foes["walking"]
    ahead = route.foes["own_s"] - CONFLICT_MARGIN_M > ego.front_s - STOP_MARGIN_M
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


def _near_junctions(situation: Situation) -> BoolArray:
    """Tell which junctions the ego is in or near, [J]."""
    ego, junctions = situation.ego, situation.route.junctions
    return np.asarray((ego.rear_s < junctions["end_s"]) & (junctions["stop_s"] - ego.front_s < JUNCTION_REACH_M))


def _waiting_places(foes: Records, ego: Ego) -> list[float]:
    """Return where along the route the ego waits for each: before the first of those that leave it no room between."""
    length = ego.front_s - ego.rear_s
    conflicts = list(zip(foes["own_s"].tolist(), foes["own_until_s"].tolist(), strict=True))
    places = [0.0] * len(foes)
    wait, last = -math.inf, -math.inf
    for k in sorted(range(len(foes)), key=conflicts.__getitem__):
        first, until = conflicts[k]
        if first - last > length + CONFLICT_MARGIN_M:
            wait = first - CONFLICT_MARGIN_M
        last = max(last, until)
        places[k] = wait if ego.front_s <= wait + STOP_MARGIN_M else first - CONFLICT_MARGIN_M
    return places


def _no_gap(ego: Ego, actors: Records, foe: np.void, matches: Records) -> bool:
    """Tell whether an actor of a stream arrives before the ego has cleared the conflict, and leaves after it enters.

    `matches` are the actors' [A] with this stream.
    """
    enters = _travel_time(float(foe["own_s"]) - ego.front_s, ego.speed)
    clears = _travel_time(float(foe["own_until_s"]) - ego.rear_s, ego.speed)
    speed = np.maximum(matches["speed"], 1e-3)
    half = actors["half_length"]
    arrives = (foe["meets"] - matches["s"] - half) / speed
    leaves = (foe["leaves"] - matches["s"] + half) / speed
    comes = matches["on"] & (matches["speed"] > STANDS_MPS)
    return bool((comes & (leaves > enters) & (arrives < clears + GAP_MARGIN_S)).any())


def _travel_time(distance_m: float, speed_mps: float) -> float:
    """Return how long the ego takes for a distance, accelerating as the IDM does on a free road, s."""
    return (math.sqrt(speed_mps**2 + 2 * ACCELERATION_MPS2 * max(distance_m, 0.0)) - speed_mps) / ACCELERATION_MPS2


def _span(ahead: FloatArray, far: FloatArray, closing: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return from when to when the ego is level with each, s; an empty span (inf, -inf): never."""
    level = (ahead <= 0) & (far >= 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        near, last = ahead / closing, far / closing
    still = np.abs(closing) < STILL_MPS
    enters = np.where(still, np.where(level, -np.inf, np.inf), np.minimum(near, last))
    leaves = np.where(still, np.where(level, np.inf, -np.inf), np.maximum(near, last))
    return enters, leaves


def _sideways(others: Others, margin_m: float) -> tuple[FloatArray, FloatArray]:
    """Return from when to when each is in the ego's corridor, s; an empty span (inf, -inf): never."""
    width = others.side + margin_m
    return _span(others.d - width, others.d + width, -others.speed_d)
