"""The fastest safe speed in closed form, against scipy's linear programming and by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from foresee_learned.fusion_safe import Speeds, fastest_safe_speed
from scipy.optimize import linprog

from foresee_dsl.drivers.protocol import FloatArray

CASES = 500


def solved(now_mps: float, free_m: FloatArray, bounds: Speeds) -> float | None:
    """The same programme, as it is written down in the module, solved by scipy."""
    count, step = len(free_m), bounds.step_s
    rows, most = [], []
    for k in range(count):
        if math.isfinite(free_m[k]):
            way = np.where(np.arange(count) < k, step, 0.0)
            way[k] = step / 2
            rows.append(way)
            most.append(free_m[k] - now_mps * step / 2)
        change = np.zeros(count)
        change[k] = 1.0
        if k:
            change[k - 1] = -1.0
        before = 0.0 if k else now_mps
        rows += [change, -change]
        most += [bounds.acceleration_mps2 * step + before, bounds.braking_mps2 * step - before]
    aim = np.zeros(count)
    aim[0] = -1.0
    found = linprog(aim, np.array(rows), most, bounds=[(0.0, bounds.most_mps)] * count)
    return float(found.x[0]) if found.status == 0 else None


def test_it_is_what_linprog_finds() -> None:
    rng = np.random.default_rng(14)
    none = 0
    for _ in range(CASES):
        count = int(rng.integers(1, 7))
        free = rng.uniform(0.0, 40.0, count)
        free[rng.random(count) < 0.2] = np.inf
        if rng.random() < 0.5:
            free.sort()
        bounds = Speeds(rng.uniform(0.2, 1.0), rng.uniform(0.5, 18.0), rng.uniform(0.5, 4.0), rng.uniform(0.5, 8.0))
        now = float(rng.uniform(0.0, 15.0))
        expected = solved(now, free, bounds)
        none += expected is None
        assert fastest_safe_speed(now, free, bounds) == (
            None if expected is None else pytest.approx(expected, abs=1e-6)
        )
    assert CASES / 5 < none < CASES * 4 / 5  # both kinds were tried


BOUNDS = Speeds(step_s=0.5, most_mps=20.0, acceleration_mps2=2.0, braking_mps2=4.0)


@pytest.mark.parametrize(
    ("now", "free", "by_hand"),
    [
        (10.0, [math.inf] * 2, 11.0),  # 2 m/s^2 for half a second
        (20.0, [math.inf] * 2, 20.0),
        (10.0, [4.75, math.inf], 9.0),  # (10 + v) / 4 = 4.75
        (10.0, [4.0, math.inf], None),  # (10 + 8) / 4 = 4.5 is the least way
        (0.0, [0.0, 0.0], 0.0),
        (4.0, [math.inf, 2.0], 2.0),  # to rest in two steps of 4 m/s^2: 1.5 m and 0.5 m
    ],
)
def test_by_hand(now: float, free: list[float], by_hand: float | None) -> None:
    assert fastest_safe_speed(now, np.array(free), BOUNDS) == (None if by_hand is None else pytest.approx(by_hand))
