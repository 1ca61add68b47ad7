"""The road network's geometry, against coordinates computed by hand and against CARLA's routes."""

import math
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.roads.polyline import Polyline
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.compile.roads.walkways import Walkways, walkways
from foresee_dsl.errors import CompileError
from foresee_dsl.helps import Help
from foresee_dsl.language.model import EdgeRoute, Leg, Route
from tests.support.worlds import PLAIN, four_arms, net_of

HALF_LANE = 1.65


@pytest.fixture(scope="module")
def road():
    return read_network(net_of(PLAIN))


@pytest.fixture(scope="module")
def wide():
    """The same with two lanes from the west."""
    return read_network(net_of(four_arms(median=0, via=())))


def go(start, *legs):
    return Route(start=start, legs=tuple(Leg(turn=turn, junction=junction) for turn, junction in legs))


def test_reads_lanes_with_their_users(road):
    sidewalk, lane = road.edges["south"].lanes
    assert (sidewalk.kinds, lane.kinds) == ({"pedestrian"}, {"bus", "car", "bicycle"})
    assert (lane.width_m, lane.speed_mps) == (3.3, pytest.approx(50 / 3.6, abs=0.01))
    assert (road.edges["south"].start, road.edges["south"].end) == ("south_end", "j4")


def test_knows_who_yields_to_whom(road):
    by_way = {(m.from_edge, m.turn): m for m in road.movements if "car" in m.kinds}
    left, oncoming = by_way["south", "left"], by_way["north", "straight"]
    j4 = road.junctions["j4"]
    assert j4.conflicts(left.index, oncoming.index) and j4.conflicts(oncoming.index, left.index)
    assert j4.yields(left.index, oncoming.index) and not j4.yields(oncoming.index, left.index)
    assert not j4.conflicts(by_way["south", "straight"].index, oncoming.index)
    assert len(left.via) == 2, "who turns left may wait in the middle"


def test_a_broken_net_is_refused(tmp_path):
    (tmp_path / "a.net.xml").write_text("<nodes/>")
    with pytest.raises(CompileError, match="SUMO network"):
        read_network(tmp_path / "a.net.xml")


@pytest.mark.parametrize(
    ("start", "turn", "end"),
    [("south", "straight", "north_back"), ("south", "left", "west_back"), ("south", "right", "east_back")],
)
def test_turns_are_those_of_the_driver(road, start, turn, end):
    assert road.route_edges(go(start, (turn, "j4"))) == (start, end)


def test_a_route_without_turns_is_its_edge(road):
    assert road.route_edges(go("south_back")) == ("south_back",)


@pytest.mark.parametrize(
    ("route", "message", "help"),
    [
        (go("soth", ("straight", "j4")), "no road or edge called soth", "'south'"),
        (go("south", ("straight", "j5")), "no junction called j5", "j4"),
        (go("south", ("back", "j4")), "from south, vehicles can go straight or left or right over j4, not back", ""),
        (go("south", ("straight", "north_end")), "south does not lead to north_end", "leads to j4"),
        (go("south", ("left", "j4"), ("left", "j4")), "after west_back comes west_end, not j4", "west_end"),
        (EdgeRoute(edges=("south", "nort_back")), "no edge called nort_back", "'north_back'"),
        (EdgeRoute(edges=("south", "east")), "south does not lead to east", "it leads to north_back, west_back"),
    ],
)
def test_impossible_routes_say_what_is_possible(road, route, message, help):
    with pytest.raises(RouteError, match=message) as found:
        road.route_edges(route)
    assert help in Help.of(found.value.help).text


def test_gaps_are_filled_with_the_shortest_way(road):
    short = EdgeRoute(edges=("west", "south_back"), shortest=True)
    assert road.route_edges(short) == ("west", "south_back")
    assert road.shortest_route("north", "east_back") == ("north", "east_back")


def test_locates_places_along_edges(road):
    x, y, heading = road.locate("south", 30)
    assert (x, y, math.degrees(heading)) == pytest.approx((HALF_LANE, -90, 90), abs=1e-6)
    x, y, heading = road.locate("west", 30, 3.5)
    assert (x, y, math.degrees(heading)) == pytest.approx((-90, -HALF_LANE + 3.5, 0), abs=1e-6)
    assert road.locate("south_back", -10)[:2] == pytest.approx((-HALF_LANE, -110), abs=1e-6)
    with pytest.raises(RouteError, match="south is only"):
        road.locate("south", 500)


