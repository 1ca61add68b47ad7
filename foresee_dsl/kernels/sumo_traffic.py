"""Kernels that move all vehicles that SUMO drives at once, and say how fast each may go (see `drivers.compiled`).

Vehicle k has a row in each table: `shape[k]` what it is, `memory[k]` what it remembers of the last step, `lane[k]` the
number of the lane that it is on in a `LaneTable` (-1 on none), and `rows[k]` its row of `StateTable.states`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.kernels.compiling import FLOAT, FLOATS, INTS, TABLE, compiled
from foresee_dsl.kernels.lines import along, heading_at, last_up_to

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

HALF, AXLE, WHEELBASE, STEER_MOST, LINE = range(5)
"""Columns of `shape`, m and rad: half its length; from the front bumper to the rear axle; wheelbase; largest angle of
the front wheels; how far to the left of its lane's middle it keeps."""
FRONT_X, FRONT_Y, RAW_X, RAW_Y, OFFSET, BESIDE_S, BENDS_S = range(7)
"""Columns of `memory`, m: its front; where SUMO has that; how far to the left of SUMO's it is drawn; how far along its
lane it was, the first for its heading, the second for its bends (NaN: not looked up yet)."""

SIDEWAYS_MPS = 1.0
"""How fast a lane change moves sideways. Ours: 3.3 m in 3.3 s, within the 3 s to 5 s that lane changes take."""
SIDEWAYS_SHARE = 0.25
"""And at most this share of the speed, about 14 deg: a vehicle that stands does not slide."""
JUMP_M = 0.5
"""A front that is this much further than its speed explains was moved by a lane change."""
SLOWEST_TURN_MPS = 0.5
"""Below this speed the steering angle is not read off the turning, which is noise then."""


@compiled(
    FLOATS, FLOATS, INTS, INTS, TABLE, TABLE, TABLE, INTS, INTS, FLOATS, FLOATS, FLOATS, FLOATS, FLOAT
)  # fmt: skip
def follow(
    places: FloatArray,
    speeds: FloatArray,
    who: IntArray,
    rows: IntArray,
    states: FloatArray,
    memory: FloatArray,
    shape: FloatArray,
    lane: IntArray,
    first: IntArray,
    xs: FloatArray,
    ys: FloatArray,
    marks: FloatArray,
    angles: FloatArray,
    dt: float,
) -> None:
    """Move bodies to where SUMO has their vehicles after a step.

    Args:
        places: [2 N] x, y of the middle of each front bumper, m. speeds: [N] m/s. who: [N] whose that is.
        rows, states, memory, shape, lane: see above; `states` and `memory` are changed.
        first, xs, ys, marks, angles: of the `LaneTable`.
        dt: s.
    """
    for n in range(who.size):
        k = who[n]
        state, known = states[rows[k]], memory[k]
        x, y, speed = places[2 * n], places[2 * n + 1], speeds[n]
        was, heading, line_m = state[3], state[2], shape[k, LINE]
        state[4] = (speed - was) / dt  # as SUMO works it out
        if (
            speed == 0.0
            and was == 0.0
            and state[5] == 0.0
            and known[OFFSET] == 0.0
            and line_m == 0.0
            and x == known[FRONT_X]
            and y == known[FRONT_Y]
        ):
            continue  # it stands, and has turned as far as it turns
        jump = np.hypot(x - known[RAW_X], y - known[RAW_Y]) > speed * dt + JUMP_M
        raw_x, raw_y = x, y
        if jump or known[OFFSET] != 0.0 or line_m != 0.0:
            # The lane's heading, not that of SUMO's vehicle, which turns as its rear follows.
            way, j = heading, lane[k]
            if j >= 0:
                known[BESIDE_S] = along(x, y, known[BESIDE_S], xs, ys, marks, first[j], first[j + 1])
                way = heading_at(known[BESIDE_S], marks, angles, first[j], first[j + 1])
            cos, sin = np.cos(way), np.sin(way)
            if jump:
                known[OFFSET] += (known[RAW_Y] - y) * cos - (known[RAW_X] - x) * sin
            most = min(SIDEWAYS_MPS, SIDEWAYS_SHARE * speed) * dt
            known[OFFSET] += max(-most, min(most, line_m - known[OFFSET]))
            x, y = x - known[OFFSET] * sin, y + known[OFFSET] * cos
        known[RAW_X], known[RAW_Y] = raw_x, raw_y
        # The front moves to a point; the rear axle is drawn towards it.
        reach = shape[k, AXLE]
        rear_x = known[FRONT_X] - reach * np.cos(heading)
        rear_y = known[FRONT_Y] - reach * np.sin(heading)
        turned = np.arctan2(y - rear_y, x - rear_x)
        change = turned - heading
        change -= 2 * np.pi * np.round(change / (2 * np.pi))
        state[5] = change / dt
        steer = np.arctan(shape[k, WHEELBASE] * state[5] / max(speed, SLOWEST_TURN_MPS))
        state[6] = max(-shape[k, STEER_MOST], min(shape[k, STEER_MOST], steer))
        known[FRONT_X], known[FRONT_Y] = x, y
        state[0] = x - shape[k, HALF] * np.cos(turned)
        state[1] = y - shape[k, HALF] * np.sin(turned)
        state[2], state[3] = turned, speed


