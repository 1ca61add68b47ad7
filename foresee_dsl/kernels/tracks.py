"""The tracker's loops: states moved on along their arcs, corrected by measurements, and read at the present."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, IntArray, Records
from foresee_dsl.kernels.compiling import FLAG, FLOAT, HYPERCUBE, INTS, TABLE, compiled
from foresee_dsl.kernels.records import array_of, dtype_of

DOUBT_MPS = 0.2
"""Ours: how fast each side of a moving object grows while it is not seen; in 1.5 s, what a constant acceleration of
0.3 m/s^2 adds to its distance."""
STANDS_MPS = 0.25
"""Ours: slower than this after smoothing counts as standing; over three times the noise of a smoothed speed."""
SPEED_NOISE_MPS = 0.15
HEADING_NOISE_RAD = math.radians(2.0)
WALKER_HEADING_NOISE_RAD = math.radians(10.0)
PLACE_NOISE_M = 0.1
PLACE_NOISE_PER_M = 0.003
"""Standard deviations that the filters assume, about those of the standard sensors (`simulate/sensing`)."""
JUMP = 6.0
"""Ours: the filter of an object starts again where a measurement is this many of its standard deviations off the
prediction, which has up to two of noise itself; noise alone hardly ever does that."""

X, Y, HEADING, SPEED, LENGTH, WIDTH, ACCELERATION, YAW_RATE = range(8)
"""Columns of the filters' states, [A, 8]; the first six are measured."""
MEASURED = 6
DRIVES, STANDS, WALKS = range(3)
"""Modes of motion, which have gains of their own."""
OTHER, BICYCLE, PEDESTRIAN, OBSTACLE = range(4)
"""Classes of objects that kernels distinguish (`Track.kind`)."""
SETTLED = 60
"""Gains have settled after so many measurements, 3 s."""
BIN_M = 20.0
BINS = 5
PLACE_NOISES_M = PLACE_NOISE_M + PLACE_NOISE_PER_M * BIN_M * (np.arange(BINS) + 0.5)
"""[bins] of positions, by distance."""
_JUMPS = JUMP * np.array(
    [
        [PLACE_NOISES_M] * 3,
        [PLACE_NOISES_M] * 3,
        [[noise] * BINS for noise in (HEADING_NOISE_RAD, HEADING_NOISE_RAD, WALKER_HEADING_NOISE_RAD)],
        [[SPEED_NOISE_MPS] * BINS] * 3,
    ]
)
"""[4, mode, bins] differences of x, y, heading and speed above which a filter starts again."""


class Track(NamedTuple):
    """An object at the present moment: m, rad, m/s; along its heading, the speed never negative.

    Attributes:
        length, width: grown by doubt where it is not seen. lost_s: how long it has not been seen. kind: `OTHER` etc.
    """

    x: float
    y: float
    heading: float
    speed: float
    length: float
    width: float
    acceleration: float
    yaw_rate: float
    lost_s: float
    kind: int


class Sighting(NamedTuple):
    """The measurements of an object: how many there were, when the last one was (s), its class."""

    times: int
    last_s: float
    kind: int


class Scan(NamedTuple):
    """An object list: where the ego was (m), when it was measured and how long after the one before (s), the present
    (s), and what is left of rates that were not measured."""

    ego_x: float
    ego_y: float
    measured_s: float
    passed_s: float
    time_s: float
    fades: float


TRACK, SIGHTING, SCAN = dtype_of(Track), dtype_of(Sighting), dtype_of(Scan)
TRACKS, _SIGHTINGS, _SCANS = array_of(Track), array_of(Sighting), array_of(Scan)


@compiled(TABLE, FLOAT)
def move(state: FloatArray, dt: float) -> None:
    """Move all states, [A, 8], on by `dt` along their arcs, in place; an object that brakes does not reverse."""
    for a in range(len(state)):
        speed, turned = state[a, SPEED], state[a, YAW_RATE] * dt
        after = max(speed + state[a, ACCELERATION] * dt, 0.0)
        # The noise of a speed that cannot be negative would make standing objects drift.
        distance = 0.0 if speed < STANDS_MPS else (speed + after) * (dt / 2)
        middle = state[a, HEADING] + turned / 2
        state[a, X] += distance * math.cos(middle)
        state[a, Y] += distance * math.sin(middle)
        state[a, HEADING] += turned
        state[a, SPEED] = after


