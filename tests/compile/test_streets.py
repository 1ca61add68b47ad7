"""Roundabouts, ramps, zebra crossings, bumps and rules of turns, built by the real netconvert and driven."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.foreign.geometry_faults import CheckedGeometry
from foresee_dsl.compile.roads.polyline import distance
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.runner import run

HERE = Path(__file__).with_name("streets")


@pytest.fixture(scope="module")
def town():
    return compile_test_case(load_test_case(str(HERE / "through_town.foresee")))


@pytest.fixture(scope="module")
def motorway():
    return compile_test_case(load_test_case(str(HERE / "along_the_motorway.foresee")))


@pytest.fixture(scope="module")
def left_over_the_ring():
    return compile_test_case(load_test_case(f"{HERE / 'over_the_ring.foresee'}::left"))


def ways(network, edge):
    """Where each lane for cars leads, from the right: the turns."""
    lanes = network.edges[edge].for_kind("car")
    movements = network.movements_from(edge)
    return [sorted({m.turn for m in movements if m.from_lane == lane.id}) for lane in lanes]


def test_no_lane_has_a_kink_or_a_gap(town, motorway):
    for network in (town.network, motorway.network):
        assert not CheckedGeometry.of(network).faults
        for movement in (m for m in network.movements if "car" in m.kinds):
            parts = [network.lanes[name].shape for name in (movement.from_lane, *movement.via, movement.to_lane)]
            assert all(distance(a[-1], b[0]) < 0.2 for a, b in itertools.pairwise(parts)), movement.ends


def test_a_cut_edge_keeps_its_name(town):
    network = town.network
    assert network.parts["west"] == ("west#1", "west#2")
    assert network.edges["west#1"].end == "school" == network.edges["west_back#2"].start
    whole = network.locate("west", 100)
    assert whole[0] == pytest.approx(-100, abs=0.1)  # 60 m to the crossing, and on behind it
    assert network.locate("west", -20)[0] == pytest.approx(network.edges["west#2"].drivable[0].shape[-1][0] - 20)
    assert town.scene.actors[0].route == ("west#1", "west#2", "east#1", "east#2", "east#3", "east#4")


def test_strips_lie_in_their_order_and_are_for_whom_they_are_meant(town):
    widths = {lane.index: (sorted(lane.kinds), lane.width_m) for lane in town.network.edges["west#1"].lanes}
    assert widths[1] == (["bicycle"], 1.8) and widths[2] == (["bus"], 3.5)
    assert widths[3][0] == widths[4][0] == ["bicycle", "bus", "car"]
    east = town.network.edges["east#1"].lanes
    assert [sorted(lane.kinds) for lane in east] == [["pedestrian"], ["bicycle"], [], *2 * [["bicycle", "bus", "car"]]]
    coach, rider = (next(a for a in town.scene.actors if a.id == name) for name in ("coach", "rider"))
    assert (coach.lane, rider.lane) == ("west#1_2", "west#1_1")
    strips = np.array([town.network.lanes[lane].line.at(30)[:2] for lane in ("west#1_1", "west#1_2", "east#1_1")])
    assert [depth > 0 for depth in town.network.off_road_depth(strips)] == [False, False, True]


def test_a_zebra_crossing_with_an_island_is_two(town):
    over = {crossing.edges for crossing in town.network.crossings_at("school")}
    assert over == {("west#1",), ("west_back#2",)}
    apart = [town.network.edges[e].drivable[-1] for e in ("west#1", "west_back#2")]
    gap = abs(apart[0].shape[-1][1] - apart[1].shape[0][1]) - apart[0].width_m
    assert gap == pytest.approx(2.5, abs=0.01)
    movements = [m for m in town.network.movements_at("school") if "car" in m.kinds]
    junction = town.network.junctions["school"]
    crossings = town.network.crossings_at("school")
    assert all(any(junction.yields(m.index, c.index) for c in crossings) for m in movements)


ZEBRA = """foresee 1

