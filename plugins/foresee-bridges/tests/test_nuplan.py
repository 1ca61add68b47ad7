"""Planners of nuPlan as drivers; needs nuplan-devkit, which is on no package index."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("nuplan", reason="nuplan-devkit is not installed (docs/guide/nuplan.md says how)")

import itertools

from foresee_bridges.nuplan import states
from foresee_bridges.nuplan.geometry import time_us
from foresee_bridges.nuplan.map_api import MapLacksError, RoadsMap
from foresee_bridges.nuplan.roads import Roads
from nuplan.common.actor_state.state_representation import Point2D
from nuplan.common.actor_state.tracked_objects_types import TrackedObjectType
from nuplan.common.maps.maps_datatypes import SemanticMapLayer, TrafficLightStatusType

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers import consent
from foresee_dsl.drivers.protocol import Control, EgoState, SeenActor
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError
from foresee_dsl.files import data_folder
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.episode import Episode

CASE = f"{data_folder('scenarios') / 'scenario3.foresee'}::r01"
PLANNER = """
import numpy as np
from nuplan.common.actor_state.ego_state import EgoState
from nuplan.common.actor_state.state_representation import Point2D, StateSE2, StateVector2D, TimePoint
from nuplan.common.maps.maps_datatypes import SemanticMapLayer
from nuplan.planning.simulation.observation.observation_type import DetectionsTracks
from nuplan.planning.simulation.planner.abstract_planner import AbstractPlanner
from nuplan.planning.simulation.trajectory.interpolated_trajectory import InterpolatedTrajectory

class Along(AbstractPlanner):
    '''Drives along the route's leftmost lanes, and stops for objects in front.'''

    def __init__(self, speed_mps):
        self.speed_mps = speed_mps

    def name(self):
        return "along"

    def observation_type(self):
        return DetectionsTracks

    def initialize(self, initialization):
        self.map, self.path = initialization.map_api, []
        blocks = [
            self.map.get_map_object(n, SemanticMapLayer.ROADBLOCK)
            or self.map.get_map_object(n, SemanticMapLayer.ROADBLOCK_CONNECTOR)
            for n in initialization.route_roadblock_ids
        ]
        self.blocks = blocks

    def lanes(self, ego):
        lane = next(e for e in self.blocks[0].interior_edges + self.blocks[1].interior_edges
                    if e.contains_point(ego.center))
        while lane is not None:
            yield lane
            route = [block.id for block in self.blocks]
            lane = next((e for e in lane.outgoing_edges if e.get_roadblock_id() in route), None)

    def compute_planner_trajectory(self, current_input):
        ego, objects = current_input.history.current_state
        if not self.path:
            self.path = [pose for lane in self.lanes(ego) for pose in lane.baseline_path.discrete_path]
        points = np.array([(p.x, p.y) for p in self.path])
        nearest = int(np.hypot(*(points - (ego.rear_axle.x, ego.rear_axle.y)).T).argmin())
        ahead = points[nearest + 2 : nearest + 28]
        blocked = any(
            np.hypot(*(ahead - (o.center.x, o.center.y)).T).min() < 3.5 for o in objects.tracked_objects.tracked_objects
        ) if len(ahead) else False
        speed = 0.0 if blocked else self.speed_mps
        s = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
        states = []
        for k in range(21):
            at = s[nearest] + 0.2 * k * speed
            i = min(int(np.searchsorted(s, at)), len(s) - 1)
            pose = StateSE2(np.interp(at, s, points[:, 0]), np.interp(at, s, points[:, 1]), self.path[i].heading)
            states.append(EgoState.build_from_rear_axle(
                pose, StateVector2D(0.0, 0.0), StateVector2D(0.0, 0.0), 0.0,
                TimePoint(ego.time_us + 200_000 * k), ego.car_footprint.vehicle_parameters))
        return InterpolatedTrajectory(states)
