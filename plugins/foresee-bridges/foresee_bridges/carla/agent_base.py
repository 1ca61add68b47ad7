"""The base class of agents of CARLA's leaderboard, for agents that find no package `leaderboard`.

It has the interface of leaderboard 2.1, and takes the single argument of leaderboard 1.0's constructor.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum, IntEnum
from typing import Any

SPACING_M = 200.0
"""Largest distance between two points of an agent's plan, m (`set_global_plan` of leaderboard 2.0)."""
OLD_SPACING_M = 50.0
"""The same in leaderboard 1.0."""


class RoadOption(IntEnum):
    """What the route does at a point (CARLA 0.9.15, `agents/navigation/local_planner.py`)."""

    VOID = -1
    LEFT = 1
    RIGHT = 2
    STRAIGHT = 3
    LANEFOLLOW = 4
    CHANGELANELEFT = 5
    CHANGELANERIGHT = 6


class Track(Enum):
    """The tracks of the leaderboard."""

    SENSORS = "SENSORS"
    MAP = "MAP"
    SENSORS_QUALIFIER = "SENSORS_QUALIFIER"
    MAP_QUALIFIER = "MAP_QUALIFIER"


class SensorInterface:
    """Holds nothing: a run passes its data to `run_step`."""


def downsample_route(route: Sequence[tuple[Any, Any]], sample_factor: float) -> list[int]:
    """Return the indices of the points of a dense route that an agent's plan keeps.

    Kept are the ends, lane changes, the points where the option changes, and otherwise a point after each
    `sample_factor` m, as in leaderboard 2.0.
    """
    changes = (RoadOption.CHANGELANELEFT, RoadOption.CHANGELANERIGHT)
    indices: list[int] = []
    distance_m = 0.0
    for index, (transform, option) in enumerate(route):
        last = route[index - 1][1] if index else None
        turn = last is not None and option != last and last not in changes
        if last is None or option in changes or turn or distance_m > sample_factor or index == len(route) - 1:
            indices.append(index)
            distance_m = 0.0
        else:
            distance_m += transform.location.distance(route[index - 1][0].location)
    return indices


class AutonomousAgent:
    """What an agent derives from, with the attributes and methods of the leaderboard's class."""

    def __init__(self, carla_host: str, carla_port: int | str | None = None, debug: bool = False) -> None:
        self.track = Track.SENSORS
        self._global_plan: list[tuple[dict[str, float], RoadOption]] | None = None
        self._global_plan_world_coord: list[tuple[Any, RoadOption]] | None = None
        self._spacing_m = SPACING_M
        self.sensor_interface = SensorInterface()
        self.wallclock_t0 = None
        if carla_port is None:  # leaderboard 1.0: the argument is the configuration, and the constructor sets up
            self._spacing_m = OLD_SPACING_M
            self.setup(carla_host)

    def setup(self, path_to_conf_file: str) -> None:
        """Prepare the agent; agents override it."""

    def sensors(self) -> list[dict[str, Any]]:
        """Return the sensors; agents override it."""
        return []

    def run_step(self, input_data: dict[str, tuple[int, Any]], timestamp: float) -> Any:
        """Return a `carla.VehicleControl`; agents override it."""
        raise NotImplementedError("the agent has no run_step")

    def destroy(self) -> None:
        """Release what the agent holds; agents may override it."""

    @staticmethod
    def get_ros_version() -> int:
        """Return the version of ROS that the agent uses; -1: none."""
        return -1

    def set_global_plan(
        self,
        global_plan_gps: Sequence[tuple[dict[str, float], RoadOption]],
        global_plan_world_coord: Sequence[tuple[Any, RoadOption]],
    ) -> None:
        """Keep the route, reduced by `downsample_route`."""
        kept = downsample_route(global_plan_world_coord, self._spacing_m)
        self._global_plan_world_coord = [(global_plan_world_coord[i][0], global_plan_world_coord[i][1]) for i in kept]
        self._global_plan = [global_plan_gps[i] for i in kept]
