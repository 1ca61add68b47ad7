"""The route of a mission as CARLA's leaderboard passes it to agents: dense points with the options of turns."""

from __future__ import annotations

import math
from types import ModuleType
from typing import Any

import numpy as np

from foresee_bridges.carla.coordinates import GeoReference, yaw_deg
from foresee_dsl.drivers.protocol import Mission, VehicleLimits

HOP_M = 1.0
"""Distance between two points of the dense route, m (`interpolate_trajectory` of leaderboard 2.0)."""
_TURNS = {"left": "LEFT", "right": "RIGHT", "straight": "STRAIGHT", "back": "LEFT"}
"""Options of turns; CARLA has none for turning back."""
Plan = tuple[list[tuple[dict[str, float], Any]], list[tuple[Any, Any]]]
"""The two arguments of `set_global_plan`: places as latitude, longitude and height, and as `carla.Transform`."""


def plan_of(mission: Mission, vehicle: VehicleLimits, carla: ModuleType, options: Any, reference: GeoReference) -> Plan:
    """Return the route from the ego's centre to the end of the mission's line, which is beyond the goal.

    Args:
        carla: the module with `Transform`, `Location` and `Rotation`. options: the enumeration `RoadOption`.
    """
    start_s = mission.start_s - vehicle.length_m / 2
    s = np.arange(start_s, mission.s[-1], HOP_M)
    places = np.column_stack([np.interp(s, mission.s, mission.centreline[:, i]) for i in (0, 1)])
    ahead = np.diff(places, axis=0, append=places[-1:])
    ahead[-1] = ahead[-2]
    gps, world = [], []
    for at, (x, y), (dx, dy) in zip(s.tolist(), places.tolist(), ahead.tolist(), strict=True):
        option = options[_option(mission, at)]
        latitude, longitude = reference.gps(x, y)
        gps.append(({"lat": latitude, "lon": longitude, "z": 0.0}, option))
        rotation = carla.Rotation(yaw=yaw_deg(math.atan2(dy, dx)))
        world.append((carla.Transform(carla.Location(x=x, y=-y, z=0.0), rotation), option))
    return gps, world


def _option(mission: Mission, s: float) -> str:
    """Return the name of the option at a length along the route: that of the turn inside a junction."""
    inside = (junction for junction in mission.junctions if junction.stop_s < s < junction.exit_s)
    return next((_TURNS[junction.turn] for junction in inside), "LANEFOLLOW")
