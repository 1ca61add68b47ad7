"""The planners: those of the packages `commonroad-reactive-planner`, `commonroad-idm-planner` and `fiss-planner`, and
any function of the user's.

A planner is called with a scenario, a planning problem whose initial state is the ego's at time step 0, and a `Route`.
It returns a trajectory of CommonRoad, or a list of states with `time_step`, `position` (the vehicle's centre),
`orientation` and `velocity`; None if it has no plan.
"""

from __future__ import annotations

import importlib
import importlib.util
import logging
import sys
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState

from foresee_bridges.commonroad.world import DT_S, FloatArray, Route

Plan = Callable[[Scenario, PlanningProblem, Route], Any]
"""A planner: from scenario, problem and route to a trajectory, a list of states, or None."""

HORIZON_STEPS = 30
"""Number of steps that a plan looks ahead. Ours: 3 s, from 50 km/h to a stop with 4.6 m/s^2."""

SAMPLING_LEVELS = 3
"""Number of densities with which the reactive planner samples until it finds a plan. Ours: with its default, 4, a step
without a feasible sample takes up to 20 s on a busy machine."""
BEHIND_M, AHEAD_M = 5.0, 80.0
"""Part of the path that the IDM planner gets, m. Ours: it looks up the lanelet of each point in each plan, so
a longer path takes more time; 50 km/h are 42 m in 3 s."""


class Reactive:
    """The reactive planner (TU Munich): samples in Frenet coordinates, checks for collisions, takes the cheapest."""

    walls = True

    def __init__(self) -> None:
        from commonroad_rp.utility.config import ReactivePlannerConfiguration

        self._config = ReactivePlannerConfiguration()
        self._planner: Any = None
        self._borders: Any = None

    def __call__(self, scenario: Scenario, problem: PlanningProblem, route: Route) -> Any:  # noqa: ANN401
        """Return the optimal trajectory; None without a feasible sample."""
        from commonroad_rp.state import ReactivePlannerState

        config = self._config
        if self._planner is None:
            self._begin(scenario, deepcopy(problem), route)  # the planner changes the initial state
        config.update(scenario, problem)
        axle = config.vehicle.wb_rear_axle
        state = ReactivePlannerState.create_from_initial_state(problem.initial_state, config.vehicle.wheelbase, axle)
        state.steering_angle = route.steer_rad
        self._planner.reset(
            config,
            initial_state_cart=state,
            collision_checker=self._checker(scenario),
            coordinate_system=self._planner.coordinate_system,
        )
        self._planner.set_desired_velocity(route.speed_limit_mps, max(state.velocity, 0.01))
        result = self._planner.plan()
        if result is None:
            return None
        return [ReactivePlannerState.shift_state_to_center(each, axle) for each in result[0].state_list]

    def _begin(self, scenario: Scenario, problem: PlanningProblem, route: Route) -> None:
        from commonroad_dc.boundary.boundary import create_road_boundary_obstacle
        from commonroad_rp.reactive_planner import ReactivePlanner
        from commonroad_rp.utility.utils_coordinate_system import create_coordinate_system

        config, car = self._config, route.vehicle
        front = car["length_m"] / 2 - car["front_overhang_m"]
        config.vehicle.length, config.vehicle.width = car["length_m"], car["width_m"]
        config.vehicle.wb_front_axle, config.vehicle.wb_rear_axle = front, car["wheelbase_m"] - front
        config.vehicle.a_max = car["emergency_braking_mps2"]
        config.vehicle.delta_max, config.vehicle.delta_min = car["steer_max_rad"], -car["steer_max_rad"]
        config.vehicle.v_delta_max, config.vehicle.v_delta_min = car["steer_rate_rad_s"], -car["steer_rate_rad_s"]
        config.vehicle.__post_init__()
        config.planning.dt, config.planning.time_steps_computation = DT_S, HORIZON_STEPS
        config.planning.__post_init__()
        config.sampling.num_sampling_levels = SAMPLING_LEVELS
        config.debug.multiproc, config.debug.logging_level = False, "ERROR"
        config.update(scenario, problem)
        self._planner = ReactivePlanner(config)
        self._planner.set_reference_path(coordinate_system=create_coordinate_system(route.path))
        _, self._borders = create_road_boundary_obstacle(scenario)

    def _checker(self, scenario: Scenario) -> Any:  # noqa: ANN401
        """Return the collision checker of the obstacles and of the road's borders, which are computed once a run."""
        from commonroad_dc import pycrcc
        from commonroad_dc.collision.collision_detection.pycrcc_collision_dispatch import create_collision_object

        checker = pycrcc.CollisionChecker()
        for obstacle in scenario.obstacles:
            checker.add_collision_object(create_collision_object(obstacle))
        checker.add_collision_object(self._borders)
        return checker


