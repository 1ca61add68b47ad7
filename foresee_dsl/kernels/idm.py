"""Decides how the driver `idm` accelerates: the Intelligent Driver Model, right of way, and an emergency brake.

The other actors are predicted with constant speed on a straight line in the route's coordinates (length along it and
offset from it), so they follow its bends.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, Records
from foresee_dsl.kernels.compiling import FLOAT, FLOATS, TABLE, compiled, inner
from foresee_dsl.kernels.pdm import records as r
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.decision import pedals, steer
from foresee_dsl.kernels.pdm.prediction import match
from foresee_dsl.kernels.pdm.records import ACTOR, FOE
from foresee_dsl.kernels.pdm.route import near_foes, near_junctions, place_actors, place_ego, profile_at, stops_before
from foresee_dsl.kernels.records import array_of, dtype_of
from foresee_dsl.kernels.tracks import TRACKS

ACCELERATION_MPS2 = 1.0
"""Acceleration of the model, m/s^2; the docstring of `drivers.idm` has its source."""
TIME_GAP_S = 1.0
BRAKING_MPS2 = 1.5
EXPONENT = 4.0
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


class ActorOnRoute(NamedTuple):
    """Another actor in the route's coordinates.

    Attributes:
        ahead: distance from the ego's front bumper to its near end, m; negative beside or behind it.
        far: distance from the ego's rear bumper to its far end, m. d: offset of its centre, m, left positive.
        speed_s, speed_d: speeds along and across the route, m/s. side: half the sum of both widths, m.
        pedestrian: whether it is one.
    """

    ahead: float
    far: float
    d: float
    speed_s: float
    speed_d: float
    side: float
    pedestrian: bool


ACTOR_ON_ROUTE = dtype_of(ActorOnRoute)
ON_ROUTE = array_of(ActorOnRoute)
"""The type of their array, [A]."""


# ---- the formula -----------------------------------------------------------------------------------------------------


@inner
def free_acceleration(speed: float, desired: float) -> float:
    """Return the acceleration on a free road, m/s^2: a (1 - (v / v0)^4)."""
    return ACCELERATION_MPS2 * (1.0 - math.pow(speed / desired, EXPONENT))


@inner
def _desired_gap(speed: float, closing: float) -> float:
    """Return the desired gap, m: s0 + max(0, v T + v dv / (2 sqrt(a b))), with dv the driver's speed minus the
    leader's."""
    dynamic = speed * (TIME_GAP_S + closing / (2.0 * math.sqrt(ACCELERATION_MPS2 * BRAKING_MPS2)))
    return cfg.MINIMUM_GAP_M + max(0.0, dynamic)


@compiled(FLOAT, FLOAT, FLOAT, FLOAT)
def idm_acceleration(speed: float, desired: float, gap: float, leader: float) -> float:
    """Return the IDM's acceleration, m/s^2: a (1 - (v / v0)^4 - (s* / s)^2); it has no lower bound.

    `desired`: the desired speed v0, m/s, which must be above 0. `gap`: the gap s from bumper to bumper, m; infinite if
    there is no leader. `leader`: the leader's speed, m/s.
    """
    wish = _desired_gap(speed, speed - leader) / max(gap, LEAST_GAP_M)
    return free_acceleration(speed, desired) - ACCELERATION_MPS2 * wish * wish


# ---- the other actors ------------------------------------------------------------------------------------------------


