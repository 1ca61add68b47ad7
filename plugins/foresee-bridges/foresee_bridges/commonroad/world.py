"""The world of a run as CommonRoad describes it: lanelets of the road map, obstacles of the object list, a goal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from commonroad.common.util import Interval
from commonroad.geometry.shape import Rectangle
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork, LaneletType, LineMarking, StopLine
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType, StaticObstacle
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState
from commonroad.scenario.traffic_light import (
    TrafficLight,
    TrafficLightCycle,
    TrafficLightCycleElement,
    TrafficLightState,
)
from commonroad.scenario.traffic_sign import TrafficSign, TrafficSignElement, TrafficSignIDGermany
from commonroad.scenario.trajectory import Trajectory
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

DT_S = 0.1
"""Time step of the scenarios, s: that of most CommonRoad scenarios."""
PREDICTED_STEPS = 60
"""Number of steps for which obstacles are predicted. Ours: the horizon of the reactive planner, 6 s."""
NEAR_M = 80.0
"""Lanes within this distance of the mission's centreline become lanelets, m. Ours: the range in which sensors see
cars."""
PREDICTED_STANDS_MPS = 0.3
"""Speed below which an object is predicted to stand, m/s. Ours: ten standard deviations of the measured speed of a
standing object."""
GOAL_M = 10.0
"""Length of the goal region, m. Ours: two cars' lengths."""
WALL_M = 0.5
"""Length of the obstacle that stands for a red signal, m. Ours."""
_TYPES = {
    "car": ObstacleType.CAR,
    "van": ObstacleType.CAR,
    "truck": ObstacleType.TRUCK,
    "bus": ObstacleType.BUS,
    "motorcycle": ObstacleType.MOTORCYCLE,
    "bicycle": ObstacleType.BICYCLE,
    "pedestrian": ObstacleType.PEDESTRIAN,
}
_COLOURS = {"red": TrafficLightState.RED, "amber": TrafficLightState.YELLOW, "green": TrafficLightState.GREEN}
_FIRST_OBSTACLE = 1_000_000
"""First id of the obstacles; ids of lanelets, signs and lights are below."""


class Route(NamedTuple):
    """What a planner may want to know besides the scenario and the problem.

    Attributes:
        time_s: time of the observation in the run, s; time step 0 of the scenario.
        path: [N, 2] centreline of the mission, m, at most 1 m apart, from behind the start to beyond the goal.
        lanelets: ids of the lanelets along the mission, in driving order.
        speed_limit_mps: speed limit at the ego, m/s.
        vehicle: the ego's vehicle: `length_m`, `width_m`, `wheelbase_m` and the others of `VehicleLimits`.
        steer_rad: angle of the ego's front wheels, left positive.
    """

    time_s: float
    path: FloatArray
    lanelets: tuple[int, ...]
    speed_limit_mps: float
    vehicle: Mapping[str, Any]
    steer_rad: float


