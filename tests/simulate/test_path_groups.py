"""Actors on paths: where SUMO's vehicles see them."""

from __future__ import annotations

import math

import shapely

from foresee_dsl.drivers.protocol import Control
from foresee_dsl.kernels.path_following import CELL_M, STEPS_OUT_M
from foresee_dsl.simulate.actors.moved_actors import PathActor
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.world import World
from tests.support.scenes import Town

BRAKES = Control(0.0, 0.0, 1.0)


def test_a_walker_is_seen_from_a_pace_before_the_road_until_it_has_left_it(town: Town) -> None:
    ego = town.ego(("n01_n11", "n11_n21"), 10.0)
    line = town.network.edges["n11_n21"].lanes[1].line
    ways = [line.at(40.0, 15.0)[:2], line.at(40.0, -15.0)[:2]]
    bundle = town.bundle([ego, town.walker("crosses", ways, speed=3.0), town.walker("stays", ways, speed=0.0)])
    simulation = Simulation(bundle, World.shared(bundle))
    crosses, stays = (actor for actor in simulation.actors if isinstance(actor, PathActor))
    road = bundle.network.drivable
    seen: list[tuple[float, float]] = []
    inside: list[tuple[float, float]] = []
    for _ in range(240):
        simulation.step(BRAKES)
        assert not stays.stand_in.is_seen
        if crosses.stand_in.is_seen:
            seen.append((crosses.x, crosses.y))
        if shapely.contains_xy(road, crosses.x, crosses.y):
            inside.append((crosses.x, crosses.y))
    assert crosses.follower.arrived and not crosses.stand_in.is_seen
    assert 0.5 < math.dist(seen[0], inside[0]) <= STEPS_OUT_M + CELL_M
    assert math.dist(seen[-1], inside[-1]) <= CELL_M
    assert len(seen) > len(inside) > 20
