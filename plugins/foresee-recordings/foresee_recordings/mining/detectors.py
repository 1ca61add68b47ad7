"""Situations for which the language has no words: cut-ins, turns across oncoming traffic, crossing paths.

They are found in the geometry of tracks alone, so that recordings without a map can be searched too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.simulate.results.footprints import HORIZON_S
from foresee_dsl.simulate.trace import STEP_S
from foresee_recordings.mining.crossings import Crossing, crossings
from foresee_recordings.mining.measures import PairOnWay, column
from foresee_recordings.mining.rows import EGO, EGO_KINDS, Rows, rows_of
from foresee_recordings.mining.situation import Occurrence
from foresee_recordings.mining.traffic import HEADING, SPEED, Traffic, X, Y
from foresee_recordings.recording import FloatArray

Flags = NDArray[np.bool_]
CUT_IN_HEADWAY_S = 2.0
"""Largest time gap at a cut-in, s. Ours: the distance that driving schools teach; a driver with a larger one need not
react."""
CUT_IN_LATERAL_M = 0.3
"""Smallest lateral gap before a cut-in, m. Ours: less is lost in the noise of recorded positions."""
CUT_IN_INSIDE_M = 1.0
"""Largest distance of the other's centre from the ego's way after a cut-in, m. Ours: more than the usual wander in a
lane (0.3 m), less than the 1.75 m at which a car is half in the next lane."""
CUT_IN_LASTS_S = 4.0
"""Longest time from the gap to the middle of the way, s. Ours: lane changes on motorways take 3 s to 8 s, and the part
from the lane marking to the middle about half of that."""
SAME_WAY_RAD = math.radians(30)
"""Largest difference of headings of actors that drive in one direction, rad. Ours: a lane change turns by less than 10
degrees, also slow ones in towns."""
MOVES_MPS = 2.0
"""Smallest speed of both actors of a cut-in, m/s. Ours: slower ones are parking or inching in a queue."""
SWERVE_S, SWERVE_M = 3.0, 20.0
"""Length of a path before and after the place of a cut-in in which a lane change is looked for: in s at the ego's
speed, and the least in m. Ours: half the time of a slow lane change."""
_LONGEST_M = 30.0
"""Length by which the centres of two actors may be farther apart than their footprints, m. Ours: two road trains."""
_BESIDE_M, _BEND = 6.0, 0.4
"""Farthest that an actor that may cut in is to the side of the ego's heading, m, and more per metre ahead. Ours: the
next lane's far side; 40 m ahead on a bend with a radius of 50 m, the road is 16 m to the side."""
_FEWEST = 5
"""Fewest points of a path to which an arc is fitted."""
BEYOND_TRACK_M = 30.0
"""Farthest place beyond the end of the ego's track that counts as on its way, m. Ours: a way's straight continuation is
wrong farther ahead in bends."""
TURN_RAD = math.radians(50)
"""Smallest change of heading of a turn, rad. Ours: bends of roads turn by less over the length of a junction."""
STRAIGHT_RAD = math.radians(25)
"""Largest change of heading of an actor that goes straight on, rad. Ours."""
ONCOMING_RAD = math.radians(135)
"""Smallest difference of headings of oncoming actors before the turn, rad. Ours: within 45 degrees of opposite."""
LOW_PET_S = 1.5
"""Post-encroachment time of a conflict, s. Ours: as the bound of the time to collision."""
NEAR_MISS_PET_S = 1.0
"""Post-encroachment time of a near miss, s. Ours."""


def cut_ins(traffic: Traffic, within_m: float) -> Iterator[Occurrence]:
    """Yield cut-ins: an actor comes from the side onto the ego's way, close ahead of it."""
    for rows in rows_of(traffic, (EGO, "other"), within_m):
        near = rows.at(_may_be_ahead(rows))
        if not len(near):
            continue
        beside = PairOnWay(near, EGO, "other")
        inside = beside.lateral <= 0.0
        entered = inside[1:] & ~inside[:-1] & (np.diff(near.frames) == 1) & (np.diff(near.group) == 0)
        done: set[int] = set()
        for k in (np.flatnonzero(entered) + 1).tolist():
            group = int(near.group[k])
            if group not in done and (occurrence := _cut_in(near, beside, k)) is not None:
                done.add(group)
                yield occurrence