@compiled(TABLE, _SIGHTINGS, FLOAT, FLOAT, FLAG)
def present(state: FloatArray, sightings: Records, time_s: float, measured_s: float, some_lost: bool) -> Records:
    """Return the tracks [A] of a state [A, 8] of `measured_s`, predicted to `time_s`: the lost ones have grown, the
    standing ones have no speed. `some_lost`: some objects were not in the last object list."""
    tracks = np.empty(len(state), TRACK)
    if time_s > measured_s:
        state = state.copy()
        move(state, time_s - measured_s)
    for a in range(len(state)):
        one, last_s = tracks[a], sightings[a]["last_s"]
        one["x"], one["y"], one["heading"], one["speed"] = state[a, X], state[a, Y], state[a, HEADING], state[a, SPEED]
        one["length"], one["width"] = state[a, LENGTH], state[a, WIDTH]
        one["acceleration"], one["yaw_rate"] = state[a, ACCELERATION], state[a, YAW_RATE]
        lost_s = time_s - last_s if some_lost and last_s < measured_s else 0.0
        one["lost_s"], one["kind"] = lost_s, sightings[a]["kind"]
        if one["speed"] < STANDS_MPS:
            one["speed"], one["acceleration"] = 0.0, 0.0
        else:
            one["length"] += 2 * DOUBT_MPS * lost_s
            one["width"] += 2 * DOUBT_MPS * lost_s
    return tracks


@compiled(TABLE, _SIGHTINGS, _SCANS)
def fade(state: FloatArray, sightings: Records, scans: Records) -> float:
    """Reduce acceleration and yaw rate of objects that are not in the object list [1], in place; return the longest
    time lost, s."""
    longest, measured_s = 0.0, scans[0]["measured_s"]
    for a in range(len(state)):
        last_s = sightings[a]["last_s"]
        if last_s < measured_s:
            state[a, ACCELERATION] *= scans[0]["fades"]
            state[a, YAW_RATE] *= scans[0]["fades"]
            longest = max(longest, measured_s - last_s)
    return longest


@compiled(TABLE, _SIGHTINGS, INTS, TABLE, _SCANS, HYPERCUBE)
def correct(
    state: FloatArray, sightings: Records, which: IntArray, measured: FloatArray, scans: Records, gains: FloatArray
) -> None:
    """Correct some states, [A, 8], by their measurements, in place.

    `which`: [N] the actors that were measured. `measured`: [N, >=6]. `scans`: [1] the object list. `gains`: [8, mode,
    bins, times].
    """
    scan, off = scans[0], np.empty(8)
    for n in range(len(which)):
        one, seen = state[which[n]], sightings[which[n]]
        for column in range(MEASURED):
            off[column] = measured[n, column] - one[column]
        off[HEADING] = (off[HEADING] + math.pi) % (2 * math.pi) - math.pi
        off[ACCELERATION], off[YAW_RATE] = off[SPEED], off[HEADING]
        # A filter without measurements for a while is less certain: it continues as one with fewer of them.
        missed = int(np.rint((scan["measured_s"] - seen["last_s"]) * (1 / scan["passed_s"]))) - 1
        count = max(seen["times"] - 2 * max(missed, 0), 1)
        seen["last_s"] = scan["measured_s"]
        away = math.hypot(measured[n, X] - scan["ego_x"], measured[n, Y] - scan["ego_y"])
        place = max(min(int(away * (1 / BIN_M)), BINS - 1), 0)
        mode = WALKS if seen["kind"] == PEDESTRIAN else STANDS if one[SPEED] < STANDS_MPS else DRIVES
        for column in range(SPEED + 1):
            if abs(off[column]) > _JUMPS[column, mode, place]:
                count = 0
        for column in range(8):
            one[column] += gains[column, mode, place, count] * off[column]
        one[SPEED] = max(one[SPEED], 0.0)
        if count == 0:
            one[ACCELERATION] = 0.0
        if count == 0 or mode != DRIVES:
            one[YAW_RATE] = 0.0
        seen["times"] = min(count + 1, SETTLED - 1)


@compiled(TABLE, _SIGHTINGS, INTS, TABLE, _SCANS, HYPERCUBE)
def follow(
    state: FloatArray, sightings: Records, which: IntArray, measured: FloatArray, scans: Records, gains: FloatArray
) -> tuple[Records, float]:
    """Take in an object list without new objects, in place: `move`, `correct`, and `fade` what is not in it; return the
    tracks `present`, and the longest time lost, s. Arguments as of `correct`."""
    scan = scans[0]
    move(state, scan["passed_s"])
    correct(state, sightings, which, measured, scans, gains)
    some_lost = len(which) < len(state)
    longest = fade(state, sightings, scans) if some_lost else 0.0
    return present(state, sightings, scan["time_s"], scan["measured_s"], some_lost), longest
