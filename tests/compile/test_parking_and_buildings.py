"""Parked vehicles, parking strips and buildings."""

import math

import pytest
from shapely import Polygon

from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.nets.network_builder import build_network
from foresee_dsl.compile.placement.checks import footprint
from foresee_dsl.errors import CompileError
from foresee_dsl.language.model import Building
from tests.support.worlds import EGO, four_arms, net_of, point, problems_of, scene_of

WALKER = "pedestrian walker: pedestrian.adult {{ path [{}] }}\n"
STREET = four_arms(median=0, via=(), parking=2.2)


def parked(count, seed=3, within=150):
    lines = (f"count {count}", "models [obstacle.parked_car]", f"within {within} m of ego.route", f"seed {seed}")
    scene = scene_of(EGO + "traffic row {\n" + "\n".join(lines) + "\n}\n", STREET)
    return scene, [a for a in scene.actors if a.id.startswith("row")]


def test_a_strip_lies_between_lanes_and_sidewalk():
    road = read_network(net_of(STREET))
    sidewalk, strip, *lanes = road.edges["west"].lanes
    assert strip.parking and not strip.kinds and strip.width_m == 2.2
    assert sidewalk.kinds == {"pedestrian"} and all("car" in lane.kinds for lane in lanes)
    assert road.off_road_depth(strip.line.points[:1]) == [0.0]
    assert not any(m.from_lane == strip.id or m.to_lane == strip.id for m in road.movements)


def test_they_stand_on_strips_along_them_with_air_between():
    road = read_network(net_of(STREET))
    strips = [lane for lane in road.lanes.values() if lane.parking]
    assert {lane.edge for lane in strips} == {"west", "west_back"}
    scene, cars = parked(8)
    assert len(cars) == 8 and scene.notes == ()
    for car in cars:
        (lane,) = [s for s in strips if abs(s.line.project(car.x, car.y)[1]) < 1.0]
        along, beside = lane.line.project(car.x, car.y)
        assert car.control == "static" and abs(beside) <= 0.15 + 1e-9
        assert math.cos(car.heading_rad - lane.line.at(along)[2]) == pytest.approx(1)
        reach = 8.0 + car.model.length_m / 2
        assert reach <= along <= lane.line.length_m - reach
    boxes = [Polygon(footprint(car)) for car in cars]
    assert min(a.distance(b) for k, a in enumerate(boxes) for b in boxes[:k]) >= 0.8


def test_the_seed_decides_and_a_full_kerb_is_said():
    assert [(a.x, a.y) for a in parked(5)[1]] == [(a.x, a.y) for a in parked(5)[1]]
    assert [(a.x, a.y) for a in parked(5)[1]] != [(a.x, a.y) for a in parked(5, seed=4)[1]]
    scene, cars = parked(100)
    assert 20 < len(cars) < 60 and scene.notes == (
        f"row: {100 - len(cars)} of 100 actors were left out, because there was no room for them",
    )


def with_building(*corners):
    outline = tuple(point(x, y) for x, y in corners)
    return STREET.model_copy(update={"body": (*STREET.body, Building(name="bank", outline=outline))})


@pytest.mark.parametrize(
    ("corners", "words"),
    [
        (((20, -3), (40, -3), (40, 20)), "building 'bank' stands on road 'east', at"),
        (((-3, -3), (3, -3), (3, 3), (-3, 3)), "building 'bank' stands on junction 'j4', at"),
        (((20, 20), (40, 40), (40, 20), (20, 40)), "the outline of building 'bank' crosses or touches itself"),
    ],
)
def test_a_building_on_the_road_is_refused(tmp_path, corners, words):
    with pytest.raises(CompileError, match=words):
        build_network(with_building(*corners), tmp_path / "n.net.xml")


def test_only_the_named_roads_are_crossed(tmp_path):
    junction = next(item for item in STREET.body if getattr(item, "crossings", None) is not None)
    some = junction.model_copy(update={"crossings": ("north", "east")})
    body = tuple(some if item is junction else item for item in STREET.body)
    build_network(STREET.model_copy(update={"body": body}), tmp_path / "n.net.xml")
    network = read_network(tmp_path / "n.net.xml")
    assert len(network.crossings) == 2
    assert all(
        abs(sum(x for x, _ in c.lane.shape)) > 5 or sum(y for _, y in c.lane.shape) > 5
        for c in network.crossings.values()
    )


def test_nobody_is_led_through_a_wall():
    network = with_building((20, 20), (40, 20), (40, 40), (20, 40))
    assert problems_of(EGO + WALKER.format("(15 m, 8 m), (45 m, 8 m)"), network) == []
    through = "(15 m, 8 m), (30 m, 30 m)"
    ((actor, item, message, _),) = problems_of(EGO + WALKER.format(through), network)
    assert (actor, item) == (
        "walker",
        "path",
    ) and "in a building: its outline has a corner at (20.0 m, 20.0 m)" in message
    crate = "obstacle crate: obstacle.crate { start at (21 m, 21 m) }\n"
    assert [(p[0], p[1]) for p in problems_of(EGO + crate, network)] == [("crate", "start_at")]