"""


@pytest.fixture
def address(tmp_path: Path) -> str:
    file = tmp_path / f"planner_{tmp_path.name}.py"
    file.write_text(PLANNER)
    return f"nuplan:{file}:Along:{{speed_mps: 9}}"


@pytest.fixture(scope="module")
def town() -> RoadsMap:
    mission = Episode(compile_test_case(load_test_case(CASE))).mission
    assert mission.road_map is not None
    return RoadsMap(Roads(mission.road_map))


def test_a_planner_drives_and_repeats_itself_in_another_process(address: str) -> None:
    consent.allow(address)
    here = run_test_case(load_test_case(CASE), driver=address, seed=0)
    assert here.verdict.value == "pass", here.reason
    command = [sys.executable, "-m", "foresee_dsl", "run", CASE, "--driver", address, "--json"]
    done = subprocess.run(
        command, env=os.environ | {"PYTHONHASHSEED": "3"}, capture_output=True, text=True, check=False
    )
    assert here.trace.digest in done.stdout, done.stdout + done.stderr
    assert json.loads(done.stdout)


def test_the_history_is_full_at_the_first_step(address: str) -> None:
    consent.allow(address)
    driver: Any = load_driver(address)
    episode = Episode(compile_test_case(load_test_case(CASE)))
    driver.reset(episode.mission, episode.vehicle, 0)
    plan = driver.step(episode.observation)
    times = [state.time_us for state in driver._egos]
    assert len(times) == 21 and set(np.diff(times)) == {100_000} and times[-1] == time_us(0.0)
    ego, last = episode.observation.ego, driver._egos[-1]
    assert (last.center.x, last.center.y, last.center.heading) == pytest.approx((ego.x, ego.y, ego.heading_rad))
    assert math.dist((last.rear_axle.x, last.rear_axle.y), (ego.x, ego.y)) > 1
    episode.step(Control(0.0, 0.0, 0.0))
    assert driver.step(episode.observation) is plan, "nuPlan plans every 0.1 s"


def test_objects_have_velocities_over_ground() -> None:
    actors = (
        SeenActor(7, "van", 1.0, 2.0, math.pi / 2, 3.0, 5.0, 2.0),
        SeenActor(8, "obstacle", 4.0, 2.0, 0.0, 0.0, 1.0, 1.0),
        SeenActor(9, "pedestrian", 4.0, 5.0, math.pi, 1.0, 0.5, 0.5),
    )
    objects = states.tracks(actors, 1.0).tracked_objects
    (van,) = objects.get_tracked_objects_of_type(TrackedObjectType.VEHICLE)
    assert (van.velocity.x, van.velocity.y) == pytest.approx((0, 3), abs=1e-9)
    assert van.metadata.track_id == 7 and van.box.length == 5.0 and van.metadata.timestamp_us == time_us(1.0)
    assert len(objects.get_static_objects()) == 1 and len(objects.get_agents()) == 2


def test_an_ego_state_turns_about_its_rear_axle() -> None:
    vehicle = Episode(compile_test_case(load_test_case(CASE))).vehicle
    parameters = states.vehicle_parameters(vehicle)
    ego = EgoState(10.0, 20.0, 0.3, 8.0, 1.0, 0.4, 0.1)
    state = states.ego_state(ego, 2.0, vehicle, parameters)
    assert (state.center.x, state.center.y) == pytest.approx((10, 20))
    assert (parameters.length, parameters.width) == pytest.approx((vehicle.length_m, vehicle.width_m))
    rear = state.dynamic_car_state.rear_axle_velocity_2d
    centre = state.dynamic_car_state.center_velocity_2d
    assert (rear.x, rear.y) == (8.0, 0.0) and centre.y == pytest.approx(0.4 * parameters.rear_axle_to_center)


def test_the_map_answers_what_planners_ask(town: RoadsMap) -> None:
    blocks = [
        town.get_map_object(n, SemanticMapLayer.ROADBLOCK)
        or town.get_map_object(n, SemanticMapLayer.ROADBLOCK_CONNECTOR)
        for n in town.roads.route
    ]
    for before, after in itertools.pairwise(blocks):
        assert after.id in {block.id for block in before.outgoing_edges}
        assert before.id in {block.id for block in after.incoming_edges}
    lane = blocks[0].interior_edges[0]
    pose = lane.baseline_path.discrete_path[5]
    point = Point2D(pose.x, pose.y)
    assert town.get_one_map_object(point, SemanticMapLayer.LANE).id == lane.id and lane.contains_point(point)
    assert lane.parent.id == blocks[0].id and lane.index() == 1 and not lane.has_traffic_lights()
    assert town.is_in_layer(point, SemanticMapLayer.DRIVABLE_AREA)
    assert town.get_distance_to_nearest_map_object(point, SemanticMapLayer.ROADBLOCK) == (blocks[0].id, 0.0)
    left, right = lane.get_width_left_right(point)
    assert left == pytest.approx(right, abs=0.05) and lane.oriented_distance(point) == 0.0
    near = town.get_proximal_map_objects(point, 400.0, list(town.get_available_map_objects()))
    assert near[SemanticMapLayer.CROSSWALK] and near[SemanticMapLayer.STOP_LINE] and near[SemanticMapLayer.WALKWAYS]
    assert near[SemanticMapLayer.CARPARK_AREA] == []
    crossing = next(block for block in blocks if block.intersection is not None and block.interior_edges[0].stop_lines)
    connector = crossing.interior_edges[0]
    junction = crossing.intersection
    assert {block.id for block in junction.interior_edges} >= {crossing.id}
    (stop,) = connector.stop_lines[:1]
    assert stop.parent.id in {block.id for block in crossing.incoming_edges}
    assert stop.intersection_from.id == junction.id
    curve = next(edge for edge in near[SemanticMapLayer.LANE_CONNECTOR] if edge.turn_type.name == "LEFT").baseline_path
    assert curve.get_curvature_at_arc_length(curve.length / 2) > 0.02


def test_neighbours_are_adjacent(town: RoadsMap) -> None:
    wide = next(block for block in town.roads.roadblocks.values() if len(block.lanes) > 1 and block.junction is None)
    left, right = town.roadblock(wide.id).interior_edges[:2]
    assert left.is_left_of(right) and right.is_right_of(left) and left.is_adjacent_to(right)
    assert left.adjacent_edges[1].id == right.id and right.adjacent_edges[0].id == left.id
    assert [edge.id for edge in left.parallel_edges][:2] == [left.id, right.id]


def test_what_the_map_does_not_hold_is_an_error(town: RoadsMap) -> None:
    for ask in (
        lambda: town.get_map_object("1", SemanticMapLayer.STOP_SIGN),
        lambda: town.get_proximal_map_objects(Point2D(0, 0), 5.0, [SemanticMapLayer.PUDO]),
        lambda: town.get_raster_map([SemanticMapLayer.DRIVABLE_AREA]),
        lambda: town.get_distance_to_nearest_raster_layer(Point2D(0, 0), SemanticMapLayer.DRIVABLE_AREA),
    ):
        with pytest.raises(MapLacksError, match="which it does not hold; it holds LANE, LANE_CONNECTOR"):
            ask()


def test_signals_give_the_status_of_lane_connectors(town: RoadsMap) -> None:
    signals = town.roads.signals()
    key, ids = next(iter(sorted(signals.items())))
    lights = states.traffic_lights({key: "amber", "elsewhere:1": "red"}, signals, 3.0)
    assert [str(light.lane_connector_id) for light in lights] == list(ids)
    assert {light.status for light in lights} == {TrafficLightStatusType.YELLOW}


def test_planners_that_need_more_are_refused(address: str, tmp_path: Path) -> None:
    file = tmp_path / f"oracle_{tmp_path.name}.py"
    file.write_text(
        f"{PLANNER}\n    requires_scenario = False\nclass Oracle(Along):\n    requires_scenario = True\n"
        "class Eyes(Along):\n    def observation_type(self):\n"
        "        from nuplan.planning.simulation.observation.observation_type import Sensors\n        return Sensors\n"
        "class Odd(Along):\n    def compute_planner_trajectory(self, current_input):\n        return None\n"
    )
    episode = Episode(compile_test_case(load_test_case(CASE)))
    for name, message in (("Oracle", "needs a recorded scenario"), ("Eyes", "needs camera or lidar data")):
        consent.allow(where := f"nuplan:{file}:{name}:{{speed_mps: 9}}")
        with pytest.raises(DriverError, match=message):
            load_driver(where).reset(episode.mission, episode.vehicle, 0)
    consent.allow(where := f"nuplan:{file}:Odd:{{speed_mps: 9}}")
    odd = load_driver(where)
    odd.reset(episode.mission, episode.vehicle, 0)
    with pytest.raises(DriverError, match="returns a trajectory of ego states"):
        odd.step(episode.observation)
    consent.allow(where := f"nuplan:{file}:Along")
    with pytest.raises(DriverError, match="speed_mps"):
        load_driver(where)