@compiled(r.EGOS, r.ACTORS, r.ROUTE)
def actors_on_route(egos: Records, actors: Records, route: Records) -> Records:
    """Return the other actors in the route's coordinates, [A]."""
    ego, others = egos[0], np.empty(len(actors), ACTOR_ON_ROUTE)
    for a in range(len(actors)):
        actor, other = actors[a], others[a]
        road = route[actor["point"]]
        along = actor["cos"] * road["cos"] + actor["sin"] * road["sin"]
        across = actor["sin"] * road["cos"] - actor["cos"] * road["sin"]
        reach_s = actor["half_length"] * abs(along) + actor["half_width"] * abs(across)
        reach_d = actor["half_length"] * abs(across) + actor["half_width"] * abs(along)
        other["ahead"] = actor["s"] - reach_s - ego["front_s"]
        other["far"] = actor["s"] + reach_s - ego["rear_s"]
        other["d"], other["side"] = actor["d"], reach_d + ego["width"] / 2
        other["speed_s"], other["speed_d"] = actor["speed"] * along, actor["speed"] * across
        other["pedestrian"] = actor["pedestrian"]
    return others


@compiled(ON_ROUTE)
def leader_of(others: Records) -> tuple[float, float]:
    """Return the gap to the nearest actor ahead in the corridor, m (infinite if there is none), and its speed, m/s.

    An oncoming actor counts as standing.
    """
    gap, speed = np.inf, 0.0
    for a in range(len(others)):
        other = others[a]
        inside = abs(other["d"]) < other["side"] + CORRIDOR_MARGIN_M and other["ahead"] > -1.0
        if inside and other["ahead"] < gap:
            gap, speed = other["ahead"], max(other["speed_s"], 0.0)
    return gap, speed


@inner
def _span(near: float, far: float, closing: float) -> tuple[float, float]:
    """Return the interval of time in which two intervals overlap, s; (inf, -inf) if they never do.

    `near`, `far`: the distances at which the overlap begins and ends, m. `closing`: how fast both shrink, m/s.
    """
    if abs(closing) < STILL_MPS:
        return (-np.inf, np.inf) if near <= 0.0 <= far else (np.inf, -np.inf)
    first, last = near / closing, far / closing
    return min(first, last), max(first, last)


@inner
def _sideways(other: np.void, margin_m: float) -> tuple[float, float]:
    """Return the interval of time in which an actor is in the ego's corridor, s; (inf, -inf) if it never is."""
    width = other["side"] + margin_m
    return _span(other["d"] - width, other["d"] + width, -other["speed_d"])


@compiled(ON_ROUTE, FLOAT)
def time_to_collision(others: Records, speed: float) -> float:
    """Return the time until the ego, at constant speed (m/s) in its corridor, first touches an actor, s; infinite if it
    never does.
    """
    soonest = np.inf
    for a in range(len(others)):
        other = others[a]
        enters, leaves = _span(other["ahead"], other["far"], speed - other["speed_s"])
        comes, goes = _sideways(other, TOUCH_MARGIN_M)
        first = max(enters, comes, 0.0)
        if first <= min(leaves, goes) and other["far"] > 0 and (enters > 0 or comes > 0):
            soonest = min(soonest, first)
    return soonest


@compiled(r.EGOS, ON_ROUTE)
def gap_to_walker(egos: Records, others: Records) -> float:
    """Return the gap to the nearest pedestrian that is in the corridor now, or will be when the ego arrives, m;
    infinite if there is none.
    """
    ego, gap = egos[0], np.inf
    speed = max(ego["forward"], LEAST_ARRIVAL_MPS)
    stops_in = ego["forward"] ** 2 / (2 * ego["strongest"])
    for a in range(len(others)):
        other = others[a]
        if not other["pedestrian"] or other["ahead"] <= -0.5:
            continue
        comes, goes = _sideways(other, WALKER_AIR_M)
        comes = max(comes, 0.0)
        if abs(other["speed_d"]) <= STILL_MPS:  # a pedestrian that stands waits for the ego
            goes = -np.inf
        enters, leaves = max(other["ahead"], 0.0) / speed, other["far"] / speed
        meets = enters < goes + WALKER_MARGIN_S and comes < leaves + WALKER_MARGIN_S and goes > 0
        # An ego that cannot stop any more passes in front of a pedestrian that arrives later.
        passes_first = comes >= leaves and other["ahead"] <= stops_in
        if meets and not passes_first and comes < WALKER_REACH_S:
            gap = min(gap, other["ahead"])
    return gap