scenario gives_way {
  network {
    junction a at (0 m, 0 m)
    junction b at (200 m, 0 m)
    road west from a to b { sidewalk 2 m }
    zebra school on west at 80 m
  }
  ego: car.sedan {
    route [west]
    start at 40 m along west
    start speed 40 km/h
  }
  pedestrian kid: pedestrian.child {
    path [77 m along west offset -2.7 m, PLACE]
  }
  expect by_outline: never kid within 1 m of school and ego in junction school
  expect by_place: never kid within 4.3 m of 80 m along west offset 1.65 m and ego in junction school
  end after 6 s
}
"""


@pytest.mark.parametrize(
    ("place", "held"),
    [
        ("100 m along west offset -2.7 m", {"by_outline": False, "by_place": True}),  # past it, on the sidewalk
        ("80 m along west offset 3 m", {"by_outline": False, "by_place": False}),  # over it, before the ego
    ],
)
def test_who_walks_past_a_zebra_crossing_is_told_from_who_is_on_it_by_a_place(tmp_path, place, held):
    (file := tmp_path / "zebra.foresee").write_text(ZEBRA.replace("PLACE", place))
    result = run(compile_test_case(load_test_case(str(file))), load_driver("idm"), seed=0)
    assert {e.name: e.held for e in result.expectations} == held


def test_a_bump_is_a_short_piece_with_a_low_limit(town):
    line = next(actor for actor in town.scene.actors if actor.id == "ego").line
    start, end = (line.passage(name).entry_s for name in ("hump", "hump_end"))
    limits = {round(float(line.limits[k]) * 3.6) for k, s in enumerate(line.marks) if start + 1.5 < s < end - 0.5}
    assert limits == {15} and 2 < end - start < 6


def test_turns_are_as_the_rules_say(town):
    assert ways(town.network, "west#2") == [["straight"], ["straight"]]
    assert ways(town.network, "south") == [["right"], ["left", "straight"]]


def test_the_ring_goes_first_and_is_one_junction(left_over_the_ring):
    network = left_over_the_ring.network
    entering = next(m for m in network.movements_from("nw") if m.to_edge.startswith("circle#"))
    movements = network.movements_at("circle_nw")
    on = next(m for m in movements if m.from_edge.startswith("circle#") and m.to_edge.startswith("circle#"))
    junction = network.junctions["circle_nw"]
    assert junction.yields(entering.index, on.index) and not junction.yields(on.index, entering.index)
    line = left_over_the_ring.scene.actors[0].line
    circle, (first, *_) = line.passage("circle"), [p for p in line.passages if p.junction.startswith("circle_")]
    assert circle.entry_s == first.entry_s and circle.exit_s > first.exit_s + 30


def test_ramps_and_the_end_of_a_lane(motorway):
    network = motorway.network
    lanes = [len(network.edges[piece].for_kind("car")) for piece in network.parts["a1"]]
    assert lanes == [3, 4, 3, 2, 3, 2]  # up: a fourth until it ends; the third ends; down: one more until it leaves
    joins = next(m for m in network.movements_from("up"))
    assert network.lanes[joins.to_lane] is network.edges["a1#2"].for_kind("car")[0]
    leaves = next(m for m in network.movements_from("a1#5") if m.to_edge == "down")
    assert leaves.from_lane == network.edges["a1#5"].for_kind("car")[0].id
    kept = {m.from_lane for m in network.movements_from("a1#3")}
    assert [lane.id in kept for lane in network.edges["a1#3"].for_kind("car")] == [True, True, False]


@pytest.mark.parametrize("driver", ["idm", "pdm"])
@pytest.mark.parametrize("bundle", ["town", "motorway", "left_over_the_ring"])
def test_drivers_come_through_beside_traffic(bundle, driver, request):
    result = run(request.getfixturevalue(bundle), load_driver(driver), seed=0)
    assert result.verdict is Verdict.PASS
    assert all(expectation.held for expectation in result.expectations)
