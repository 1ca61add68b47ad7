"""Background traffic: where the seed says, never where it would be in the way."""

from itertools import pairwise

import numpy as np
import pytest
from shapely import Polygon

from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.placement.checks import footprint
from tests.support.worlds import EGO, PLAIN, four_arms, net_of, scene_of

NETWORK = four_arms(median=0, via=())


def traffic(count, *models, within=120, seed=7):
    names = ", ".join(models)
    return f"traffic others {{\n count {count}\n models [{names}]\n within {within} m of ego.route\n seed {seed}\n}}\n"


def crowd(text, network=NETWORK):
    scene = scene_of(EGO + text, network)
    return scene, [a for a in scene.actors if a.id.startswith("others")]


@pytest.fixture(scope="module")
def mixed():
    return crowd(traffic(14, "car.compact", "van.delivery", "motorcycle.street", "bicycle.city", "pedestrian.adult"))


def test_the_same_seed_gives_the_same_traffic(mixed):
    def told(actors):
        return [(a.id, a.model.name, a.x, a.y, a.speed_mps, a.route, a.path) for a in actors]

    models = ("car.compact", "van.delivery", "motorcycle.street", "bicycle.city", "pedestrian.adult")
    assert told(crowd(traffic(14, *models))[1]) == told(mixed[1])
    assert told(crowd(traffic(14, *models, seed=8))[1]) != told(mixed[1])


def test_they_are_numbered_and_as_many_as_asked(mixed):
    scene, others = mixed
    assert [a.id for a in others] == [f"others_{k:02d}" for k in range(1, 15)] and scene.notes == ()
    assert {a.control for a in others} == {"sumo", "path"}


def test_vehicles_stand_on_their_lane_and_can_stop(mixed):
    road = read_network(net_of(NETWORK))
    for actor in (a for a in mixed[1] if a.control == "sumo"):
        lane = road.lanes[actor.lane]
        front, lateral = lane.line.project(actor.x, actor.y)
        assert abs(lateral) < 1e-6 and not lane.internal
        assert actor.model.length_m <= front <= lane.line.length_m
        left = lane.line.length_m - front
        assert actor.speed_mps + actor.speed_mps**2 / (2 * actor.model.braking_mps2) <= left + 1e-6
        assert 0 <= actor.speed_mps <= actor.cruise_mps <= 1.05 * lane.speed_mps
        assert actor.route[0] == lane.edge
        assert all(b in {m.to_edge for m in road.movements_from(a)} for a, b in pairwise(actor.route))
        if actor.model.kind == "bicycle":
            assert actor.lane == road.edges[lane.edge].for_kind("bicycle")[0].id, "on the right"


def test_nobody_is_in_the_way_at_the_start(mixed):
    scene, _ = mixed
    road = read_network(net_of(NETWORK))
    by_lane = {}
    for actor in scene.actors:
        if actor.lane:
            front = road.lanes[actor.lane].line.project(actor.x, actor.y)[0]
            by_lane.setdefault(actor.lane, []).append((front - actor.model.length_m, front))
    for slots in by_lane.values():
        slots.sort()
        assert all(b[0] - a[1] >= 12 - 1e-6 for a, b in pairwise(slots))
    boxes = [Polygon(footprint(a)) for a in scene.actors]
    assert all(not boxes[k].intersects(boxes[j]) for k in range(len(boxes)) for j in range(k))


def test_they_are_near_the_ego():
    scene, others = crowd(traffic(6, "car.compact", "pedestrian.adult", within=40))
    points = scene.ego.line.points
    assert others and all(np.hypot(*(points - (a.x, a.y)).T).min() < 41 for a in others)


def test_pedestrians_walk_on_and_know_their_lights():
    scene, others = crowd(traffic(10, "pedestrian.adult") + "end after 120 s")
    assert len(others) == 10 and all(a.control == "path" and not a.lane for a in others)
    for actor in others:
        length = np.hypot(*np.diff(actor.path, axis=0).T).sum()
        assert length >= actor.cruise_mps * scene.end_s
        assert np.allclose(actor.path[0], (actor.x, actor.y))
        assert 0.8 * 1.3 <= actor.cruise_mps <= 1.05 * 1.3
        assert all(0 <= enter < leave <= length for enter, leave, _, _ in actor.walk_stops)
    assert any(actor.walk_stops for actor in others)


def test_a_full_road_is_said():
    scene, others = crowd(traffic(80, "bus.city", within=60), PLAIN)
    assert 0 < len(others) < 80
    left_out = 80 - len(others)
    assert scene.notes == (f"others: {left_out} of 80 actors were left out, because there was no room for them",)