def _may_be_ahead(rows: Rows) -> Flags:
    """Return at which rows both actors move in one direction, with a distance of a cut-in or less."""
    turned = column(rows, "other", HEADING) - column(rows, EGO, HEADING)
    speed = column(rows, EGO, SPEED)
    reach_m = speed * CUT_IN_HEADWAY_S + _LONGEST_M
    away = rows.traffic.states[rows.states["other"], :2] - rows.traffic.states[rows.states[EGO], :2]
    cos, sin = np.cos(column(rows, EGO, HEADING)), np.sin(column(rows, EGO, HEADING))
    ahead, left = away[:, 0] * cos + away[:, 1] * sin, away[:, 1] * cos - away[:, 0] * sin
    may_be: Flags = (
        (speed > MOVES_MPS)
        & (column(rows, "other", SPEED) > MOVES_MPS)
        & (np.cos(turned) > math.cos(SAME_WAY_RAD))
        & (ahead > 0.0)
        & (ahead < reach_m)
        & (np.abs(left) < _BESIDE_M + _BEND * ahead)
    )
    return may_be


def _cut_in(rows: Rows, beside: PairOnWay, k: int) -> Occurrence | None:
    """Return the cut-in that begins to overlap the ego's way at row k; None if it is none."""
    traffic, frames = rows.traffic, rows.frames
    ego, other = int(rows.actors[EGO][k]), int(rows.actors["other"][k])
    ahead_m, speed = float(beside.gap_ahead[k]), float(column(rows, EGO, SPEED)[k])
    way = traffic.way(ego)
    beyond_m = way.own_s[rows.states[EGO][k] - traffic.start[ego]] + ahead_m - way.own_s[-1]
    if not 0.0 < ahead_m <= CUT_IN_HEADWAY_S * speed or beyond_m > BEYOND_TRACK_M:
        return None
    if traffic.tracks[other].kind in ("pedestrian", "obstacle"):
        return None
    longest = round(CUT_IN_LASTS_S / STEP_S)
    here = rows.group == rows.group[k]
    low = max(k - longest, int(np.argmax(here)))
    high = min(k + longest, len(here) - int(np.argmax(here[::-1])))
    clear = np.flatnonzero(beside.lateral[low:k] >= CUT_IN_LATERAL_M)
    within = np.flatnonzero(np.abs(beside.left[k:high]) <= CUT_IN_INSIDE_M)
    if not len(clear) or not len(within) or (beside.lateral[k : k + int(within[0])] > 0.0).any():
        return None
    place = traffic.states[rows.states["other"][k], :2]
    if swerve_m(traffic, other, place, speed) <= swerve_m(traffic, ego, place, speed):
        return None  # the ego itself changes to the lane of the other
    return Occurrence(
        ego,
        (other,),
        int(frames[low + clear[-1]]),
        int(frames[k + int(within[0])]),
        int(frames[k]),
        {"gap_m": ahead_m, "headway_s": ahead_m / speed},
        f"{{0}} cuts in {ahead_m:.1f} m before {{ego}}, {ahead_m / speed:.2f} s ahead",
    )


def swerve_m(traffic: Traffic, actor: int, place: FloatArray, speed_mps: float) -> float:
    """Return how far an actor's path around a place is from an arc, m (root of the mean square): a lane change is not
    an arc, a bend of the road nearly is.

    Args:
        traffic: the recording. actor: number of the actor. place: [2] m. speed_mps: determines the length of the path.
    """
    xy = traffic.part(actor)[:, [X, Y]]
    away = np.hypot(*(xy - place).T)
    reach_m = max(SWERVE_S * speed_mps, SWERVE_M)
    near = xy[away <= reach_m]
    if len(near) < _FEWEST:
        return 0.0
    ahead = near[-1] - near[0]
    ahead = ahead / max(float(np.hypot(*ahead)), 1e-6)
    along, left = (near - place) @ ahead, (near - place) @ np.array([-ahead[1], ahead[0]])
    if np.ptp(along) < SWERVE_M / 2:
        return 0.0
    fit = np.polynomial.Polynomial.fit(along, left, 2)
    return float(np.sqrt(np.mean((left - fit(along)) ** 2)))


def low_pets(traffic: Traffic, within_m: float) -> Iterator[Occurrence]:
    """Yield pairs that pass a place shortly after each other in different directions; the ego is the second one."""
    del within_m  # crossings are found at any distance
    yield from _passings(traffic, LOW_PET_S)


def nearly_touching(traffic: Traffic, within_m: float) -> Iterator[Occurrence]:
    """Yield pairs as `low_pets` does, with two thirds of its time between them."""
    del within_m
    yield from _passings(traffic, NEAR_MISS_PET_S)


