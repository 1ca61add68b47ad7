"""The driver `nuplan`: a planner written for nuplan-devkit drives, `--driver nuplan:module:Planner:arguments`.

A planner is a program: a file that names one starts it only with the user's consent, like any driver with a colon in
its address.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import Any, Self, TypeVar

import numpy as np

from foresee_bridges.nuplan.creating import check_installed, new_planner
from foresee_bridges.nuplan.roads import Roads
from foresee_dsl.drivers.protocol import EgoState, Mission, Observation, SeenActor, Trajectory, VehicleLimits
from foresee_dsl.drivers.tracking import Tracker
from foresee_dsl.errors import DriverError

INTERVAL_S = 0.1
"""Time between two plans and between two states of the history, s, as in nuPlan's simulations."""
HISTORY_S = 2.0
"""Length of the history, s (nuPlan's `simulation_history_buffer_duration`)."""
Moving = TypeVar("Moving", EgoState, SeenActor)


class PlannerDriver:
    """A planner written for nuplan-devkit: --driver nuplan:module:Planner, or nuplan:planner.yaml."""

    name, version = "nuplan", "1"

    def __init__(self, argument: str, planner: Any, name: str, version: str) -> None:
        self.name, self.version = name, version
        self._argument, self._ready = argument, planner

    @classmethod
    def from_argument(cls, argument: str) -> Self:
        """Create the driver of the address `nuplan:ARGUMENT`.

        Raises:
            DriverError: nuplan-devkit is not installed, or there is no such planner.
        """
        check_installed()
        planner, version = new_planner(argument)
        return cls(argument, planner, f"nuplan:{argument}", version)

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Create the planner, and initialise it with the map, the goal and the roadblocks of the route.

        Raises:
            DriverError: the mission has no map, or the planner needs sensor data or a recorded scenario.
        """
        from nuplan.common.actor_state.state_representation import StateSE2
        from nuplan.planning.simulation.observation.observation_type import DetectionsTracks
        from nuplan.planning.simulation.planner.abstract_planner import PlannerInitialization

        from foresee_bridges.nuplan.map_api import RoadsMap
        from foresee_bridges.nuplan.states import vehicle_parameters

        if mission.road_map is None:
            raise DriverError("planners of nuPlan need a map, and this mission has none")
        self._planner, self._ready = self._ready or new_planner(self._argument)[0], None
        if getattr(self._planner, "requires_scenario", False):
            raise DriverError(f"{self.name} needs a recorded scenario of nuPlan, which a run does not have")
        if not issubclass(self._planner.observation_type(), DetectionsTracks):
            raise DriverError(f"{self.name} needs camera or lidar data of nuPlan; a run has tracked objects")
        self._vehicle, self._parameters = vehicle, vehicle_parameters(vehicle)
        roads = Roads(mission.road_map)
        self._connectors = roads.signals()
        self._planner.initialize(PlannerInitialization(list(roads.route), StateSE2(*_goal(mission)), RoadsMap(roads)))
        self._tracker, self._steps = Tracker(), 0
        self._every = max(1, round(INTERVAL_S / mission.step_s))
        self._egos: deque[Any] = deque(maxlen=round(HISTORY_S / INTERVAL_S) + 1)
        self._objects: deque[Any] = deque(maxlen=self._egos.maxlen)

    def step(self, observation: Observation) -> Trajectory:
        """Return the planner's trajectory: a new one every 0.1 s, the last one in between."""
        actors = self._tracker.update(observation).seen()
        if self._steps % self._every == 0:
            self._plan = self._planned(observation, actors)
        self._steps += 1
        return self._plan

    def _planned(self, observation: Observation, actors: tuple[SeenActor, ...]) -> Trajectory:
        from nuplan.common.actor_state.state_representation import TimePoint
        from nuplan.planning.simulation.history.simulation_history_buffer import SimulationHistoryBuffer
        from nuplan.planning.simulation.planner.abstract_planner import PlannerInput
        from nuplan.planning.simulation.simulation_time_controller.simulation_iteration import SimulationIteration

        from foresee_bridges.nuplan.geometry import time_us
        from foresee_bridges.nuplan.states import traffic_lights, trajectory

        now_s = observation.time_s
        if not self._egos:
            self._begin(observation, actors)
        self._remember(observation.ego, actors, now_s)
        answer = self._planner.compute_trajectory(
            PlannerInput(
                iteration=SimulationIteration(TimePoint(time_us(now_s)), self._steps // self._every),
                history=SimulationHistoryBuffer(self._egos, self._objects, INTERVAL_S),
                traffic_light_data=traffic_lights(observation.signals, self._connectors, now_s),
            )
        )
        return trajectory(answer, self._vehicle)

    def _begin(self, observation: Observation, actors: tuple[SeenActor, ...]) -> None:
        """Fill the history before the first step: all moved straight on at their present speed."""
        for back in range((self._egos.maxlen or 1) - 1, 0, -1):
            ago_s = back * INTERVAL_S
            ego = replace(observation.ego, acceleration_mps2=0.0, yaw_rate_rad_s=0.0)
            self._remember(_earlier(ego, ago_s), tuple(_earlier(a, ago_s) for a in actors), observation.time_s - ago_s)

    def _remember(self, ego: EgoState, actors: tuple[SeenActor, ...], at_s: float) -> None:
        from foresee_bridges.nuplan.states import ego_state, tracks

        self._egos.append(ego_state(ego, at_s, self._vehicle, self._parameters))
        self._objects.append(tracks(actors, at_s))


def _earlier(state: Moving, ago_s: float) -> Moving:
    way_m = state.speed_mps * ago_s
    return replace(
        state, x=state.x - way_m * math.cos(state.heading_rad), y=state.y - way_m * math.sin(state.heading_rad)
    )


def _goal(mission: Mission) -> tuple[float, float, float]:
    """Return place and heading of the goal."""
    x, y = (float(np.interp(mission.goal_s, mission.s, mission.centreline[:, i])) for i in (0, 1))
    i = min(int(np.searchsorted(mission.s, mission.goal_s)), len(mission.s) - 1)
    dx, dy = mission.centreline[i] - mission.centreline[max(i - 1, 0)]
    return x, y, math.atan2(dy, dx)