# ---- places to wait --------------------------------------------------------------------------------------------------


@inner
def _gap_to_stop_line(egos: Records, junctions: Records, braking: FloatArray) -> float:
    """Return the distance to the first stop line at which a signal makes the ego stop, and at which it can stop, m;
    infinite if there is none. `braking`: as for `wanted_acceleration`.
    """
    front_s = egos[0]["front_s"]
    near = near_junctions(egos[0], junctions)
    for n in range(len(near)):
        stop_s, hardest = junctions[near[n]]["stop_s"], braking[near[n]]
        if hardest < 0.0 or front_s > stop_s + cfg.STOP_MARGIN_M:
            continue
        if stops_before(egos, stop_s, hardest):
            return float(stop_s - cfg.STOP_MARGIN_M - front_s)
    return np.inf


@inner
def _streams_to_yield_to(egos: Records, foes: Records, junctions: Records) -> Records:
    """Return the vehicles' streams with priority whose conflicts with the ego are ahead, in or near a junction, in the
    order of these conflicts along the route."""
    near, front_s = near_foes(egos, foes, junctions), egos[0]["front_s"]
    streams, count = np.empty(len(near), FOE), 0
    for f in range(len(near)):
        foe = near[f]
        if not foe["has_priority"] or foe["walking"] or foe["own_s"] - CONFLICT_MARGIN_M <= front_s - cfg.STOP_MARGIN_M:
            continue
        k = count
        while k > 0 and (
            foe["own_s"] < streams[k - 1]["own_s"]
            or (foe["own_s"] == streams[k - 1]["own_s"] and foe["own_until_s"] < streams[k - 1]["own_until_s"])
        ):
            streams[k] = streams[k - 1]
            k -= 1
        streams[k] = foe
        count += 1
    return streams[:count]


@inner
def _travel_time(distance_m: float, speed: float) -> float:
    """Return the time (s) that the ego takes for a distance with the IDM's acceleration on a free road."""
    return (math.sqrt(speed**2 + 2 * ACCELERATION_MPS2 * max(distance_m, 0.0)) - speed) / ACCELERATION_MPS2


@inner
def _has_gap(ego: np.void, actors: Records, foe: np.void, matches: Records) -> bool:
    """Return whether no actor of a stream is in the conflict zone at the same time as the ego, with a margin.

    `matches`: [A] the actors' matches with this stream.
    """
    enters = _travel_time(foe["own_s"] - ego["front_s"], ego["speed"])
    clears = _travel_time(foe["own_until_s"] - ego["rear_s"], ego["speed"])
    for a in range(len(actors)):
        place = matches[a]
        if not place["on"] or place["speed"] <= cfg.SENSED_STANDS_MPS:
            continue
        half = actors[a]["half_length"]
        arrives = (foe["meets"] - place["s"] - half) / place["speed"]
        leaves = (foe["leaves"] - place["s"] + half) / place["speed"]
        if leaves > enters and arrives < clears + GAP_MARGIN_S:
            return False
    return True