class World:
    """One mission as a CommonRoad scenario, whose obstacles and signals are set anew for each plan.

    Args:
        road_map, mission, vehicle: as in the lines `map` and `reset` of the external protocol.
        walls: whether a red or amber signal on the route is also an obstacle at its stop line, for planners that do not
            read traffic lights.
    """

    def __init__(
        self, road_map: Mapping[str, Any], mission: Mapping[str, Any], vehicle: Mapping[str, Any], *, walls: bool
    ) -> None:
        self._mission, self._vehicle, self._walls = mission, vehicle, walls
        self._path = np.array(mission["centreline"], dtype=np.float64)
        self._s = np.array(mission["s"], dtype=np.float64)
        lanes = {name: lane for name, lane in road_map["lanes"].items() if self._is_near(lane)}
        self._ids = {name: k for k, name in enumerate(lanes, start=1)}
        self._lights: dict[str, TrafficLight] = {}
        self.scenario = Scenario(dt=DT_S)
        self.scenario.add_objects(self._network(road_map, lanes))
        self._lanelets = tuple(self._ids[name] for name in road_map["route"] if name in self._ids)
        self._goal = self._goal_region()

    def at(self, observation: Mapping[str, Any]) -> tuple[Scenario, PlanningProblem, Route]:
        """Return the scenario, the planning problem and the route of one observation; time step 0 is now."""
        scenario = self.scenario
        for obstacle in scenario.obstacles:
            scenario.remove_obstacle(obstacle)
        number = _FIRST_OBSTACLE
        late_s = observation["time_s"] - (observation["measured_s"] or observation["time_s"])
        for actor in observation["actors"]:
            scenario.add_objects(_obstacle(number, actor, max(late_s, 0.0)))
            number += 1
        self._set_signals(observation["signals"])
        ego = observation["ego"]
        for wall in self._signal_walls(observation["signals"], ego) if self._walls else ():
            scenario.add_objects(StaticObstacle(number, ObstacleType.ROAD_BOUNDARY, wall[0], wall[1]))
            number += 1
        start = InitialState(
            time_step=0,
            position=np.array([ego["x"], ego["y"]]),
            orientation=ego["heading_rad"],
            velocity=ego["speed_mps"],
            acceleration=ego["acceleration_mps2"],
            yaw_rate=ego["yaw_rate_rad_s"],
            slip_angle=0.0,
        )
        limit = float(self._mission["speed_limit_mps"][self._nearest(ego["x"], ego["y"])])
        route = Route(observation["time_s"], self._path, self._lanelets, limit, self._vehicle, ego["steer_rad"])
        return scenario, PlanningProblem(1, start, self._goal), route

    def _is_near(self, lane: Mapping[str, Any]) -> bool:
        if "car" not in lane["users"] or len(lane["centre"]) < 2:
            return False
        points = np.array(lane["centre"])[:, None, :]
        return bool((np.hypot(*(points - self._path[::10]).T) < NEAR_M).any())

    def _nearest(self, x: float, y: float) -> int:
        return int(np.hypot(self._path[:, 0] - x, self._path[:, 1] - y).argmin())

    def _network(self, road_map: Mapping[str, Any], lanes: Mapping[str, Any]) -> LaneletNetwork:
        ids, number = self._ids, len(lanes) + 1
        signs: dict[float, TrafficSign] = {}
        lights: dict[str, set[int]] = {}
        stops = {stop["lane"]: stop["points"] for stop in road_map["stop_lines"]}
        for name, lane in lanes.items():
            limit = lane["speed_limit_mps"]
            if limit not in signs:
                element = TrafficSignElement(TrafficSignIDGermany.MAX_SPEED, [str(limit)])
                signs[limit] = TrafficSign(number, [element], set(), np.array(lane["centre"][0]))
                number += 1
            if lane["signal"] is not None:
                if lane["signal"] not in self._lights:
                    self._lights[lane["signal"]] = TrafficLight(number, np.array(lane["centre"][0]), _cycle("off"))
                    number += 1
                for before in lane["predecessors"]:
                    lights.setdefault(before, set()).add(self._lights[lane["signal"]].traffic_light_id)
            lane["id"] = ids[name]
        lanelets = [
            _lanelet(lane, ids, signs[lane["speed_limit_mps"]], lights.get(name, set()), stops.get(name))
            for name, lane in lanes.items()
        ]
        network = LaneletNetwork.create_from_lanelet_list(lanelets)
        for sign in signs.values():
            network.add_traffic_sign(sign, set())
        for light in self._lights.values():
            network.add_traffic_light(light, set())
        return network

    def _goal_region(self) -> GoalRegion:
        goal_s = self._mission["goal_s"]
        x, y = (float(np.interp(goal_s, self._s, self._path[:, axis])) for axis in (0, 1))
        k = min(self._nearest(x, y), len(self._path) - 2)
        dx, dy = self._path[k + 1] - self._path[k]
        limit = float(self._mission["speed_limit_mps"][k])
        width = self._mission["left_m"][k] + self._mission["right_m"][k]
        region = Rectangle(GOAL_M, max(width, 2.0), np.array([x, y]), math.atan2(dy, dx))
        goal = CustomState(time_step=Interval(0, 10_000), position=region, velocity=Interval(limit / 2, limit))
        lanelets = self.scenario.lanelet_network.find_lanelet_by_position([np.array([x, y])])[0]
        return GoalRegion([goal], {0: list(lanelets)})

    def _set_signals(self, signals: Mapping[str, str]) -> None:
        for name, light in self._lights.items():
            light.traffic_light_cycle = _cycle(signals.get(name, "off"))

    def _signal_walls(self, signals: Mapping[str, str], ego: Mapping[str, Any]) -> list[tuple[Rectangle, InitialState]]:
        """Return an obstacle across the lane behind each stop line ahead whose signal is red or amber."""
        walls = []
        front_s = self._s[self._nearest(ego["x"], ego["y"])] + self._vehicle["length_m"] / 2
        for passage in self._mission["junctions"]:
            if signals.get(passage["signal"]) in ("red", "amber") and passage["stop_s"] + 0.5 > front_s:
                at = passage["stop_s"] + 1.0
                x, y = (float(np.interp(at, self._s, self._path[:, axis])) for axis in (0, 1))
                before = [float(np.interp(at - 1.0, self._s, self._path[:, axis])) for axis in (0, 1)]
                heading = math.atan2(y - before[1], x - before[0])
                state = InitialState(
                    time_step=0, position=np.array([x, y]), orientation=heading, velocity=0.0, acceleration=0.0,
                    yaw_rate=0.0, slip_angle=0.0,
                )  # fmt: skip
                walls.append((Rectangle(WALL_M, 3.0), state))
        return walls