class Idm:
    """The IDM planner (TU Munich): follows the path with the Intelligent Driver Model."""

    walls = True

    def __call__(self, scenario: Scenario, problem: PlanningProblem, route: Route) -> Any:  # noqa: ANN401
        """Return the trajectory of one planning cycle, without its first state.

        That state is the ego's, and the next one is on the path beside it: the trajectory would begin with a step
        sideways.
        """
        from commonroad_idm_planner.configuration.planner_config import IDMConfigFactory
        from commonroad_idm_planner.idm_path import IDMPathFactory
        from commonroad_idm_planner.idm_planner import IDMPlanner

        config = IDMConfigFactory.generate_default_config(ignore_static_obstacles=False)
        config.v_desired = max(route.speed_limit_mps, 0.1)
        config.planning_horizon = HORIZON_STEPS
        config.vehicle_length, config.vehicle_width = route.vehicle["length_m"], route.vehicle["width_m"]
        path = IDMPathFactory.generate_idm_path_from_np_2d_positional_array(
            _dense(route.path, problem.initial_state.position)
        )
        planner = IDMPlanner(scenario, problem, config, path, logging_level=logging.ERROR)
        return planner.plan().state_list[1:]


class Fiss:
    """FISS+ (National University of Singapore): samples in Frenet coordinates with an iterative search."""

    walls = False  # it reads traffic lights

    def __init__(self) -> None:
        self._planner: Any = None

    def __call__(self, scenario: Scenario, problem: PlanningProblem, route: Route) -> Any:  # noqa: ANN401
        """Return the trajectory of one planning cycle."""
        import fiss_planner
        from commonroad.scenario.traffic_sign import SupportedTrafficSignCountry
        from fiss_planner.commonroad import adapter

        network = scenario.lanelet_network
        if self._planner is None:
            self._road = adapter.road_map_from_lanelet_network(network, SupportedTrafficSignCountry.GERMANY)
            self._planner = fiss_planner.LocalPlanner(fiss_planner.LocalPlannerConfig(), _fiss_vehicle(route))
            self._planner.set_map(self._road, list(route.lanelets))
        for number, active in adapter.traffic_light_stop_lines(network, 0).items():
            self._planner.set_stop_line_active(number, active)
        obstacles = adapter.obstacles_at(scenario.obstacles, 0, DT_S, HORIZON_STEPS * DT_S + 2.5)
        ego = adapter.ego_state_from_commonroad(problem.initial_state)
        plan = self._planner.step(route.time_s, ego, obstacles, route.speed_limit_mps).trajectory
        if len(plan.x) < 2:
            return None
        columns = zip(plan.t, plan.x, plan.y, plan.yaw, plan.v, strict=True)
        return [
            CustomState(time_step=t / DT_S, position=np.array([x, y]), orientation=yaw, velocity=v)
            for t, x, y, yaw, v in columns
        ]


def _fiss_vehicle(route: Route) -> Any:  # noqa: ANN401
    import fiss_planner

    car, vehicle = route.vehicle, fiss_planner.VehicleParams()
    vehicle.length, vehicle.width, vehicle.wheelbase = car["length_m"], car["width_m"], car["wheelbase_m"]
    vehicle.rear_axle_to_center = car["wheelbase_m"] + car["front_overhang_m"] - car["length_m"] / 2
    vehicle.max_speed, vehicle.max_accel = car["max_speed_mps"], car["acceleration_mps2"]
    vehicle.max_decel = car["emergency_braking_mps2"]
    vehicle.max_steer, vehicle.max_steer_rate = car["steer_max_rad"], car["steer_rate_rad_s"]
    return vehicle


def _dense(path: FloatArray, near: FloatArray) -> FloatArray:
    """Return the part of a path around a place with points 0.1 m apart: the IDM planner moves from point to point."""
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    here = s[np.hypot(*(path - near).T).argmin()]
    marks = np.arange(max(here - BEHIND_M, 0.0), min(here + AHEAD_M, s[-1]), 0.1)
    return np.column_stack([np.interp(marks, s, path[:, axis]) for axis in (0, 1)])


PLANNERS: dict[str, tuple[type, str]] = {
    "reactive": (Reactive, "commonroad-reactive-planner"),
    "idm": (Idm, "commonroad-idm-planner"),
    "fiss": (Fiss, "fiss-planner"),
}
"""The planners by name: their class, and the package that they need."""


def planner_of(name: str) -> tuple[Callable[[], Plan], bool, str]:
    """Return how a planner is made for a run, whether it needs walls at red signals, and its version.

    Args:
        name: a name of `PLANNERS`, or `MODULE:FUNCTION` or `FILE.py:FUNCTION`. A class is created for each run.

    Raises:
        ImportError, AttributeError: there is no such package, module or function.
    """
    if name in PLANNERS:
        from importlib.metadata import version

        kind, package = PLANNERS[name]
        return kind, bool(getattr(kind, "walls", True)), version(package)
    module, _, function = name.rpartition(":")
    if not module:
        raise ImportError(
            f"there is no planner {name!r}: write {', '.join(PLANNERS)}, MODULE:FUNCTION or FILE.py:FUNCTION"
        )
    plan = getattr(_module(module), function)
    walls = bool(getattr(plan, "walls", True))
    return (plan if isinstance(plan, type) else lambda: plan), walls, str(getattr(plan, "version", "1"))


def _module(name: str) -> ModuleType:
    if not name.endswith(".py"):
        sys.path.insert(0, str(Path.cwd()))
        return importlib.import_module(name)
    spec = importlib.util.spec_from_file_location(Path(name).stem, name)
    if spec is None or spec.loader is None:
        raise ImportError(name)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