def _passings(traffic: Traffic, longest_s: float) -> Iterator[Occurrence]:
    for crossing in crossings(traffic, longest_s):
        for ego, other in ((crossing.second, crossing.first), (crossing.first, crossing.second)):
            if traffic.tracks[ego].kind in EGO_KINDS:
                yield _passing(crossing, ego, other, "{0}" if ego == crossing.second else "{ego}")
                break


def _passing(crossing: Crossing, ego: int, other: int, first: str) -> Occurrence:
    """Return a crossing as an occurrence; `first`: the actor that passes first, for the sentence."""
    second = "{ego}" if first == "{0}" else "{0}"
    return Occurrence(
        ego,
        (other,),
        min(crossing.leaves, crossing.reaches),
        max(crossing.leaves, crossing.reaches),
        crossing.reaches,
        {"pet_s": crossing.pet_s},
        f"{second} reaches a place {crossing.pet_s:.2f} s after {first} has left it",
    )


def crossing_pedestrians(traffic: Traffic, within_m: float) -> Iterator[Occurrence]:
    """Yield pedestrians who cross the ego's way at most 5 s before or after it passes."""
    del within_m
    for crossing in crossings(traffic, HORIZON_S):
        for ego, other in ((crossing.first, crossing.second), (crossing.second, crossing.first)):
            if traffic.tracks[ego].kind in EGO_KINDS and traffic.tracks[other].kind == "pedestrian":
                before = other == crossing.first
                when = f"{crossing.pet_s:.2f} s {'before' if before else 'after'}"
                moment = crossing.leaves if before else crossing.reaches
                yield Occurrence(
                    ego,
                    (other,),
                    min(crossing.leaves, crossing.reaches),
                    max(crossing.leaves, crossing.reaches),
                    moment,
                    {"pet_s": crossing.pet_s},
                    f"{{0}} crosses the way of {{ego}} {when} it passes",
                )


def unprotected_lefts(traffic: Traffic, within_m: float) -> Iterator[Occurrence]:
    """Yield egos that turn left across the way of an oncoming vehicle, at most 5 s before or after it passes."""
    del within_m
    for crossing in crossings(traffic, HORIZON_S):
        for ego, other in ((crossing.first, crossing.second), (crossing.second, crossing.first)):
            frame = crossing.leaves if ego == crossing.first else crossing.reaches
            passes = crossing.reaches if ego == crossing.first else crossing.leaves
            if traffic.tracks[ego].kind not in EGO_KINDS or traffic.tracks[other].kind in ("pedestrian", "obstacle"):
                continue
            turn = turned_rad(traffic, ego, frame)
            if turn < TURN_RAD or abs(turned_rad(traffic, other, passes)) > STRAIGHT_RAD:
                continue
            before = _heading_before(traffic, ego, frame)
            against = math.remainder(_heading_before(traffic, other, passes) - before, math.tau)
            if abs(against) < ONCOMING_RAD:
                continue
            when = f"{crossing.pet_s:.2f} s {'before' if ego == crossing.first else 'after'}"
            yield Occurrence(
                ego,
                (other,),
                min(frame, passes),
                max(frame, passes),
                frame,
                {"pet_s": crossing.pet_s, "turn_deg": math.degrees(turn)},
                f"{{ego}} turns left across the way of {{0}}, {when} it passes",
            )


def turned_rad(traffic: Traffic, actor: int, frame: int) -> float:
    """Return by how much an actor turns around a frame, rad, left positive."""
    return _heading_after(traffic, actor, frame) - _heading_before(traffic, actor, frame)


def _heading_before(traffic: Traffic, actor: int, frame: int) -> float:
    return _heading_of_way(traffic, actor, frame, -1)


def _heading_after(traffic: Traffic, actor: int, frame: int) -> float:
    return _heading_of_way(traffic, actor, frame, 1)


TURN_M = 25.0
"""Length of the way before and after a place over which a turn is measured, m. Ours: a left turn at a junction of two
lanes each way is 20 m to 40 m long."""


def _heading_of_way(traffic: Traffic, actor: int, frame: int, sign: int) -> float:
    """Return the heading of an actor's way some metres before or after its place at a frame, rad, continuous."""
    way = traffic.way(actor)
    s = float(way.own_s[frame - traffic.first[actor]]) + sign * TURN_M
    return float(np.interp(s, way.along, way.heading))
