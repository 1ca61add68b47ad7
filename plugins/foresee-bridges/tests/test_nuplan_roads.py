"""nuPlan's order of roads and its states, as far as they need no nuplan-devkit."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from foresee_bridges.nuplan import creating, geometry
from foresee_bridges.nuplan.driver import PlannerDriver, _earlier, _goal
from foresee_bridges.nuplan.roads import BEYOND_M, Roads, lane_area, length_of, sampled, stop_line_area

from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.protocol import EgoState, Mission, VehicleLimits
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError
from foresee_dsl.files import data_folder
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.episode import Episode

TURN = f"{data_folder('scenarios') / 'scenario9.foresee'}::r01"


@cache
def roads() -> tuple[Roads, Mission, VehicleLimits]:
    episode = Episode(compile_test_case(load_test_case(TURN)))
    assert episode.mission.road_map is not None
    return Roads(episode.mission.road_map), episode.mission, episode.vehicle


def test_parallel_lanes_are_a_roadblock_from_left_to_right() -> None:
    town, _, _ = roads()
    numbers = [*town.lane_ids.values(), *town.roadblocks]
    assert len(set(numbers)) == len(numbers) and all(number.isdecimal() for number in numbers)
    assert all("car" in lane.users for lane in town.lanes.values())
    wide = [block for block in town.roadblocks.values() if len(block.lanes) > 1 and block.junction is None]
    assert len(wide) > 5
    for block in wide:
        first, second = (town.lanes[name] for name in block.lanes[:2])
        assert first.right_neighbour == second.id and second.left_neighbour == first.id
        assert np.abs(first.right - second.left).max() < 0.02, "neighbours share a border"
    connectors = [block for block in town.roadblocks.values() if block.junction is not None]
    assert all(town.lanes[name].junction == block.junction for block in connectors for name in block.lanes)


def test_the_route_leads_through_connected_roadblocks_beyond_the_goal() -> None:
    town, mission, _ = roads()
    blocks = [town.roadblocks[number] for number in town.route]
    assert len(blocks) > len(town.road_map.route) and blocks[0].junction is None
    for before, after in itertools.pairwise(blocks):
        ways = {name for lane in before.lanes for name in town.lanes[lane].successors}
        assert ways & set(after.lanes)
    own = {town.roadblock_of[name] for name in town.road_map.route}
    further = [block for block in blocks if block.id not in own]
    assert sum(length_of(town.lanes[block.lanes[0]].centre) for block in further) > BEYOND_M
    x, y, heading = _goal(mission)
    at = int(np.abs(mission.s - mission.goal_s).argmin())
    assert math.dist((x, y), mission.centreline[at]) < 1
    ahead = mission.centreline[at + 1] - mission.centreline[at]
    assert math.remainder(heading - math.atan2(ahead[1], ahead[0]), 2 * math.pi) == pytest.approx(0, abs=0.05)


def test_areas_cover_their_lanes() -> None:
    from shapely.geometry import Point

    town, _, _ = roads()
    for block in town.roadblocks.values():
        area = town.area(block.lanes)
        lanes = [town.lanes[name] for name in block.lanes]
        assert area.is_valid and area.area > 0.9 * max(lane_area(lane).area for lane in lanes)
        for lane in lanes:
            middle = sampled(lane.centre)
            x, y, _ = middle[len(middle) // 2]
            assert area.contains(Point(x, y)), lane.id
    line = next(iter(town.road_map.stop_lines))
    assert stop_line_area(line.points).area == pytest.approx(0.5 * np.hypot(*(line.points[1] - line.points[0])))


def test_baseline_paths_are_dense_and_point_ahead() -> None:
    path = sampled(np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 4.5]]))
    gaps = np.hypot(*np.diff(path[:, :2], axis=0).T)
    assert gaps.max() <= 1.0 and path[0].tolist() == [0, 0, 0] and path[-1, :2].tolist() == [10, 4.5]
    assert path[10].tolist() == pytest.approx([10, 0, math.pi / 2])


def test_signals_are_known_by_the_keys_of_the_observation() -> None:
    town, mission, _ = roads()
    keys = {junction.signal for junction in mission.junctions} - {None}
    assert keys and keys <= set(town.signals())
    on_route = {town.lane_ids[name] for name in town.road_map.route}
    first = mission.junctions[0]
    assert first.signal is None or on_route & set(town.signals()[first.signal])


def test_the_rear_axle_is_behind_the_centre() -> None:
    _, _, car = roads()
    behind = car.rear_axle_m
    # rear overhang + wheelbase + front overhang = length, so the rear axle is this far before the rear bumper
    assert car.length_m / 2 - behind == pytest.approx(car.length_m - car.wheelbase_m - car.front_overhang_m)
    x, y = geometry.rear_axle(10.0, 20.0, math.pi / 2, car)
    assert (x, y) == pytest.approx((10, 20 - behind))
    back = geometry.centres(np.array([[x, y]]), np.array([math.pi / 2]), car)
    assert back == pytest.approx(np.array([[10, 20]]))


def test_times_are_whole_microseconds_and_never_negative() -> None:
    assert geometry.time_us(-2.0) >= 0 and isinstance(geometry.time_us(0.05), int)
    times = np.array([geometry.time_us(t) for t in (-2.0, 0.0, 0.05, 31.4)], dtype=np.float64)
    assert geometry.time_s(times) == pytest.approx([-2.0, 0.0, 0.05, 31.4])


def test_the_history_before_the_first_step_is_straight() -> None:
    ego = EgoState(5.0, 0.0, math.pi / 2, 10.0, 1.0, 0.1, 0.0)
    earlier = _earlier(ego, 2.0)
    assert (earlier.x, earlier.y) == pytest.approx((5, -20)) and replace(earlier, x=5.0, y=0.0) == ego


def test_addresses_that_name_no_planner_are_refused(tmp_path: Path) -> None:
    (tmp_path / "plain.yaml").write_text("a: 1\n")
    (tmp_path / "broken.yaml").write_text("a: [\n")
    (tmp_path / "linked.yaml").write_text("p:\n  _target_: builtins.dict\n  a: ${other}\n")
    (tmp_path / "nested.yaml").write_text("p:\n  _target_: builtins.dict\n  a: {_target_: builtins.list}\n  b: [1]\n")
    for argument, message in (
        ("planner", "names no planner; write nuplan:MODULE:CLASS"),
        (f"{tmp_path / 'gone.yaml'}", "No such file"),
        (f"{tmp_path / 'plain.yaml'}", "has no _target_"),
        (f"{tmp_path / 'broken.yaml'}", "are not YAML"),
        (f"{tmp_path / 'linked.yaml'}", "refers to other configurations"),
        ("builtins:nothing_there", "nothing_there"),
        ("builtins:dict:[1]", "names with values"),
        ("nowhere_at_all:Planner", "nowhere_at_all"),
    ):
        with pytest.raises(DriverError, match=message):
            creating.new_planner(argument)
    assert creating.new_planner(f"{tmp_path / 'nested.yaml'}")[0] == {"a": [], "b": [1]}
    assert creating.new_planner('builtins:dict:{"a": 2}')[0] == {"a": 2}


def test_without_nuplan_the_message_says_how_to_install_it() -> None:
    try:
        PlannerDriver.from_argument("builtins:dict")
    except DriverError as err:
        assert "pip install 'foresee-bridges[nuplan]'" in str(err)
    with pytest.raises(DriverError, match="is a program, which starts only with your consent"):
        load_driver("nuplan:builtins:dict")
