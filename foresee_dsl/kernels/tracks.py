"""The tracker's loops: they advance states along arcs, correct them by measurements, and predict the present."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, IntArray, Records
from foresee_dsl.kernels.compiling import FLAG, FLOAT, HYPERCUBE, INTS, TABLE, compiled
from foresee_dsl.kernels.records import array_of, dtype_of

DOUBT_MPS = 0.2
"""Speed with which each side of a moving object grows while it is not seen, m/s. Ours: in 1.5 s it grows by the
distance that a constant acceleration of 0.3 m/s^2 adds."""
SMOOTHED_STANDS_MPS = 0.25
"""Smoothed speed below which an object stands, m/s. Ours: more than three times the noise of a smoothed speed."""
SPEED_NOISE_MPS = 0.15
HEADING_NOISE_RAD = math.radians(2.0)
WALKER_HEADING_NOISE_RAD = math.radians(10.0)
PLACE_NOISE_M = 0.1
PLACE_NOISE_PER_M = 0.003
"""Standard deviations that the filters assume for measured speeds, for the headings of vehicles and of walkers, and for
places (a constant, and a part for each metre of distance). They are about those of the standard sensors
(`simulate/sensing`)."""
JUMP = 6.0
"""Difference between a measurement and the prediction, in standard deviations, above which an object's filter starts
again. Ours: the prediction itself has a noise of up to two, so that noise alone rarely reaches this value."""

X, Y, HEADING, SPEED, LENGTH, WIDTH, ACCELERATION, YAW_RATE = range(8)
"""Columns of the filters' states, [A, 8]; the first six are measured."""
MEASURED = 6
DRIVES, STANDS, WALKS = range(3)
"""Modes of motion, each with its own gains."""
OTHER, BICYCLE, PEDESTRIAN, OBSTACLE = range(4)
"""Classes of objects that kernels distinguish (`TrackedObject.kind`)."""
SETTLED = 60
"""Number of measurements after which the gains stay constant; 3 s."""
BIN_M = 20.0
BINS = 5
PLACE_NOISES_M = PLACE_NOISE_M + PLACE_NOISE_PER_M * BIN_M * (np.arange(BINS) + 0.5)
"""[bins] standard deviations of positions, by distance."""
_JUMPS = JUMP * np.array(
    [
        [PLACE_NOISES_M] * 3,
        [PLACE_NOISES_M] * 3,
        [[noise] * BINS for noise in (HEADING_NOISE_RAD, HEADING_NOISE_RAD, WALKER_HEADING_NOISE_RAD)],
        [[SPEED_NOISE_MPS] * BINS] * 3,
    ]
)
"""[4, mode, bins] differences of x, y, heading and speed above which an object's filter starts again."""


