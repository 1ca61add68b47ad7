"""Kernels that move actors along paths, and find where SUMO's vehicles see them.

An actor accelerates or brakes to a pace, slows down for bends and stops at its stop.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, Record, Records
from foresee_dsl.kernels.bicycle import STATES
from foresee_dsl.kernels.compiling import FLOAT, FLOATS, compiled, inner
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.kernels.lines import SPEED_POINTS, VERTICES, place_at, speed_at
from foresee_dsl.kernels.records import array_of

CELL_M = 0.5
"""Length of path per look-up of the lane under it, m. Ours."""
STEPS_OUT_M = 1.0
"""Length of path before the road within which SUMO's drivers see a pedestrian who is about to step on it, m. Ours: one
pace."""
NO_LANE, OFF_ROAD, UNKNOWN = -1, -2, -3
"""Values that stand instead of a lane's number: on the road but not on a lane; off the road; not looked up yet."""


class ActorOnPath(NamedTuple):
    """An actor on a path.

    Attributes:
        along: its position, as the length along the path, m. speed: m/s. pace: the speed to reach, m/s.
        acceleration, braking: rates of speeding up and braking, m/s^2, positive.
        stop: length along the path at which it must wait, m; NaN if it need not wait. half_length: half its footprint's
            length, m; 0 for an actor that turns on the spot. heading: heading of the path at its position, rad.
        length, width: size of its footprint, m.
        row: row of its state in the table of all actors; -1 if it must not be moved. seen_on: the lane with its
            stand-in in SUMO, `OFF_ROAD` without one.
        line_begin, line_end: range of its path's vertices; bends_begin, bends_end: range of its path's speed limits;
            cells_begin, cells_end: range of the cells under its path; all in arrays of several paths.
    """

    along: float
    speed: float
    pace: float
    acceleration: float
    braking: float
    stop: float
    half_length: float
    heading: float
    length: float
    width: float
    row: int
    seen_on: int
    line_begin: int
    line_end: int
    bends_begin: int
    bends_end: int
    cells_begin: int
    cells_end: int


class PathCell(NamedTuple):
    """The lane under a path at a multiple of `CELL_M`: its number, or one of the values above; its heading, rad."""

    lane: int
    heading: float


class SightRecord(NamedTuple):
    """The position at which SUMO's vehicles see an actor on a path.

    Attributes:
        follower: index of the follower. lane: number of the lane on which it is seen, or one of the values above.
        cell: index of the cell of its path that determines the lane.
        x, y: front of the stand-in, m. heading: heading of the lane, rad. length: length of the stand-in, m.
        speed: along the lane, m/s.
    """

    follower: int
    lane: int
    cell: int
    x: float
    y: float
    heading: float
    length: float
    speed: float


FOLLOWERS, CELLS, SIGHTS = array_of(ActorOnPath), array_of(PathCell), array_of(SightRecord)


@inner
def _approach(room: float, speed: float, braking: float, dt: float) -> float:
    """Return the largest speed at the end of this step from which an actor can still stop within `room`, m/s."""
    left = room - speed * dt / 2
    return float(braking * (np.sqrt(max(0.0, dt * dt / 4 + 2 * left / braking)) - dt / 2))


@compiled(FLOAT, FLOAT, VERTICES)
def pose_on_path(along: float, half: float, line: Records) -> tuple[float, float, float]:
    """Return x, y (m) and heading (rad) of an actor at a length along its path (m).

    `half`: half its length, m; if positive, its heading is that of the line between its rear and its front.
    """
    x, y, heading = place_at(along, line)
    if half > 0.0:
        rear_x, rear_y, _ = place_at(along - half, line)
        front_x, front_y, _ = place_at(along + half, line)
        dx, dy = front_x - rear_x, front_y - rear_y
        if np.hypot(dx, dy) > half / 2:  # a path that folds back on itself here has no such heading
            heading = np.arctan2(dy, dx)
    return x, y, heading - 2 * np.pi * np.round(heading / (2 * np.pi))


@inner
def _wrapped(angle: float) -> float:
    """Return `math.remainder(angle, math.tau)` to the last bit, for an angle within -3 pi..3 pi."""
    if angle > np.pi:
        return angle - 2 * np.pi
    if angle < -np.pi:
        return -(-angle - 2 * np.pi)  # zero must keep its sign
    return angle


