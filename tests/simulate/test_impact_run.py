"""Contacts of real runs: what the result says of them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from foresee_dsl.compile.bundle import PlacedActor
from foresee_dsl.drivers.protocol import Control, Observation
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.runner import run
from tests.support.scenes import Cruise, LaneKeeper, Town
from tests.support.worlds import COMPACT

EDGES = ("n01_n11", "n11_n21", "n21_n31")


def ahead_of(town: Town, metres: float, aside_m: float = 0.0) -> PlacedActor:
    """Something that stands before an ego which begins 20 m along the road: its middle so far from the ego's front."""
    x, y, heading = town.network.edges[EDGES[0]].lanes[1].line.at(20.0 + metres)
    return town.crate("box", x, y + aside_m, heading)


def drive(town: Town, *others: PlacedActor, speed: float = 8.0) -> RunResult:
    return run(town.bundle([town.ego(EDGES, 20.0, speed=speed), *others]), LaneKeeper(speed))


def test_into_something_that_stands(town: Town) -> None:
    result = drive(town, ahead_of(town, 20.0, 0.4))
    assert result.verdict is Verdict.F1
    assert result.impact is not None
    assert (result.impact.with_, result.impact.side, result.impact.struck_by) == ("box", "front", "ego")
    assert result.impact.relative_mps == pytest.approx(8.0, abs=0.1)
    assert result.impact.ego_mps == result.impact.relative_mps
    assert result.impact.closing_mps == pytest.approx(result.impact.relative_mps, abs=0.01)
    assert result.impact.ahead_m == pytest.approx(COMPACT.length_m / 2, abs=1e-6)
    assert result.impact.left_m == pytest.approx(0.4, abs=0.1)
    assert result.reason == f"F1 collision with box (obstacle) at {result.time_s:.2f} s, 8.0 m/s"
    assert result.near_misses.distance_m is not None
    assert (result.near_misses.distance_m.value, result.near_misses.distance_m.actor) == (0.0, "box")
    assert result.near_misses is result.near_misses  # worked out once


def test_a_parked_car_is_a_static_object(town: Town) -> None:
    result = drive(town, replace(ahead_of(town, 20.0), id="parked", model=COMPACT))
    assert (result.verdict, result.with_) == (Verdict.F1, "parked")
    assert "F1 collision with parked (obstacle)" in result.reason


def test_at_the_first_frame_it_is_invalid(town: Town) -> None:
    result = drive(town, ahead_of(town, -1.0))
    assert result.verdict is Verdict.INVALID
    assert result.impact is not None
    assert not result.verdict.is_failure


def test_off_the_road_nobody_is_touched(town: Town) -> None:
    class Right(Cruise):
        def step(self, observation: Observation) -> Control:
            return replace(super().step(observation), steer=-0.3)

    result = run(town.bundle([town.ego(EDGES, 20.0)]), Right(8.0))
    assert (result.verdict, result.impact) == (Verdict.F1, None)
    assert result.reason.startswith("F1 left the drivable area at ")


def test_who_is_passed_gives_near_misses_of_a_run_that_passes(town: Town) -> None:
    result = drive(town, ahead_of(town, 20.0, -2.5))
    assert result.verdict is Verdict.PASS
    assert result.impact is None
    near = result.near_misses
    assert near.distance_m is not None
    assert 0.5 < near.distance_m.value < 2.0
    assert (near.ttc_s, near.drac_mps2) == (None, None)