class TrackedObject(NamedTuple):
    """The current state of an object: m, rad, m/s; the speed is along its heading and never negative.

    Attributes:
        length, width: enlarged while it is not seen. lost_s: time since it was last seen, s. kind: `OTHER` etc.
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


class SightingRecord(NamedTuple):
    """The measurements of an object: their number, the time of the last one (s), its class."""

    times: int
    last_s: float
    kind: int


class Scan(NamedTuple):
    """An object list: when it was measured, and how far the filters must advance.

    It has the ego's position (m), the time of measurement, the time since the previous list, the current time (s), and
    the share that objects which were not measured keep of their acceleration and yaw rate.
    """

    ego_x: float
    ego_y: float
    measured_s: float
    passed_s: float
    time_s: float
    fades: float


TRACK, SIGHTING, SCAN = dtype_of(TrackedObject), dtype_of(SightingRecord), dtype_of(Scan)
TRACKS, _SIGHTINGS, _SCANS = array_of(TrackedObject), array_of(SightingRecord), array_of(Scan)


@compiled(TABLE, FLOAT)
def move(state: FloatArray, dt: float) -> None:
    """Advance all states, [A, 8], by `dt` along their arcs, in place; an object that brakes does not reverse."""
    for a in range(len(state)):
        speed, turned = state[a, SPEED], state[a, YAW_RATE] * dt
        after = max(speed + state[a, ACCELERATION] * dt, 0.0)
        # A measured speed is never negative, so its noise would make standing objects drift forwards.
        distance = 0.0 if speed < SMOOTHED_STANDS_MPS else (speed + after) * (dt / 2)
        middle = state[a, HEADING] + turned / 2
        state[a, X] += distance * math.cos(middle)
        state[a, Y] += distance * math.sin(middle)
        state[a, HEADING] += turned
        state[a, SPEED] = after


@compiled(TABLE, _SIGHTINGS, FLOAT, FLOAT, FLAG)
def present(state: FloatArray, sightings: Records, time_s: float, measured_s: float, some_lost: bool) -> Records:
    """Return the tracks [A] of a state [A, 8] at `measured_s`, predicted to `time_s`.

    Lost objects are enlarged, and standing objects have the speed 0. `some_lost`: whether an object is missing in the
    last object list.
    """
    tracks = np.empty(len(state), TRACK)
    if time_s > measured_s:
        state = state.copy()
        move(state, time_s - measured_s)
    for a in range(len(state)):
        track, last_s = tracks[a], sightings[a]["last_s"]
        track["x"], track["y"] = state[a, X], state[a, Y]
        track["heading"], track["speed"] = state[a, HEADING], state[a, SPEED]
        track["length"], track["width"] = state[a, LENGTH], state[a, WIDTH]
        track["acceleration"], track["yaw_rate"] = state[a, ACCELERATION], state[a, YAW_RATE]
        lost_s = time_s - last_s if some_lost and last_s < measured_s else 0.0
        track["lost_s"], track["kind"] = lost_s, sightings[a]["kind"]
        if track["speed"] < SMOOTHED_STANDS_MPS:
            track["speed"], track["acceleration"] = 0.0, 0.0
        else:
            track["length"] += 2 * DOUBT_MPS * lost_s
            track["width"] += 2 * DOUBT_MPS * lost_s
    return tracks


@compiled(TABLE, _SIGHTINGS, _SCANS)
def fade(state: FloatArray, sightings: Records, scans: Records) -> float:
    """Reduce the acceleration and yaw rate of objects that are missing in the object list [1], in place.

    Return the longest time since an object was seen, s.
    """
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
    """Correct states, [A, 8], by their measurements, in place.

    `which`: [N] indices of the measured actors. `measured`: [N, >=6]. `scans`: [1] the object list. `gains`: [mode,
    bins, number of measurements, 8].
    """
    scan, off = scans[0], np.empty(8)
    for n in range(len(which)):
        row, seen = state[which[n]], sightings[which[n]]
        for column in range(MEASURED):
            off[column] = measured[n, column] - row[column]
        off[HEADING] = (off[HEADING] + math.pi) % (2 * math.pi) - math.pi
        off[ACCELERATION], off[YAW_RATE] = off[SPEED], off[HEADING]
        # After missing measurements a filter is less certain, so it continues as if it had fewer measurements.
        missed = int(np.rint((scan["measured_s"] - seen["last_s"]) * (1 / scan["passed_s"]))) - 1
        count = max(seen["times"] - 2 * max(missed, 0), 1)
        seen["last_s"] = scan["measured_s"]
        away = math.hypot(measured[n, X] - scan["ego_x"], measured[n, Y] - scan["ego_y"])
        place = max(min(int(away * (1 / BIN_M)), BINS - 1), 0)
        mode = WALKS if seen["kind"] == PEDESTRIAN else STANDS if row[SPEED] < SMOOTHED_STANDS_MPS else DRIVES
        for column in range(SPEED + 1):
            if abs(off[column]) > _JUMPS[column, mode, place]:
                count = 0
        for column in range(8):
            row[column] += gains[mode, place, count, column] * off[column]
        row[SPEED] = max(row[SPEED], 0.0)
        if count == 0:
            row[ACCELERATION] = 0.0
        if count == 0 or mode != DRIVES:
            row[YAW_RATE] = 0.0
        seen["times"] = min(count + 1, SETTLED - 1)


@compiled(TABLE, _SIGHTINGS, INTS, TABLE, _SCANS, HYPERCUBE)
def follow(
    state: FloatArray, sightings: Records, which: IntArray, measured: FloatArray, scans: Records, gains: FloatArray
) -> tuple[Records, float]:
    """Process an object list without new objects, in place: `move`, `correct`, and `fade` for missing objects.

    Return the tracks that are still present (as `present`), and the longest time since an object was seen, s. The
    arguments are those of `correct`.
    """
    scan = scans[0]
    move(state, scan["passed_s"])
    correct(state, sightings, which, measured, scans, gains)
    some_lost = len(which) < len(state)
    longest = fade(state, sightings, scans) if some_lost else 0.0
    return present(state, sightings, scan["time_s"], scan["measured_s"], some_lost), longest