@compiled(r.EGOS, r.ACTORS, r.FOES, r.PATHS, r.JUNCTIONS)
def gap_to_yield(egos: Records, actors: Records, foes: Records, paths: Records, junctions: Records) -> float:
    """Return the distance to the place where the ego waits for a gap in a stream with priority, m; infinite if it may
    go.

    The ego waits before a stream's conflict. If there is no room for it between that conflict and earlier ones, the
    place lies before the first of these.
    """
    ego, waits_s = egos[0], np.inf
    streams = _streams_to_yield_to(egos, foes, junctions)
    if len(streams) == 0 or len(actors) == 0:
        return np.inf
    matches = match(actors, streams, paths)
    length = ego["front_s"] - ego["rear_s"]
    wait_s, last_s = -np.inf, -np.inf
    for f in range(len(streams)):
        foe = streams[f]
        if foe["own_s"] - last_s > length + CONFLICT_MARGIN_M:
            wait_s = foe["own_s"] - CONFLICT_MARGIN_M
        last_s = max(last_s, foe["own_until_s"])
        passed = ego["front_s"] > wait_s + cfg.STOP_MARGIN_M
        place_s = foe["own_s"] - CONFLICT_MARGIN_M if passed else wait_s
        stops = place_s < waits_s and stops_before(egos, place_s + CONFLICT_MARGIN_M / 2, YIELD_BRAKING_MPS2)
        if stops and not _has_gap(ego, actors, foe, matches[:, f]):
            waits_s = place_s
    return float(waits_s - ego["front_s"])


# ---- the decision ----------------------------------------------------------------------------------------------------


@compiled(r.EGOS, r.ACTORS, r.ROUTE, r.FOES, r.PATHS, r.JUNCTIONS, FLOATS)
def wanted_acceleration(
    egos: Records,
    actors: Records,
    route: Records,
    foes: Records,
    paths: Records,
    junctions: Records,
    braking: FloatArray,
) -> float:
    """Return the acceleration that the driver wants, m/s^2.

    `braking`: [J] the braking with which the ego stops for each junction's signal, m/s^2, negative where it may go. The
    positions of the ego and the actors on the route must be filled in before.
    """
    ego, others = egos[0], actors_on_route(egos, actors, route)
    speed = ego["forward"]
    if speed > cfg.SENSED_STANDS_MPS and time_to_collision(others, speed) < EMERGENCY_TTC_S:
        return float(-ego["strongest"])
    allowed = profile_at(route, ego["s"] + PREVIEW_S * speed)
    desired = max(allowed, LEAST_DESIRED_MPS)
    # Brake for bends in time: the free term of the IDM has only one desired speed, and would begin to brake in the
    # bend.
    wish = min(free_acceleration(speed, desired), (allowed - speed) / PREVIEW_S)
    gap, leader = leader_of(others)
    wish = min(wish, idm_acceleration(speed, desired, gap, leader))
    # A waiting place is treated as a standing leader. Because the IDM keeps a gap to a leader, this leader is put that
    # gap beyond the waiting place.
    wish = min(wish, idm_acceleration(speed, desired, gap_to_walker(egos, others), 0.0))
    line = _gap_to_stop_line(egos, junctions, braking) + cfg.MINIMUM_GAP_M
    wish = min(wish, idm_acceleration(speed, desired, line, 0.0))
    yields = gap_to_yield(egos, actors, foes, paths, junctions) + cfg.MINIMUM_GAP_M
    return float(max(min(wish, idm_acceleration(speed, desired, yields, 0.0)), -ego["strongest"]))


@compiled(r.EGOS, TRACKS, r.ROUTE, TABLE, r.FOES, r.PATHS, r.JUNCTIONS, FLOATS)
def decide(
    egos: Records,
    tracks: Records,
    route: Records,
    coarse: FloatArray,
    foes: Records,
    paths: Records,
    junctions: Records,
    braking: FloatArray,
) -> tuple[float, float, float, float, float]:
    """Return steering, throttle and brake, as shares of their maximum, then the front-wheel angle (rad) and the
    acceleration (m/s^2) that the driver wants. Fills in the ego's position.

    `coarse`: as for `place_ego`. `braking`: as for `wanted_acceleration`.
    """
    place_ego(egos, route, coarse)
    actors = np.empty(len(tracks), ACTOR)
    place_actors(egos, tracks, route, actors)
    angle = steer(egos, route, 0.0)
    acceleration = wanted_acceleration(egos, actors, route, foes, paths, junctions, braking)
    steering, throttle, brake = pedals(egos, angle, acceleration)
    return steering, throttle, brake, angle, acceleration