def test_the_line_straight_on_is_straight(road):
    line = road.line(("south", "north_back"))
    assert line.length_m == pytest.approx(240, abs=1e-6)
    assert np.allclose(line.points[:, 0], HALF_LANE) and np.allclose(line.heading, math.pi / 2)
    assert np.diff(line.s).max() <= 1.0 + 1e-9
    assert line.at(100) == pytest.approx((HALF_LANE, -20, math.pi / 2))
    assert np.allclose(line.left_m, HALF_LANE) and np.allclose(line.right_m, HALF_LANE)
    (passage,) = line.passages
    assert (passage.junction, passage.turn) == ("j4", "straight")
    end_of_south = road.edges["south"].lanes[1].line.length_m
    assert (passage.entry_s, passage.exit_s) == pytest.approx((end_of_south, 240 - end_of_south), abs=1e-6)
    assert line.lane_at(50) == "south_1" and line.lane_at(120).startswith(":j4") and line.lane_at(200) == "north_back_1"
    assert passage.signal == f"j4:{passage.movement.link}"


def test_left_turns_turn_left_by_a_quarter(road):
    line = road.line(("south", "west_back"))
    assert line.heading[-1] - line.heading[0] == pytest.approx(math.pi / 2, abs=1e-6)
    assert line.curvature.max() > 0.05 and line.curvature.min() > -0.05
    assert line.at(line.length_m)[:2] == pytest.approx((-120, HALF_LANE), abs=1e-6)


def test_a_line_can_begin_before_and_end_after_its_route(road):
    line = road.line(("north_back",), behind_m=10, beyond_m=50)
    assert line.edges == ("north_back",) and line.origin_s == pytest.approx(10, abs=1e-6)
    assert line.end_s == line.length_m, "north_back is a dead end"
    assert road.line(("south",), beyond_m=20).edges == ("south", "north_back")


def test_changes_lane_where_the_turn_asks_for_it(wide):
    lanes = wide.edges["west"].for_kind("car")
    left = wide.route_edges(go("west", ("left", "j4")))
    line = wide.line(left, start_lane=lanes[0].id)
    lateral = [line.at(s)[1] - lanes[0].line.at(s)[1] for s in (5, 10, 60, 100)]
    assert lateral == pytest.approx([0, 0, 3.3, 3.3], abs=1e-3)
    assert np.abs(line.curvature[line.s < 100]).max() * 13.9**2 < 2.5, "comfortable sideways"
    assert (line.left_m[0], line.right_m[0]) == pytest.approx((1.65 + 3.3, 1.65))
    late = wide.line(left, start_lane=lanes[0].id, after_m=50.0)
    assert late.at(49)[1] == pytest.approx(lanes[0].line.at(49)[1], abs=1e-3)


def test_no_change_of_lane_where_none_is_needed(wide):
    right = wide.line(wide.route_edges(go("west", ("right", "j4"))))
    assert {lane for _, lane in right.pieces if lane.startswith("west")} == {"west_1"}


def test_finds_the_nearest_lane_that_points_the_same_way(road):
    found = road.nearest_lane(HALF_LANE + 0.3, -50, math.pi / 2)
    assert (found.lane.id, found.lateral_m, found.pos_m) == ("south_1", pytest.approx(-0.3), pytest.approx(70))
    assert road.nearest_lane(HALF_LANE, -50, -math.pi / 2).lane.id == "south_back_1"
    assert road.nearest_lane(60, 60, within_m=10) is None
    assert road.nearest_lane(0.4, -3.0, 0.0).lane.internal


@pytest.mark.parametrize(
    ("point", "inside"),
    [
        ((HALF_LANE, -60), True),
        ((3.25, -60), True),
        ((0.0, 0.0), True),
        ((0.0, 60), True),  # between the two directions
        ((4.3, -60), False),  # the sidewalk
        ((20, 20), False),
        ((9.0, 9.0), False),  # a corner
        ((-HALF_LANE, -8.0), True),  # a crossing
    ],
)
def test_knows_the_road_from_the_sidewalk(road, point, inside):
    assert bool(road.off_road_depth(np.array([point]))[0] == 0) is inside


def test_says_how_far_off_the_road(road):
    assert road.off_road_depth(np.array([(6.3, -60.0), (0.0, 0.0)])) == pytest.approx([3.0, 0.0], abs=0.01)


