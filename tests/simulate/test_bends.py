"""Nobody that SUMO moves turns with more than it can hold, on a dry road or a wet one."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foresee_dsl.compile.roads.polyline import Polyline
from foresee_dsl.simulate.actors.bend_speeds import TURNS_WITH, BendSpeeds, approached
from foresee_dsl.simulate.actors.dynamics import lateral_limit_mps2
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import SPEED, YAW_RATE
from tests.support.paths import Walk
from tests.support.scenes import Cruise, Town
from tests.support.worlds import COMPACT, VAN

_ANGLES = np.linspace(-math.pi / 2, 0, 30)
# 60 m east, a left turn of radius 20 m, 100 m north.
TURN = Polyline.of(
    np.concatenate(
        [[[0.0, 0.0]], np.column_stack([60 + 20 * np.cos(_ANGLES), 20 + 20 * np.sin(_ANGLES)]), [[80.0, 120.0]]]
    )
)


def speeds(lateral: float) -> BendSpeeds:
    return BendSpeeds(TURN.marks, TURN.angles, axle_m=3.4, lateral_mps2=lateral, braking_mps2=4.5)


@pytest.mark.parametrize(("friction", "expected"), [(0.9, 10.29), (0.5, 7.67)])
def test_a_bend_is_taken_with_a_share_of_what_holds_and_braked_for(friction: float, expected: float) -> None:
    # sqrt(0.6 x 8.829 x 20) = 10.29 m/s; wet sqrt(0.6 x 4.905 x 20) = 7.67 m/s.
    bend = speeds(friction * 9.81)
    assert np.interp(75.0, bend.marks, bend.speeds) == pytest.approx(expected, rel=0.03)
    # 30 m before it: v^2 = expected^2 + 2 x 0.8 x 4.5 x 30.
    assert np.interp(30.0, bend.marks, bend.speeds) == pytest.approx(math.sqrt(expected**2 + 216), rel=0.06)
    assert np.interp(110.0, bend.marks, bend.speeds) > 100


@given(st.lists(st.floats(1, 30), min_size=2, max_size=20), st.floats(1, 8))
def test_every_limit_is_met_with_the_braking(limits: list[float], braking: float) -> None:
    s = [3.0 * k for k in range(len(limits))]
    found = approached(limits, s, braking)
    assert all(v <= limit for v, limit in zip(found, limits, strict=True))
    assert all(a * a - b * b <= 2 * braking * 3.0 + 1e-9 for a, b in pairwise(found))


def worst(town: Town, friction: float, seed: int) -> list[tuple[str, float]]:
    """The largest lateral acceleration of each vehicle over 20 s, m/s^2."""
    ego = town.ego(("n01_n11", "n11_n21", "n21_n31"), 30.0, speed=0.0)
    others = [replace(a, cruise_mps=16.0) for a in town.traffic(seed, 16) if math.dist((a.x, a.y), (ego.x, ego.y)) > 12]
    trace = run(town.bundle([ego, *others], end_s=20.0, friction=friction), Cruise(0.0)).trace
    lateral = np.nan_to_num(np.abs(trace.states[:, 1:, SPEED] * trace.states[:, 1:, YAW_RATE])).max(axis=0)
    return list(zip([info.model for info in trace.actors[1:]], lateral.tolist(), strict=True))


@pytest.mark.parametrize("friction", [0.9, 0.5])
def test_whom_sumo_moves_stays_within_friction_and_balance(town: Town, friction: float) -> None:
    found = worst(town, friction, seed=5)
    assert max(lateral for _, lateral in found) > 1.0, "somebody turned"
    for model, lateral in found:
        assert lateral <= lateral_limit_mps2(model, friction), model


def test_on_a_wet_road_they_take_the_same_corner_slower(town: Town) -> None:
    def slowest(friction: float, model: object) -> float:
        car = town.vehicle("car", ("n11_n21", "n21_n22"), 60.0, speed=12.0, model=model, lane_index=2)
        ego = town.ego(("n30_n20", "n20_n10"), 10.0, speed=0.0)
        trace = run(town.bundle([ego, car], end_s=8.0, friction=friction), Cruise(0.0)).trace
        inside = [name.startswith(":") for name in (*trace.lane_ids, "")]
        on = np.array([inside[k] for k in trace.lanes[:, 1]])
        assert on.any()
        return float(trace.states[on, 1, SPEED].min())

    dry, wet = slowest(0.9, COMPACT), slowest(0.5, COMPACT)
    assert wet < 0.85 * dry
    assert slowest(0.9, VAN) < dry


def test_a_bicycle_on_a_path_takes_the_corner_within_its_balance() -> None:
    path = [(0.0, 0.0), (20.0, 0.0), (20.0, 20.0)]
    values = {"pace_mps": 5.0, "acceleration_mps2": 1.0, "braking_mps2": 3.0, "length_m": 1.8, "speed_mps": 5.0}
    rider = Walk(path, lateral_mps2=lateral_limit_mps2("bicycle.city", 0.9), **values)
    poses = [rider.step(0.05) for _ in range(300)]
    assert max(abs(p.speed * p.yaw_rate) for p in poses) <= 0.4 * 9.81
    assert max(p.speed for p in poses[-150:-60]) > 3.0, "it gains speed behind the corner"
    free = Walk(path, **values)
    assert max(abs(p.speed * p.yaw_rate) for p in (free.step(0.05) for _ in range(300))) > 0.4 * 9.81
    assert TURNS_WITH < 1