@inner
def _advance(follower: Record, line: Records, bends: Records, dt: float) -> tuple[float, float, float]:
    """Advance a follower by a step: change its `along` and `speed`; return x, y (m) and heading (rad).

    `bends`: speed limits of the path's bends; empty without limits.
    """
    along, before, braking = follower["along"], follower["speed"], follower["braking"]
    pace, stop, half = follower["pace"], follower["stop"], follower["half_length"]
    length = line[line.size - 1]["along"]
    if bends.size:  # the front of a vehicle reaches a corner before its centre does
        pace = min(pace, speed_at(along + half + before * dt, bends, 0, bends.size))
    speed = max(before - braking * dt, min(pace, before + follower["acceleration"] * dt), 0.0)
    held = False
    if not along <= stop < length:  # true for NaN, too
        stop = length
    for wait in (stop, length):
        if held:
            continue
        room = wait - along
        speed = min(speed, max(_approach(room, before, braking, dt), before - braking * dt, 0.0))
        if room <= (before + speed) / 2 * dt + 1e-9 and speed <= braking * dt:
            # The last step ends exactly at the stop, where the follower is at rest.
            along, speed, held = wait, 0.0, True
    if not held:
        along = min(along + (before + speed) / 2 * dt, length)
        if along >= length:
            speed = 0.0
    follower["along"], follower["speed"] = along, speed
    return pose_on_path(along, half, line)


@inner
def _cell(along: float, follower: Record) -> int:
    """Return the index of the path's cell at a length."""
    return int(max(min(np.rint(along / CELL_M), follower["cells_end"] - follower["cells_begin"] - 1), 0))


@compiled(FOLLOWERS, STATES, VERTICES, CELLS, SIGHTS)
def find_seen(followers: Records, states: Records, lines: Records, cells: Records, sights: Records) -> int:
    """Find the positions at which SUMO's vehicles see followers: on the road, or about to step on it.

    Fills `sights` for followers that are seen, and with `OFF_ROAD` for followers that are not seen any more; returns
    their number. It stops at a cell that must be looked up first, which is then the last sight (`UNKNOWN`).
    """
    count = 0
    for n in range(followers.size):
        follower = followers[n]
        if follower["row"] < 0:
            continue
        state = states[follower["row"]]
        k = _cell(follower["along"], follower)
        lane = cells[follower["cells_begin"] + k]["lane"]
        if lane == OFF_ROAD and state["speed"] > STANDS_MPS:
            k = _cell(min(follower["along"] + STEPS_OUT_M, lines[follower["line_end"] - 1]["along"]), follower)
            lane = cells[follower["cells_begin"] + k]["lane"]
        if lane == OFF_ROAD and follower["seen_on"] == OFF_ROAD:
            continue
        sight = sights[count]
        count += 1
        sight["follower"], sight["lane"], sight["cell"] = n, lane, k
        if lane == UNKNOWN:
            break
        if lane == OFF_ROAD:
            continue
        heading = cells[follower["cells_begin"] + k]["heading"]
        turned = state["heading"] - heading
        ahead = np.cos(turned)
        length = abs(ahead) * follower["length"] + abs(np.sin(turned)) * follower["width"]
        half, speed = length / 2, state["speed"] * ahead
        sight["x"], sight["y"] = state["x"] + half * np.cos(heading), state["y"] + half * np.sin(heading)
        sight["heading"], sight["length"], sight["speed"] = heading, length, speed if speed > 0.0 else 0.0
    return count


@compiled(FOLLOWERS, STATES, FLOATS, VERTICES, SPEED_POINTS, CELLS, SIGHTS, FLOAT)
def advance(
    followers: Records,
    states: Records,
    along: FloatArray,
    lines: Records,
    bends: Records,
    cells: Records,
    sights: Records,
    dt: float,
) -> int:
    """Advance followers and their states by a step; then fill `sights` and return their number as `find_seen`.

    `states`, `along`: the values of all actors. `lines`, `bends`, `cells`: the arrays of all paths.
    """
    for n in range(followers.size):
        follower = followers[n]
        if follower["row"] < 0:
            continue
        state, before, heading_before = states[follower["row"]], follower["speed"], follower["heading"]
        line = lines[follower["line_begin"] : follower["line_end"]]
        halted = follower["pace"] == 0.0 or follower["along"] >= line[line.size - 1]["along"]
        if halted and before == state["speed"] == state["acceleration"] == state["yaw_rate"] == 0.0:
            continue
        speeds = bends[follower["bends_begin"] : follower["bends_end"]]
        x, y, heading = _advance(follower, line, speeds, dt)
        follower["heading"] = heading
        state["x"], state["y"], state["heading"] = x, y, _wrapped(heading)
        state["speed"], state["acceleration"] = follower["speed"], (follower["speed"] - before) / dt
        state["yaw_rate"] = _wrapped(heading - heading_before) / dt
        along[follower["row"]] = follower["along"]
    return find_seen(followers, states, lines, cells, sights)
