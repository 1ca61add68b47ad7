"""The door to SUMO."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from foresee_dsl.errors import SimulationError
from foresee_dsl.simulate.moved_bodies import GHOST_TYPE
from foresee_dsl.simulate.world import World
from tests.support.scenes import Town


def _world(town: Town, *more, **scene):  # type: ignore[no-untyped-def]  # actors and scene fields
    bundle = town.bundle([town.ego(("n01_n11", "n11_n21"), 30.0), *more], **scene)
    return bundle, World.shared(bundle)


def _seen(world: World, vehicle: str) -> tuple[float, float, float]:
    """x, y of its front, and its speed."""
    seen = world.vehicles()
    k = seen.names.index(vehicle)
    x, y, speed = seen.numbers[[2 * k, 2 * k + 1, 2 * len(seen.names) + k]].tolist()
    return x, y, speed


def test_a_vehicle_is_where_it_was_placed(town: Town) -> None:
    car = town.vehicle("car", ("n12_n11", "n11_n10"), 40.0, speed=7.5)
    _, world = _world(town, car)
    world.add_vehicle(car)
    world.step()
    world.settle("car", car.speed_mps, 0.0)
    x, y, _ = _seen(world, "car")
    assert math.dist((x, y), (car.x, car.y)) < 1e-6
    world.step()
    x, y, speed = _seen(world, "car")
    assert speed == pytest.approx(7.5, abs=0.2)  # it goes on from the speed that it was given
    assert math.dist((x, y), (car.x, car.y)) == pytest.approx(speed * 0.05, abs=1e-6)


def test_who_comes_to_another_lane_is_told_once(town: Town) -> None:
    car = town.vehicle("car", ("n12_n11", "n11_n10"), 80.0, speed=7.5)
    _, world = _world(town, car)
    world.add_vehicle(car)
    world.ignore("car", "signals")
    told = []
    for _ in range(100):
        world.step()
        told += world.vehicles().changed
    assert told[0] == ("car", car.lane)
    lanes = [lane for _, lane in told]
    assert len(lanes) == len(set(lanes)) > 1
    assert any(lane.startswith("n11_n10") for lane in lanes)


def test_a_body_is_seen_by_those_behind(town: Town) -> None:
    car = town.vehicle("car", ("n12_n11", "n11_n10"), 20.0)
    stands = town.vehicle("body", ("n12_n11", "n11_n10"), 60.0)
    _, world = _world(town)
    world.add_vehicle(car)
    world.bodies.add("body", "car.compact", stands.route)
    for _ in range(200):
        world.bodies.place("body", stands.x, stands.y, stands.heading_rad)
        world.step()
        world.settle("body", 0.0, 0.0)
    x, y, speed = _seen(world, "car")
    assert speed < 0.1
    assert 4.0 < math.dist((x, y), (stands.x, stands.y)) < 8.0  # the body's length and a gap


@pytest.mark.parametrize("mended", [True, False])
def test_a_body_that_was_passed_is_still_seen(town: Town, mended: bool) -> None:
    edges = ("n12_n11", "n11_n10")
    car, stands = town.vehicle("car", edges, 5.0, speed=9.0, cruise=9.0), town.vehicle("stands", edges, 60.0)
    _, world = _world(town)
    world.add_vehicle(car)
    world.bodies.add("stands", GHOST_TYPE, edges, 0.5)
    world.bodies.add("passes", "car.compact", edges)
    for step in range(200):
        passing = town.vehicle("passes", edges, min(40.0 + 0.5 * step, 90.0))
        world.bodies.place("stands", stands.x, stands.y, stands.heading_rad, stands.lane)
        world.bodies.place("passes", passing.x, passing.y, passing.heading_rad, passing.lane)
        world.step()
        if mended:
            world.bodies.correct_lane_order()
        world.settle("stands", 0.0, 0.0)
    x, y, _ = _seen(world, "car")
    # SUMO alone would look past it (this is why the order is mended)
    assert (math.dist((x, y), (car.x, car.y)) < 55.0) == mended


def test_cruise_over_the_limit_is_driven(town: Town) -> None:
    car = town.vehicle("car", ("n11_n21", "n21_n31"), 5.0, cruise=18.0)
    _, world = _world(town, car)
    world.add_vehicle(car)
    world.step()
    world.settle("car", 12.0, 0.0)
    fastest = 0.0
    for _ in range(80):
        world.step()
        fastest = max(fastest, _seen(world, "car")[2])
    assert 15.0 < fastest <= 18.0 + 1e-9


def test_those_who_arrive_are_forgotten(town: Town) -> None:
    car = town.vehicle("car", ("n12_n11",), 80.0, speed=10.0)
    _, world = _world(town, car)
    world.add_vehicle(car)
    for _ in range(60):
        world.step()
        world.vehicles()
    assert "car" not in world
    assert "car" not in world.vehicles().names


def test_signals_begin_as_the_scene_says(town: Town) -> None:
    signal = town.signals["n11"]
    _, world = _world(town, signals=(("n11", "phase_1", 1.25),))
    world.step()
    assert world.signals.stage("n11") == (1, pytest.approx(1.25))
    assert world.signals.state("n11") == signal.phases[1].state
    assert world.signals.stage("n22") == (0, pytest.approx(0.0))
    left = signal.phases[1].duration_s - 1.25
    for _ in range(round(left / 0.05) + 1):
        world.step()
    assert world.signals.stage("n11")[0] == 2
    assert {world.signals.colour("n11", k) for k in range(len(world.signals.state("n11")))} <= {
        "red",
        "amber",
        "green",
        "off",
    }


def test_a_missing_network_is_said(town: Town, tmp_path: Path) -> None:
    bundle = replace(town.bundle([town.ego(("n01_n11",), 30.0)]), net_file=tmp_path / "gone.net.xml", key="gone")
    with pytest.raises(SimulationError, match=r"gone\.net\.xml"):
        World.shared(bundle)
    _, world = _world(town)  # and the process can go on with another
    world.step()


def test_an_impossible_route_is_refused(town: Town) -> None:
    car = town.vehicle("car", ("n12_n11", "n11_n10"), 40.0)
    _, world = _world(town)
    with pytest.raises(SimulationError, match="car"):
        world.add_vehicle(replace(car, route=("nowhere",)))


def test_one_call_advances_settles_and_reads(town: Town) -> None:
    car = town.vehicle("car", ("n12_n11", "n11_n10"), 20.0, speed=7.5)
    stands = town.vehicle("body", ("n12_n11", "n11_n10"), 60.0)
    ways = []
    for at_once in (True, False):
        _, world = _world(town)
        world.add_vehicle(car)
        world.bodies.add("body", "car.compact", stands.route)
        way = []
        for _ in range(60):
            world.bodies.place("body", stands.x, stands.y, stands.heading_rad)
            if at_once:
                states = world.advance([("body", 0.0, 0.0)])
            else:
                world.step()
                world.bodies.correct_lane_order()
                world.settle("body", 0.0, 0.0)
                states = world.vehicles()
            way.append((states.names, states.numbers.tolist(), states.changed))
        ways.append(way)
    assert ways[0] == ways[1] and ways[0][-1][0] == ("car",)