@compiled(
    INTS, INTS, TABLE, TABLE, INTS, INTS, FLOATS, FLOATS, FLOATS, INTS, INTS, FLOATS, FLOATS, FLOATS, FLOATS, FLOATS,
    FLOATS, INTS, FLOAT
)  # fmt: skip
def slow_for_bends(
    who: IntArray,
    rows: IntArray,
    states: FloatArray,
    memory: FloatArray,
    lane: IntArray,
    first: IntArray,
    xs: FloatArray,
    ys: FloatArray,
    marks: FloatArray,
    begin: IntArray,
    count: IntArray,
    slowest: FloatArray,
    bend_marks: FloatArray,
    bend_speeds: FloatArray,
    cruise: FloatArray,
    limit: FloatArray,
    told: FloatArray,
    changed: IntArray,
    dt: float,
) -> int:
    """Work out what each vehicle may drive in the next step.

    Args:
        who: [N] the vehicles that are asked about.
        rows, states, memory, lane: see above; `memory` is changed.
        first, xs, ys, marks: of the `LaneTable`.
        begin, count: the bends of each vehicle's lane and of what follows it: where they begin in `bend_marks` (m) and
            `bend_speeds` (m/s), and how many they are. slowest: the least of those speeds.
        cruise: what each drives where nothing hinders it, m/s.
        limit: is filled with what the bends allow, m/s; infinite where they do not matter.
        told: what each has been told last: the less of `cruise` and `limit`; is changed.
        changed: is filled with those for whom that is another one now.
        dt: s.

    Returns:
        How many of `changed` are filled.
    """
    found = 0
    for n in range(who.size):
        k = who[n]
        speed, j = states[rows[k], 3], lane[k]
        allowed = np.inf
        # It may be told to go faster than it did.
        if j >= 0 and count[k] > 0 and slowest[k] < max(cruise[k], speed + 1.0):
            known = memory[k]
            s = along(known[FRONT_X], known[FRONT_Y], known[BENDS_S], xs, ys, marks, first[j], first[j + 1])
            known[BENDS_S] = s
            s += speed * dt
            low, end = begin[k], begin[k] + count[k]
            i = last_up_to(bend_marks, low, end, s)
            if i < low:
                allowed = bend_speeds[low]
            elif i >= end - 1:
                allowed = bend_speeds[end - 1]
            else:
                share = (s - bend_marks[i]) / max(bend_marks[i + 1] - bend_marks[i], 1e-9)
                allowed = bend_speeds[i] + share * (bend_speeds[i + 1] - bend_speeds[i])
        limit[k] = allowed
        now = min(cruise[k], allowed)
        if now != told[k]:
            told[k] = now
            changed[found] = k
            found += 1
    return found
