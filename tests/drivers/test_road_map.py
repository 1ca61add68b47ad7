"""The road map of a mission: lanes, borders, connections, stop lines, crossings, and its OpenDRIVE text."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import shapely

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.drivers.external import reset_line
from foresee_dsl.drivers.protocol import Mission
from foresee_dsl.drivers.road_map import RoadMap
from foresee_dsl.errors import DriverError
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.mission import mission_of
from tests.support.driving import SEDAN, line, mission


@pytest.fixture(scope="module")
def bundle(scenarios: Path) -> SumoBundle:
    return compile_test_case(load_test_case(f"{scenarios}/scenario9.foresee::r01"))


@pytest.fixture(scope="module")
def task(bundle: SumoBundle) -> Mission:
    return mission_of(bundle)


@pytest.fixture(scope="module")
def roads(task: Mission) -> RoadMap:
    assert task.road_map is not None
    return task.road_map


def test_borders_are_half_a_width_beside_the_centre(roads: RoadMap) -> None:
    for lane in roads.lanes.values():
        assert lane.centre.shape == lane.left.shape == lane.right.shape
        assert len(lane.centre) >= 2
        centre = shapely.LineString(lane.centre)
        for border in (lane.left, lane.right):
            beside = shapely.distance(centre, shapely.points(border))
            assert beside.max() <= lane.width_m  # a mitred corner
            if len(border) == 2:
                assert np.allclose(beside, lane.width_m / 2)
        ahead = lane.centre[1] - lane.centre[0]
        left = lane.left[0] - lane.centre[0]
        assert ahead[0] * left[1] - ahead[1] * left[0] > 0


def test_connections_fit_together(roads: RoadMap) -> None:
    for lane in roads.lanes.values():
        for name in lane.successors:
            other = roads.lanes[name]
            assert lane.id in other.predecessors
            assert np.hypot(*(lane.centre[-1] - other.centre[0])) < 0.5
        if lane.left_neighbour is not None and "car" in lane.users:
            other = roads.lanes[lane.left_neighbour]
            assert other.right_neighbour == lane.id
            assert np.allclose(lane.left[0], other.right[0], atol=0.3)
        assert (lane.junction is None) == (lane.turn is None)
        assert lane.junction is None or lane.junction in roads.junctions


def test_the_route_leads_along_the_mission(roads: RoadMap, task: Mission) -> None:
    assert set(roads.route) <= set(roads.lanes)
    for here, there in zip(roads.route, roads.route[1:], strict=False):
        lane = roads.lanes[here]
        assert there in (*lane.successors, lane.left_neighbour, lane.right_neighbour)
    near = shapely.MultiLineString([roads.lanes[name].centre for name in roads.route]).buffer(2.5)
    on_way = task.centreline[(task.s >= task.start_s) & (task.s <= task.goal_s)]
    assert shapely.contains_xy(near, *on_way.T).all()


def test_signals_have_the_keys_of_the_observation(scenarios: Path) -> None:
    task = mission_of(compile_test_case(load_test_case(f"{scenarios}/scenario7.foresee::r01")))
    roads = task.road_map
    assert roads is not None
    keys = {passage.signal for passage in task.junctions if passage.signal is not None}
    assert keys
    assert keys <= {lane.signal for name, lane in roads.lanes.items() if name in roads.route}
    assert keys <= {stop.signal for stop in roads.stop_lines if stop.lane in roads.route}


def test_crossings_and_stop_lines_lie_at_their_junctions(roads: RoadMap) -> None:
    assert roads.crossings and roads.stop_lines
    for crossing in roads.crossings:
        outline, junction = shapely.Polygon(crossing.outline), shapely.Polygon(roads.junctions[crossing.junction])
        assert outline.is_valid and outline.distance(junction) < 1.0
    for stop in roads.stop_lines:
        lane = roads.lanes[stop.lane]
        assert np.allclose(stop.points.mean(axis=0), lane.centre[-1], atol=0.01)


def test_the_document_is_json_and_is_not_sent_at_reset(roads: RoadMap, task: Mission) -> None:
    document = json.loads(json.dumps(roads.as_document(), allow_nan=False))
    assert set(document) == {"lanes", "stop_lines", "crossings", "route", "junctions"}
    assert document["lanes"].keys() == roads.lanes.keys()
    assert not {"road_map", "build_map"} & set(json.loads(reset_line(task, SEDAN, 0))["mission"])


def test_it_is_built_once_and_shares_its_lanes(bundle: SumoBundle, task: Mission, roads: RoadMap) -> None:
    again = mission_of(bundle)
    assert "road_map" not in vars(again)
    assert again.road_map is not None and again.road_map is again.road_map
    assert again.road_map.lanes is roads.lanes


def test_it_is_written_as_opendrive(roads: RoadMap) -> None:
    text = roads.opendrive()
    assert "<OpenDRIVE" in text and "<road " in text and "<junction " in text


def test_a_mission_made_by_hand_has_no_map() -> None:
    assert mission(line((60, float("inf")))).road_map is None
    with pytest.raises(DriverError, match="no net file"):
        RoadMap({}, (), (), (), {}).opendrive()
