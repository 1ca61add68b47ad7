"""What is looked at late, or not at all, is the same: observations, and points on the road."""

from __future__ import annotations

import pickle
import random
from dataclasses import replace

import numpy as np
import pytest

from foresee_dsl.compile.roads import network
from foresee_dsl.drivers.protocol import Control, Observation
from foresee_dsl.simulate.results.outcome import Squares, squares_of
from foresee_dsl.simulate.runner import run
from tests.support.scenes import LaneKeeper, Town, snapshot

EAST = ("n01_n11", "n11_n21")


class LooksEvery(LaneKeeper):
    """Looks at the others every so many steps only, and keeps what it saw."""

    name = "looks_every"

    def __init__(self, steps: int) -> None:
        super().__init__(6.0)
        self.every, self.count, self.looks = steps, 0, {}

    def step(self, observation: Observation) -> Control:
        if self.count % self.every == 0:
            self.looks[self.count] = (observation.actors, observation.signals, observation.measured_s)
        self.count += 1
        return super().step(observation)


def busy(town: Town):  # type: ignore[no-untyped-def]  # the bundle's type is clear from the next lines
    ego = town.ego(EAST, 40.0)
    return town.bundle([ego, *(a for a in town.traffic(5, 20) if abs(a.x - ego.x) + abs(a.y - ego.y) > 12)], end_s=6.0)


def test_who_looks_seldom_sees_what_who_looks_always_sees(town: Town) -> None:
    always, seldom = LooksEvery(1), LooksEvery(7)
    first = run(busy(town), always, seed=4)
    second = run(busy(town), seldom, seed=4)
    assert first.trace.digest == second.trace.digest
    assert any(actors for actors, _, _ in seldom.looks.values())
    assert seldom.looks == {k: seen for k, seen in always.looks.items() if k % 7 == 0}


def test_who_looks_when_the_run_is_over_sees_the_same(town: Town) -> None:
    looks, keeps = LooksEvery(1), LaneKeeper(6.0)
    run(busy(town), looks, seed=4)
    run(busy(town), keeps, seed=4)
    for k in (119, 3, 60):  # in any order
        kept = keeps.seen[k]
        assert (kept.actors, kept.signals, kept.measured_s) == looks.looks[k]


def test_an_observation_goes_to_another_process_as_what_was_seen(town: Town) -> None:
    driver = LaneKeeper(6.0)
    run(busy(town), driver, seed=4)
    seen = driver.seen[40]
    again = pickle.loads(pickle.dumps(seen))
    assert again == Observation(seen.time_s, seen.ego, seen.actors, seen.signals, seen.measured_s)
    assert again.actors
    with pytest.raises(AttributeError):
        seen.future  # type: ignore[attr-defined]  # noqa: B018 - no driver sees it


def test_points_are_on_the_road_where_the_exact_area_says_so(town: Town) -> None:
    rng = random.Random(1)
    lanes = [lane.line for lane in town.network.lanes.values() if "car" in lane.kinds]
    for _ in range(400):
        line = rng.choice(lanes)
        x, y, _ = line.at(rng.uniform(0, line.length_m), rng.uniform(-6, 6))
        exact = bool(town.network.off_road_depth(np.array([(x, y)]))[0] == 0)
        assert squares_of(town.network).hold(np.array([(x, y)])) is exact
        assert squares_of(town.network).hold(np.array([(x, y)])) is exact  # from what it remembers


def test_of_a_large_map_only_parts_are_looked_at(town: Town, monkeypatch: pytest.MonkeyPatch) -> None:
    """The whole area of a net of 23 MB took half of the time of its import."""
    monkeypatch.setattr(network, "_WHOLE_M", 0.0)
    monkeypatch.setattr(network, "_TILE_M", 40.0)
    large = replace(town.network)
    squares = Squares(large)
    rng = random.Random(1)
    lanes = [lane.line for lane in large.lanes.values() if "car" in lane.kinds]
    for _ in range(300):
        line = rng.choice(lanes)
        x, y, _ = line.at(rng.uniform(0, line.length_m), rng.uniform(-6, 6))
        exact = bool(town.network.off_road_depth(np.array([(x, y)]))[0] == 0)
        assert squares.hold(np.array([(x, y)])) is exact
    assert "drivable" not in vars(large)  # the whole was never computed


def test_a_child_that_stands_goes_on_standing(town: Town) -> None:
    bundle = busy(town)
    parent = run(bundle, LaneKeeper(0.0)).trace
    child = run(snapshot(bundle, parent, 60, end_s=2.0), LaneKeeper(0.0)).trace
    still = [k for k in range(len(child.actors)) if (child.states[:, k, 3] == 0).all()]
    assert still
    assert all(np.ptp(child.states[:, k, :2], axis=0).max() == 0 for k in still)
