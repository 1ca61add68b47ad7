"""Places at which the paths of two recorded actors cross, and the time between their passing (PET)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from foresee_dsl.kernels.boxes import box_overlap
from foresee_dsl.simulate.results.footprints import HORIZON_S
from foresee_dsl.simulate.results.near_misses import CROSSING_RAD
from foresee_dsl.simulate.trace import STEP_S
from foresee_recordings.mining.rows import neighbours
from foresee_recordings.mining.traffic import HEADING, SPEED, IntArray, Traffic, X, Y, spaced

REACH_M = 60.0
"""Pairs of actors that never come nearer to each other than this are not compared, m. Ours: with a PET of 5 s, actors
in towns are at most 50 m apart when the first one passes."""
_WITHIN_S = 2 * HORIZON_S
"""Actors whose centres pass a place farther apart in time are not compared more exactly, s. Ours: a slow actor may
occupy the place for some seconds."""
_ABOUT_M = 12.0
"""Part of a path around a crossing place in which footprints are compared, m. Ours: half a bus and half a car."""


@dataclass(frozen=True)
class Crossing:
    """Two actors whose paths cross in different directions.

    Attributes:
        first, second: numbers of the actors, in the order in which they pass. leaves, reaches: the frames between which
            the place is free: the first actor's last one and the second's first one; at a contact they are equal.
        pet_s: time between them, s.
        place: where the paths cross, m.
    """

    first: int
    second: int
    leaves: int
    reaches: int
    pet_s: float
    place: tuple[float, float]


def crossings(traffic: Traffic, longest_s: float = HORIZON_S) -> Iterator[Crossing]:
    """Yield the crossings of each pair of actors with a PET of at most `longest_s`."""
    near = neighbours(traffic, REACH_M)
    paths: dict[int, tuple[IntArray, shapely.LineString | None]] = {}
    for a in sorted(near):
        for b in sorted(near[a]):
            if b <= a:
                continue
            for actor in (a, b):
                if actor not in paths:
                    paths[actor] = _path(traffic, actor)
            (at_a, line_a), (at_b, line_b) = paths[a], paths[b]
            if line_a is None or line_b is None or not shapely.intersects(line_a, line_b):
                continue
            meeting = shapely.intersection(line_a, line_b)
            for x, y in shapely.get_coordinates(meeting)[:_MOST_PLACES].tolist():
                crossing = _crossing(traffic, (a, at_a), (b, at_b), (x, y), longest_s)
                if crossing is not None:
                    yield crossing
                    break


_MOST_PLACES = 8
"""Largest number of places at which two paths are compared. Ours: paths that run over each other cross at any number of
places, all with one direction."""


def _path(traffic: Traffic, actor: int) -> tuple[IntArray, shapely.LineString | None]:
    """Return the frames of an actor's path at points a metre apart, and the path; None for one that stands."""
    xy = traffic.part(actor)[:, [X, Y]]
    at = spaced(xy)
    return traffic.first[actor] + at, shapely.LineString(xy[at]) if len(at) > 1 else None


def _crossing(
    traffic: Traffic,
    a: tuple[int, IntArray],
    b: tuple[int, IntArray],
    place: tuple[float, float],
    longest_s: float,
) -> Crossing | None:
    frames = []
    for actor, at in (a, b):
        states = traffic.states[traffic.rows(actor, at)]
        away = np.hypot(states[:, X] - place[0], states[:, Y] - place[1])
        frames.append(int(at[away.argmin()]))
    if abs(frames[0] - frames[1]) * STEP_S > _WITHIN_S:
        return None
    if _heading(traffic, a[0], frames[0], b[0], frames[1]) < CROSSING_RAD:
        return None
    mine, theirs = (_about(traffic, actor, frame, place) for (actor, _), frame in zip((a, b), frames, strict=True))
    pair_a, pair_b = np.repeat(mine, len(theirs)), np.tile(theirs, len(mine))
    row_a, row_b = traffic.rows(a[0], pair_a), traffic.rows(b[0], pair_b)
    turned = traffic.states[row_a, HEADING] - traffic.states[row_b, HEADING]
    hit = box_overlap(traffic.boxes(row_a), traffic.boxes(row_b)) & (np.cos(turned) <= math.cos(CROSSING_RAD))
    if not hit.any():
        return None
    pair_a, pair_b = pair_a[hit], pair_b[hit]
    k = int(np.abs(pair_a - pair_b).argmin())
    pet_s = abs(int(pair_a[k] - pair_b[k])) * STEP_S
    if pet_s > longest_s:
        return None
    if frames[0] <= frames[1]:
        return Crossing(a[0], b[0], int(pair_a[k]), int(pair_b[k]), pet_s, place)
    return Crossing(b[0], a[0], int(pair_b[k]), int(pair_a[k]), pet_s, place)


def _heading(traffic: Traffic, a: int, frame_a: int, b: int, frame_b: int) -> float:
    """Return the angle between two actors' headings at a frame each, rad, from 0 to pi."""
    headings = [
        traffic.states[traffic.rows(actor, np.array([frame])), HEADING][0]
        for actor, frame in ((a, frame_a), (b, frame_b))
    ]
    return abs(math.remainder(headings[0] - headings[1], math.tau))


def _about(traffic: Traffic, actor: int, frame: int, place: tuple[float, float]) -> IntArray:
    """Return the frames around one at which an actor is near a place; of a stand only its ends, as others do not
    matter."""
    states = traffic.part(actor)
    near = np.hypot(states[:, X] - place[0], states[:, Y] - place[1]) <= _ABOUT_M
    at = int(frame - traffic.first[actor])
    before = np.flatnonzero(~near[:at])
    after = np.flatnonzero(~near[at:])
    low = int(before[-1]) + 1 if len(before) else 0
    high = at + int(after[0]) if len(after) else len(states)
    chosen = np.arange(low, max(high, low + 1))
    stands = states[chosen, SPEED] < _RECORDED_STANDS_MPS
    inner = np.zeros(len(chosen), dtype=np.bool_)
    inner[1:-1] = stands[1:-1] & stands[:-2] & stands[2:]
    frames: IntArray = chosen[~inner] + traffic.first[actor]
    return frames


_RECORDED_STANDS_MPS = 0.05
"""Speed below which a recorded actor stands, m/s. Ours: in a second it moves by 5 cm."""