def _lanelet(
    lane: Mapping[str, Any],
    ids: Mapping[str, int],
    sign: TrafficSign,
    lights: set[int],
    stop: Sequence[Sequence[float]] | None,
) -> Lanelet:
    line = None
    if stop is not None:
        start, end = (np.array(point) for point in stop)
        line = StopLine(start, end, LineMarking.SOLID, traffic_light_ref=set(lights))
    left, right = ids.get(lane["left_neighbour"] or ""), ids.get(lane["right_neighbour"] or "")
    return Lanelet(
        left_vertices=np.array(lane["left"]),
        center_vertices=np.array(lane["centre"]),
        right_vertices=np.array(lane["right"]),
        lanelet_id=lane["id"],
        predecessor=[ids[name] for name in lane["predecessors"] if name in ids],
        successor=[ids[name] for name in lane["successors"] if name in ids],
        adjacent_left=left,
        adjacent_left_same_direction=True if left is not None else None,
        adjacent_right=right,
        adjacent_right_same_direction=True if right is not None else None,
        stop_line=line,
        lanelet_type={LaneletType.URBAN},
        traffic_signs={sign.traffic_sign_id},
        traffic_lights=set(lights),
    )


def _cycle(colour: str) -> TrafficLightCycle:
    state = _COLOURS.get(colour, TrafficLightState.INACTIVE)
    return TrafficLightCycle([TrafficLightCycleElement(state, 10_000)])


def _obstacle(number: int, actor: Mapping[str, Any], late_s: float) -> DynamicObstacle | StaticObstacle:
    """Return an object of the object list, moved on from its measurement to now and then at constant velocity."""
    speed = actor["speed_mps"] if actor["speed_mps"] >= PREDICTED_STANDS_MPS else 0.0
    heading = actor["heading_rad"]
    velocity = speed * np.array([math.cos(heading), math.sin(heading)])
    now = np.array([actor["x"], actor["y"]]) + late_s * velocity
    shape = Rectangle(max(actor["length_m"], 0.3), max(actor["width_m"], 0.3))
    start = InitialState(
        time_step=0, position=now, orientation=heading, velocity=speed, acceleration=0.0, yaw_rate=0.0, slip_angle=0.0
    )
    if actor["kind"] == "obstacle":
        return StaticObstacle(number, ObstacleType.CONSTRUCTION_ZONE, shape, start)
    states = [
        CustomState(time_step=k, position=now + k * DT_S * velocity, orientation=heading, velocity=speed)
        for k in range(1, PREDICTED_STEPS + 1)
    ]
    prediction = TrajectoryPrediction(Trajectory(1, states), shape)
    return DynamicObstacle(number, _TYPES[actor["kind"]], shape, start, prediction)
