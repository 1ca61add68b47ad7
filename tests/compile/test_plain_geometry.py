"""Plain numbers instead of shapely and numpy: the same answers."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from foresee_dsl.compile.nets.cache import read_net_once
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.placement.checks import common_area
from foresee_dsl.compile.roads.polyline import Polyline
from tests.support.worlds import PLAIN, net_of

near = st.floats(-6, 6)


def box(x, y, heading, length, width):
    c, s = math.cos(heading), math.sin(heading)
    corners = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    return tuple(
        (x + a * length / 2 * c - b * width / 2 * s, y + a * length / 2 * s + b * width / 2 * c) for a, b in corners
    )


@given(near, near, st.floats(-4, 4), st.floats(0.5, 8), st.floats(0.5, 3))
@settings(max_examples=200, deadline=None)
def test_the_common_area_of_two_boxes_is_shapelys(x, y, heading, length, width):
    one, other = box(0, 0, 0.3, 4.7, 1.8), box(x, y, heading, length, width)
    expected = shapely.Polygon(one).intersection(shapely.Polygon(other)).area
    assert common_area(one, other) == pytest.approx(expected, abs=1e-6)


@given(st.floats(-150, 150), st.floats(-150, 150))
@settings(max_examples=100, deadline=None)
def test_the_nearest_lane_is_shapelys(x, y):
    road = read_network(net_of(PLAIN))
    lanes = [lane for lane in road.lanes.values() if "car" in lane.kinds and lane.edge not in road.walking_areas]
    away = {lane.id: shapely.LineString(lane.shape).distance(shapely.Point(x, y)) for lane in lanes}
    nearest = min(lanes, key=lambda lane: away[lane.id])
    assert road.distance_to_lanes(x, y) == pytest.approx(max(away[nearest.id] - nearest.width_m / 2, 0), abs=1e-6)
    far = min(shapely.LineString(lane.shape).distance(shapely.Point(x, y)) for lane in road.lanes.values()) > 30
    assert (road.far_from_lanes([(x, y)], 30.0) is not None) == far


def test_arrays_are_the_plain_numbers():
    line = Polyline.of(np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 5.0)]))
    assert line.points.tolist() == [list(point) for point in line.xy] and line.points.shape == (16, 2)
    assert line.s.tolist() == list(line.marks) and line.heading.tolist() == list(line.angles)
    assert line.project(4.3, -2.0) == pytest.approx((4.3, -2.0))


def test_a_net_is_read_once():
    net = net_of(PLAIN)
    first, again = (read_net_once(net, None) for _ in range(2))
    assert first[1] == again[1]
    assert [lane.shape for lane in first[0].lanes.values()] == [lane.shape for lane in again[0].lanes.values()]
