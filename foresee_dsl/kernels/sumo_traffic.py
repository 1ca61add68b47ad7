"""Kernels that move the footprints of the vehicles that SUMO drives, and limit their speeds in bends."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, IntArray, Records
from foresee_dsl.kernels.bicycle import STATES
from foresee_dsl.kernels.compiling import FLOAT, FLOATS, INTS, compiled
from foresee_dsl.kernels.lines import SPEED_POINTS, VERTICES, along, heading_at, speed_at
from foresee_dsl.kernels.records import array_of

SIDEWAYS_MPS = 1.0
"""Lateral speed of a lane change, m/s. Ours: 3.3 m in 3.3 s, within the 3 s to 5 s that lane changes take."""
SIDEWAYS_SHARE = 0.25
"""Largest lateral speed as a share of the speed, about 14 deg: a standing vehicle does not slide."""
JUMP_M = 0.5
"""If a front moves at least this much farther than its speed explains, m, a lane change in SUMO has moved it."""
SLOWEST_TURN_MPS = 0.5
"""Lowest speed at which the steering angle is computed from the yaw rate, m/s: at lower speeds the yaw rate is
noise."""


class SumoVehicleRecord(NamedTuple):
    """The data of a vehicle that SUMO drives.

    Attributes:
        row: row of its state in the table of all actors.
        half_length, wheelbase: m. rear_axle: distance from the front bumper to the rear axle, m. steer_max: rad.
        line: distance to the left of its lane's middle that it keeps, m.
        front_x, front_y: middle of its front bumper, m. sumo_x, sumo_y: middle of its front bumper in SUMO, m. offset:
            distance of the former position to the left of the latter, m.
        lane_begin, lane_end: range of its lane's vertices; both 0 off the lanes. heading_s, bends_s: length along its
            lane at the last look-up of the lane's heading and of the bends, m (NaN: not yet).
        bends_begin, bends_end: range of the speed points of its lane and of the next ones. slowest: the lowest of these
            speeds, m/s.
        cruise: speed where nothing hinders it, m/s. limit: speed that the bends allow, infinite without a bend.
        ordered: the smaller of `cruise` and `limit`, as last set in SUMO.
    """

    row: int
    half_length: float
    rear_axle: float
    wheelbase: float
    steer_max: float
    line: float
    front_x: float
    front_y: float
    sumo_x: float
    sumo_y: float
    offset: float
    lane_begin: int
    lane_end: int
    heading_s: float
    bends_s: float
    bends_begin: int
    bends_end: int
    slowest: float
    cruise: float
    limit: float
    ordered: float


VEHICLES = array_of(SumoVehicleRecord)


@compiled(INTS, FLOATS, VEHICLES, STATES, VERTICES, FLOAT)
def follow(seen: IntArray, numbers: FloatArray, vehicles: Records, states: Records, lanes: Records, dt: float) -> None:
    """Move footprints to the positions of their vehicles in SUMO after a step.

    `seen`: [N] indices of the vehicles in SUMO. `numbers`: [3 N] x, y of the middle of each vehicle's front bumper, m,
    then all speeds, m/s. `vehicles`, `states`: the records of all vehicles and the states of all actors; both are
    changed. `lanes`: the vertices of all lanes.
    """
    for n in range(seen.size):
        vehicle = vehicles[seen[n]]
        state = states[vehicle["row"]]
        x, y, speed = numbers[2 * n], numbers[2 * n + 1], numbers[2 * seen.size + n]
        before, heading, line = state["speed"], state["heading"], vehicle["line"]
        state["acceleration"] = (speed - before) / dt  # as SUMO computes it
        if (
            speed == 0.0
            and before == 0.0
            and state["yaw_rate"] == 0.0
            and vehicle["offset"] == 0.0
            and line == 0.0
            and x == vehicle["front_x"]
            and y == vehicle["front_y"]
        ):
            continue  # the vehicle stands, and its turn is complete
        jump = np.hypot(x - vehicle["sumo_x"], y - vehicle["sumo_y"]) > speed * dt + JUMP_M
        sumo_x, sumo_y = x, y
        if jump or vehicle["offset"] != 0.0 or line != 0.0:
            # The lane's heading is used, not that of SUMO's vehicle, which turns gradually as its rear follows.
            way, first, end = heading, vehicle["lane_begin"], vehicle["lane_end"]
            if end > first:
                vehicle["heading_s"] = along(x, y, vehicle["heading_s"], lanes, first, end)
                way = heading_at(vehicle["heading_s"], lanes, first, end)
            cos, sin = np.cos(way), np.sin(way)
            if jump:
                vehicle["offset"] += (vehicle["sumo_y"] - y) * cos - (vehicle["sumo_x"] - x) * sin
            most = min(SIDEWAYS_MPS, SIDEWAYS_SHARE * speed) * dt
            vehicle["offset"] += max(-most, min(most, line - vehicle["offset"]))
            x, y = x - vehicle["offset"] * sin, y + vehicle["offset"] * cos
        vehicle["sumo_x"], vehicle["sumo_y"] = sumo_x, sumo_y
        # The front moves to its new position, and pulls the rear axle towards it.
        reach = vehicle["rear_axle"]
        rear_x = vehicle["front_x"] - reach * np.cos(heading)
        rear_y = vehicle["front_y"] - reach * np.sin(heading)
        turned = np.arctan2(y - rear_y, x - rear_x)
        change = turned - heading
        change -= 2 * np.pi * np.round(change / (2 * np.pi))
        state["yaw_rate"] = change / dt
        steer = np.arctan(vehicle["wheelbase"] * state["yaw_rate"] / max(speed, SLOWEST_TURN_MPS))
        state["steer"] = max(-vehicle["steer_max"], min(vehicle["steer_max"], steer))
        vehicle["front_x"], vehicle["front_y"] = x, y
        state["x"] = x - vehicle["half_length"] * np.cos(turned)
        state["y"] = y - vehicle["half_length"] * np.sin(turned)
        state["heading"], state["speed"] = turned, speed


@compiled(INTS, VEHICLES, STATES, VERTICES, SPEED_POINTS, INTS, FLOAT)
def slow_for_bends(
    driven: IntArray,
    vehicles: Records,
    states: Records,
    lanes: Records,
    bends: Records,
    changed: IntArray,
    dt: float,
) -> int:
    """Compute the speed limit of each vehicle for the next step: `limit` and `ordered` of its record.

    `driven`: [N] indices of these vehicles. `vehicles`, `states`: the records of all vehicles, which are changed, and
    the states of all actors.
    `lanes`: the vertices of all lanes; `bends`: the speed points. Fills `changed` with the indices of the vehicles
    whose `ordered` has changed; returns their number.
    """
    count = 0
    for n in range(driven.size):
        k = driven[n]
        vehicle = vehicles[k]
        speed, first, end = states[vehicle["row"]]["speed"], vehicle["lane_begin"], vehicle["lane_end"]
        allowed = np.inf
        has_bends = end > first and vehicle["bends_end"] > vehicle["bends_begin"]
        # In the next step the vehicle may be faster than now, so compare with 1 m/s more than its speed.
        if has_bends and vehicle["slowest"] < max(vehicle["cruise"], speed + 1.0):
            s = along(vehicle["front_x"], vehicle["front_y"], vehicle["bends_s"], lanes, first, end)
            vehicle["bends_s"] = s
            allowed = speed_at(s + speed * dt, bends, vehicle["bends_begin"], vehicle["bends_end"])
        vehicle["limit"] = allowed
        now = min(vehicle["cruise"], allowed)
        if now != vehicle["ordered"]:
            vehicle["ordered"] = now
            changed[count] = k
            count += 1
    return count
