"""The rows of the object list, compiled (`foresee_dsl.kernels.compiling` says what that asks for).

Sight, what is missed, and errors: one call a scan. Between two scans SUMO has thrown everything out of the processor's
caches, so that a call costs more than what is reckoned in it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import types
from numpy.typing import NDArray

from foresee_dsl.kernels.compiling import FLOAT, FLOATS, INT, TABLE, compiled, inner
from foresee_dsl.kernels.noise import chance, error
from foresee_dsl.kernels.sight import BOX_X, BOX_Y, GAP, WHO, find

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Hashes = NDArray[np.uint64]

_KEY_TABLE = types.uint64[:, ::1]

HEADING, SPEED = range(2, 4)
"""Columns of states."""
LENGTH, WIDTH = range(2)
RANGE, HEADING_SD = range(5, 7)
"""Columns of bodies; those before the last one are the columns of `kernels.sight`."""
(
    RADIAL_M,
    RADIAL_SHARE,
    LATERAL_M,
    LATERAL_RAD,
    SPEED_MPS,
    SPEED_SHARE,
    SPEED_MOST_MPS,
    SIZE_SHARE,
    LEAST_SIZE,
    SLOW_FRAMES,
    MISSED_LEAST,
    MISSED_MOST,
    MISSED_STEEPNESS,
    MISSED_FRAMES,
) = range(3, 17)
"""Places of numbers, which begin with the limits of `kernels.sight`: those of `settings.ObjectNoise` and
`settings.Dropouts`."""
CHANNELS = 6
"""Errors of an object: along and across the line of sight, heading, speed, length, width."""


@inner
def _kept(frame: int, boxes: FloatArray, seen: IntArray, bodies: FloatArray, keys: Hashes, numbers: FloatArray) -> int:
    """Put those that are not missed in front in `seen`, the nearest first (the earlier first where equal).

    Returns:
        How many they are.
    """
    least, most, hold = numbers[MISSED_LEAST], numbers[MISSED_MOST], int(numbers[MISSED_FRAMES])
    count = 0
    for place in range(len(seen)):
        row = seen[place]
        gap, who = boxes[row, GAP], int(boxes[row, WHO])
        if least > 0.0 or most > 0.0:
            missed = least + most * (gap / bodies[who, RANGE]) ** numbers[MISSED_STEEPNESS]
            if chance(keys[who], CHANNELS, frame, hold) < missed:
                continue
        at = count
        while at > 0 and boxes[seen[at - 1], GAP] > gap:
            seen[at] = seen[at - 1]
            at -= 1
        seen[at] = row
        count += 1
    return count


@compiled(INT, FLOAT, FLOAT, FLOAT, FLOAT, FLOAT, FLOAT, TABLE, TABLE, TABLE, _KEY_TABLE, TABLE, FLOATS)
def measured(
    frame: int,
    ego_x: float,
    ego_y: float,
    ego_heading: float,
    x: float,
    y: float,
    taken_heading: float,
    states: FloatArray,
    bodies: FloatArray,
    walls: FloatArray,
    keys: Hashes,
    scales: FloatArray,
    numbers: FloatArray,
) -> FloatArray:
    """Measure those in sight.

    Args:
        frame: absolute. ego_x, ego_y, ego_heading: where the ego is. x, y, taken_heading: where it takes itself to be.
        states: [N, >=4] NaN where there is none. bodies: [N, 7]. walls: [M, 4] the near ones.
        keys, scales: as in `noise.normals_over`, of six channels. numbers: [17].

    Returns:
        [S, 7] x, y, heading, speed, length, width with errors, and the object's number, the nearest first.
    """
    boxes, seen = find(ego_x, ego_y, ego_heading, states, bodies, walls, numbers)
    count = _kept(frame, boxes, seen, bodies, keys, numbers)
    rows, errors = np.empty((count, 7)), np.empty(CHANNELS)
    turned = taken_heading - ego_heading
    cos, sin = math.cos(turned), math.sin(turned)
    slow_frames = int(numbers[SLOW_FRAMES])
    for place in range(count):
        box, row = boxes[seen[place]], rows[place]
        dx, dy, gap, k = box[BOX_X], box[BOX_Y], box[GAP], int(box[WHO])
        for channel in range(CHANNELS):
            errors[channel] = error(keys[k], scales, channel, frame, slow_frames)
        # Radial and lateral errors as shares of the distance, so that they turn with the line of sight.
        per_m = 1.0 / max(gap, 1.0)
        radial = errors[0] * (numbers[RADIAL_M] + numbers[RADIAL_SHARE] * gap) * per_m
        lateral = errors[1] * (numbers[LATERAL_M] + numbers[LATERAL_RAD] * gap) * per_m
        mx, my = dx + radial * dx - lateral * dy, dy + radial * dy + lateral * dx
        heading = states[k, HEADING] + errors[2] * bodies[k, HEADING_SD] + turned
        speed = states[k, SPEED]
        spread = min(numbers[SPEED_MPS] + numbers[SPEED_SHARE] * speed, numbers[SPEED_MOST_MPS])
        row[0], row[1] = x + mx * cos - my * sin, y + mx * sin + my * cos
        row[2] = heading - math.tau * np.rint(heading / math.tau)
        row[3] = max(speed + errors[3] * spread, 0.0)
        row[4] = bodies[k, LENGTH] * max(1.0 + numbers[SIZE_SHARE] * errors[4], numbers[LEAST_SIZE])
        row[5] = bodies[k, WIDTH] * max(1.0 + numbers[SIZE_SHARE] * errors[5], numbers[LEAST_SIZE])
        row[6] = k
    return rows
