"""The roll-out kernel against plain Python, on random runs with random changes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foresee_dsl.avoidance.candidates.scoring import BLIND, CAREFUL, DRIVES
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.records import dtype_of
from foresee_dsl.kernels.what_if import MISSES_M, PathStyle, RollOutEnding, WhatIf, roll_out
from tests.support.plain_what_if import Plain, rolled

STYLES = [BLIND, *DRIVES, *CAREFUL]
FRAMES = 121


def curve(rng: np.random.Generator, speed: float, through: tuple[float, float]) -> FloatArray:
    """A track of 6 s with a changing speed and a bend, which comes to a point about its middle."""
    speeds = speed * (1 + 0.3 * np.sin(np.linspace(0, rng.uniform(1, 6), FRAMES)))
    speeds[rng.random(FRAMES) < 0.02] = 0.0
    headings = rng.uniform(-math.pi, math.pi) + np.linspace(0, rng.uniform(-1, 1), FRAMES)
    steps = speeds[:-1, None] * 0.05 * np.column_stack([np.cos(headings), np.sin(headings)])[:-1]
    points = np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)])
    points += np.array(through) - points[FRAMES // 2] + rng.normal(0, 2, 2)
    return np.column_stack([points, headings, np.r_[np.hypot(*np.diff(points, axis=0).T), speeds[-1] * 0.05]])


def change(rng: np.random.Generator) -> WhatIf:
    """One actor with several things changed at once: a stricter test than any candidate."""

    def sometimes(value: float, otherwise: float = 0.0) -> float:
        return value if rng.random() < 0.4 else otherwise

    return WhatIf(
        actor=1, first=10, last=118, delay=sometimes(rng.uniform(0.2, 2)), ahead=sometimes(rng.uniform(0.2, 2)),
        pace=sometimes(rng.uniform(0.6, 1.4), 1.0), brakes_at=rng.uniform(0, 3), brakes_for=rng.uniform(0.5, 2),
        braking=sometimes(rng.uniform(1, 7)), left=sometimes(rng.uniform(-1.5, 1.5)), left_at=rng.uniform(0, 3),
        left_for=rng.uniform(0.5, 3), left_rate=0.6, turn=sometimes(rng.uniform(-0.05, 0.05)),
        turn_at=rng.uniform(0, 3), turn_for=1.0, goes_at=sometimes(rng.uniform(0, 4), math.inf), cruise=9.0,
        length=rng.uniform(0.5, 6), width=rng.uniform(0.5, 2.2),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(6))
def test_the_kernel_does_what_plain_python_does(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tracks = np.array([curve(rng, 9, (0, 0)), curve(rng, rng.choice([1.5, 8]), (0, 0)), curve(rng, 5, (12, 5))])
    sizes = np.array([[4.5, 1.8, 1.5], [1.0, 0.6, 1.6], [6.0, 2.2, 2.5]])
    whats = [change(rng) for _ in range(3)]
    found = np.zeros((3, len(STYLES)), dtype_of(RollOutEnding))
    roll_out(np.array(whats, dtype_of(WhatIf)), np.array(STYLES, dtype_of(PathStyle)), tracks, sizes, found)
    for what, row in zip(whats, found, strict=True):
        blind = rolled(what, BLIND, 0.0, tracks, sizes)
        assert tuple(row[0][["contact", "gap", "brakes"]]) == pytest.approx(blind, abs=1e-6)
        for style, ending in list(zip(STYLES, row, strict=True))[1:]:
            far = blind.gap > MISSES_M
            plain = blind if far else rolled(what, style, float(row[0]["at"]), tracks, sizes)
            got = Plain(*(float(ending[name]) for name in Plain._fields))
            assert got == pytest.approx(plain, abs=1e-6), style
