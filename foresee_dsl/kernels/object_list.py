"""The rows of the object list, as a kernel (see `kernels.compiling`): sight, misses and errors in one call per scan.

Everything is computed in one call because SUMO evicts our data from the processor's caches between two scans, so that a
call costs more than its computation.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, Hashes, IntArray, Record, Records
from foresee_dsl.kernels.compiling import INT, KEY_TABLE, TABLE, compiled, inner
from foresee_dsl.kernels.noise import chance, error
from foresee_dsl.kernels.records import array_of
from foresee_dsl.kernels.sight import BODIES, HEADING, SPEED, WALLS, SightLimits, X, Y, find


class ScanSettings(NamedTuple):
    """The sensor settings for a scan: `SightLimits`, then `ObjectNoise` and `Dropouts` of `simulate.sensing.settings`,
    with times in frames.

    Attributes:
        least_size: smallest measured length or width, as a share of the true one.
    """

    reach: float
    ahead_share: float
    least_marks: float
    radial_m: float
    radial_share: float
    lateral_m: float
    lateral_rad: float
    speed_mps: float
    speed_share: float
    speed_most_mps: float
    size_share: float
    least_size: float
    slow_frames: int
    missed_least: float
    missed_most: float
    missed_steepness: float
    missed_frames: int


SETTINGS = array_of(ScanSettings)
CHANNELS = 6
"""Number of errors of an object: along and across the line of sight, heading, speed, length, width."""


@inner
def _detected(frame: int, boxes: Records, seen: IntArray, bodies: Records, keys: Hashes, settings: Record) -> int:
    """Move the detected objects to the front of `seen`, the nearest first; return their number.

    Of equally near objects the one that came first stays first.
    """
    least, most, hold = settings["missed_least"], settings["missed_most"], settings["missed_frames"]
    count = 0
    for place in range(len(seen)):
        row = seen[place]
        gap, who = boxes[row]["gap"], boxes[row]["who"]
        if least > 0.0 or most > 0.0:
            missed = least + most * (gap / bodies[who]["range"]) ** settings["missed_steepness"]
            if chance(keys[who], CHANNELS, frame, hold) < missed:
                continue
        at = count
        while at > 0 and boxes[seen[at - 1]]["gap"] > gap:
            seen[at] = seen[at - 1]
            at -= 1
        seen[at] = row
        count += 1
    return count


@compiled(INT, TABLE, TABLE, BODIES, WALLS, KEY_TABLE, TABLE, SETTINGS)
def measured(
    frame: int,
    ego: FloatArray,
    states: FloatArray,
    bodies: Records,
    walls: Records,
    keys: Hashes,
    scales: FloatArray,
    settings_of: Records,
) -> FloatArray:
    """Measure the objects in sight.

    Args:
        frame: absolute frame. ego: [2, 3] x, y, heading: the ego's true pose, then the pose of its localisation.
        states: [N, >=4] x, y, heading, speed, NaN where absent. bodies: [N]. walls: [M] the near walls.
        keys, scales: as for `noise.normals_over`, with six channels. settings_of: [1].

    Returns:
        [S, 7] x, y, heading, speed, length, width with errors, and the object's index; the nearest object first.
    """
    settings = settings_of[0]
    # A named tuple is passed, because numba 0.68.1 would treat one record as a part of the other, and would warn that
    # this is experimental.
    limits = SightLimits(settings["reach"], settings["ahead_share"], settings["least_marks"])
    boxes, seen = find(ego[0, X], ego[0, Y], ego[0, HEADING], states, bodies, walls, limits)
    count = _detected(frame, boxes, seen, bodies, keys, settings)
    rows, errors = np.empty((count, 7)), np.empty(CHANNELS)
    x, y = ego[1, X], ego[1, Y]
    turned = ego[1, HEADING] - ego[0, HEADING]
    cos, sin = math.cos(turned), math.sin(turned)
    slow_frames = settings["slow_frames"]
    for place in range(count):
        box, row = boxes[seen[place]], rows[place]
        dx, dy, gap, k = box["x"], box["y"], box["gap"], box["who"]
        for channel in range(CHANNELS):
            errors[channel] = error(keys[k], scales, channel, frame, slow_frames)
        # Radial and lateral errors as shares of the distance, so that they turn with the line of sight.
        per_m = 1.0 / max(gap, 1.0)
        radial = errors[0] * (settings["radial_m"] + settings["radial_share"] * gap) * per_m
        lateral = errors[1] * (settings["lateral_m"] + settings["lateral_rad"] * gap) * per_m
        mx, my = dx + radial * dx - lateral * dy, dy + radial * dy + lateral * dx
        heading = states[k, HEADING] + errors[2] * bodies[k]["heading_spread"] + turned
        speed = states[k, SPEED]
        spread = min(settings["speed_mps"] + settings["speed_share"] * speed, settings["speed_most_mps"])
        row[0], row[1] = x + mx * cos - my * sin, y + mx * sin + my * cos
        row[2] = heading - math.tau * np.rint(heading / math.tau)
        row[3] = max(speed + errors[3] * spread, 0.0)
        row[4] = bodies[k]["length"] * max(1.0 + settings["size_share"] * errors[4], settings["least_size"])
        row[5] = bodies[k]["width"] * max(1.0 + settings["size_share"] * errors[5], settings["least_size"])
        row[6] = k
    return rows