@given(s=st.floats(0, 235), offset=st.floats(-2.5, 2.5), hint=st.floats(-5, 5))
@settings(max_examples=60, deadline=None)
def test_projecting_undoes_locating(s, offset, hint):
    line = read_network(net_of(PLAIN)).line(("south", "north_back"))
    x, y, _ = line.at(s, offset)
    assert line.project(x, y, s + hint) == pytest.approx((s, offset), abs=1e-6)
    assert line.project(x, y) == pytest.approx((s, offset), abs=1e-6)


def test_a_wrong_hint_does_not_mislead(road):
    line = road.line(("south", "west_back"))
    x, y, _ = line.at(200, 0.5)
    assert line.project(x, y, 20.0) == pytest.approx((200, 0.5), abs=1e-6)
    assert line.project(*line.at(line.length_m + 3)[:2], line.length_m)[0] == pytest.approx(line.length_m + 3, abs=1e-6)
    assert line.project(HALF_LANE, -124, 0)[0] == pytest.approx(-4)


def test_slips_of_maps_do_not_turn_a_line_back():
    spike = Polyline.of(np.array([(0.0, 0.0), (10.0, 0.0), (9.9, 0.01), (20.0, 0.0)]))
    assert np.abs(spike.heading).max() < 0.01


def test_walks_stay_on_footways_and_name_their_crossings(road):
    ways = walkways(road)
    assert len(ways.sidewalks) == 8 and len(ways.crossings) == 4
    walk = ways.walk((4.3, -60), 600, np.random.default_rng(3))
    assert np.hypot(*np.diff(walk, axis=0).T).sum() >= 600
    assert np.hypot(*np.subtract(walk[0], (4.3, -60))) < 0.1
    assert ways.stops_on(walk), "600 m on arms of 110 m lead over a crossing"
    s = np.concatenate(([0], np.cumsum(np.hypot(*np.diff(walk, axis=0).T))))
    for enter_s, exit_s, tls, link in ways.stops_on(walk):
        assert tls == "j4" and link in {c.link for c in road.crossings.values()}
        middle = (enter_s + exit_s) / 2
        x, y = (np.interp(middle, s, values) for values in zip(*walk, strict=True))
        assert road.off_road_depth(np.array([(x, y)]))[0] == 0
    again = ways.walk((4.3, -60), 600, np.random.default_rng(3))
    assert walk == again


def test_every_route_of_a_real_town_connects(carla):
    """CARLA's 120 routes on Town10HD: their waypoints lie on lanes (0.05 m), and every line stays on the road."""
    road = read_network(foreign_net(carla / "maps" / "xodr" / "Town10HD.xodr"))
    seen = 0
    for file in sorted((carla / "routes").glob("*/Town10HD_*.xml")):
        for route in ET.parse(file).getroot():
            ends = [(float(w.get("x")), -float(w.get("y")), -math.radians(float(w.get("yaw")))) for w in route]
            near = [road.nearest_lane(*end) for end in ends]
            assert max(abs(n.lateral_m) for n in near) < 0.1
            edges = way_between(road, near[0].lane, near[1].lane)
            line = road.line(edges, start_lane=near[0].lane.id, behind_m=10, beyond_m=80)
            assert np.hypot(*np.diff(line.points, axis=0).T).max() <= 1.5
            assert np.degrees(np.abs(np.diff(line.heading)).max()) < 30
            assert road.off_road_depth(line.points).max() == 0
            (start, beside), (end, _) = (line.project(x, y) for x, y, _ in ends)
            assert abs(beside) < 0.1 and start < end
            seen += 1
    assert seen == 120


def way_between(road, first, last):
    begin, lead = first.edge, ()
    if first.internal:
        movement = next(m for m in road.movements if first.id in m.via)
        begin, lead = movement.to_edge, (movement.from_edge,)
    end = next(m.to_edge for m in road.movements if last.id in m.via) if last.internal else last.edge
    return (*lead, *road.shortest_route(begin, end))


def test_a_footway_leads_on_across_a_walking_area() -> None:
    area = ("area", -1)
    ways = Walkways(
        {"a": ((0.0, 0.0), (9.0, 0.0)), "b": ((9.0, 1.0), (9.0, 9.0))}, {}, ((("a", 1), area), (area, ("b", 0)))
    )
    assert ways.neighbours[area] == {("a", 1): None, ("b", 0): None}
    assert ways._onward(("a", 1)) == [("b", 0)]
    walk = ways.walk((2.0, -1.0), 30.0, np.random.default_rng(2))
    assert walk is not None and {(0.0, 0.0), (9.0, 0.0), (9.0, 9.0)} <= set(walk)  # from end to end
