"""A run that is rebuilt from a description goes on as its parent did."""

from __future__ import annotations

import math
from dataclasses import replace
from decimal import Decimal

import pytest

from foresee_dsl.language.model import ChangesLane, Comparison, Measure, Quantity, When
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.world import World
from tests.support.scenes import LaneKeeper, Town, deviations, snapshot

FAR = 1e9


def _scene(town: Town, seed: int):  # type: ignore[no-untyped-def]  # the bundle's type is clear from the next line
    ego = town.ego(("n01_n11", "n11_n21", "n21_n31"), 30.0)
    others = [a for a in town.traffic(seed, 20) if math.dist((a.x, a.y), (ego.x, ego.y)) > 12]
    return town.bundle([ego, *others], goal_s=FAR)


@pytest.mark.parametrize("seed", [0, 2])
def test_rounded_snapshots_reproduce_ten_seconds(town: Town, seed: int) -> None:
    bundle = _scene(town, seed)
    parent = run(replace(bundle, scene=replace(bundle.scene, end_s=26.0)), LaneKeeper(6.0)).trace
    worst = []
    for frame in (0, 100, 207, 311):
        child = run(snapshot(bundle, parent, frame), LaneKeeper(6.0)).trace
        assert child.duration_s == 10.0
        worst += deviations(parent, child, frame).values()
    assert sorted(worst)[len(worst) // 2] < 1e-3
    assert sum(w < 0.1 for w in worst) / len(worst) >= 0.995


def test_frame_zero_of_a_child_is_the_parents_frame(town: Town) -> None:
    bundle = _scene(town, 1)
    parent = run(bundle, LaneKeeper(6.0)).trace
    child = run(snapshot(bundle, parent, 120, end_s=1.0), LaneKeeper(6.0)).trace
    for k, info in enumerate(child.actors):
        was, now = parent.states[120, parent.index(info.id)], child.states[0, k]
        assert math.dist(was[:2], now[:2]) < 2e-3, info.id
        assert abs(was[3] - now[3]) < 1e-3, info.id
    assert (parent.stages[120] == child.stages[0]).all()
    assert abs(parent.elapsed[120] - child.elapsed[0]).max() < 1e-3


@pytest.mark.parametrize("frame", [12, 25, 50, 70])
@pytest.mark.parametrize("side", ["left", "right"])
def test_a_lane_change_goes_on_from_where_the_vehicle_is(town: Town, side: str, frame: int) -> None:
    edges = ("n01_n11", "n11_n21")
    car = town.vehicle("car", edges, 5.0, speed=9.0, cruise=9.0, lane_index=1 if side == "left" else 2)
    change = When(
        condition=Comparison(left=Measure(what="time"), op=">=", right=Quantity(value=Decimal("0.5"), unit="s")),
        actions=(ChangesLane(actor="car", side=side),),
    )
    bundle = town.bundle(
        [town.ego(("n30_n20", "n20_n10"), 10.0, speed=0.0), car], clip=True, end_s=7.0, whens=(change,)
    )
    parent = run(bundle, LaneKeeper(0.0)).trace
    found = snapshot(replace(bundle, scene=replace(bundle.scene, whens=())), parent, frame, end_s=3.0)
    placed = found.scene.actors[1]
    # a description has no lane: the nearest one it is
    near = town.network.nearest_lane(placed.x, placed.y, placed.heading_rad)
    assert near is not None
    actors = (found.scene.ego, replace(placed, lane=near.lane.id))
    child = run(replace(found, scene=replace(found.scene, actors=actors)), LaneKeeper(0.0)).trace
    assert deviations(parent, child, frame)["car"] < 0.02
    assert child.lane_ids[child.lanes[-1, 1]] == parent.lane_ids[parent.lanes[-1, 1]]


def test_signals_keep_their_time(town: Town) -> None:
    bundle = _scene(town, 1)
    long = replace(bundle, scene=replace(bundle.scene, end_s=30.0))
    parent = run(long, LaneKeeper(0.0)).trace
    child = run(snapshot(bundle, parent, 250, end_s=15.0), LaneKeeper(0.0)).trace
    assert len({tuple(row) for row in parent.stages}) >= 3
    assert (parent.stages[250 : 250 + child.frames] == child.stages).all()


def test_an_emptied_world_is_as_good_as_a_fresh_one(town: Town) -> None:
    bundle = _scene(town, 3)
    World.close_shared()
    fresh = run(bundle, LaneKeeper(6.0)).trace.digest
    run(_scene(town, 4), LaneKeeper(3.0))
    assert run(bundle, LaneKeeper(6.0)).trace.digest == fresh
    World.close_shared()
    assert run(bundle, LaneKeeper(6.0)).trace.digest == fresh


def test_a_run_does_not_notice_when_the_last_one_ended(town: Town) -> None:
    # SUMO 1.28 skips lane changes on an edge where it has looked at them at this very time, in an earlier run too:
    # the run ends as a vehicle comes to an edge where it changes lane at once.
    bundle = _scene(town, 0)
    trace = run(replace(bundle, scene=replace(bundle.scene, end_s=12.0)), LaneKeeper(6.0)).trace
    on = [trace.lane_ids[k] for k in trace.lanes[:, trace.index("others_08")]]
    comes_s = next(k for k, lane in enumerate(on) if lane.startswith("n31_n21_")) * STEP_S
    short = replace(bundle, scene=replace(bundle.scene, end_s=comes_s))
    World.close_shared()
    first, second = (run(short, LaneKeeper(6.0)).trace for _ in range(2))
    assert first.digest == second.digest
    assert first.lane_ids[first.lanes[-1, first.index("others_08")]] == on[round(comes_s / STEP_S)]
