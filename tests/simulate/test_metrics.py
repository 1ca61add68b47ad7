"""Criticality metrics on cases with an answer worked out by hand."""

from __future__ import annotations

import math
from math import inf

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from foresee_dsl.kernels.boxes import Box, Mover, overlaps
from foresee_dsl.simulate.results.metrics import eta
from tests.support.compiled_metrics import ttc
from tests.support.plain_metrics import minimum_distance, pet

EAST, NORTH, WEST = 0.0, math.pi / 2, math.pi


def car(x: float, y: float, heading: float, speed: float) -> Mover:
    return Mover(x, y, heading, speed, 4.0, 2.0)


HAND = [
    (car(0, 0, EAST, 10), car(24, 0, EAST, 5), 4.0),  # 20 m of room, closing at 5 m/s
    (car(0, 0, EAST, 10), car(24, 0, WEST, 10), 1.0),  # closing at 20 m/s
    (car(0, 0, EAST, 10), car(24, 0, EAST, 10), inf),  # never nearer
    (car(0, 0, EAST, 10), car(24, 0, EAST, 12), inf),  # leaving
    (car(0, 0, EAST, 10), car(24, 2.5, WEST, 10), inf),  # passes beside
    (car(0, 0, EAST, 10), car(24, 1.99, WEST, 10), 1.0),  # scrapes along
    (car(0, 0, EAST, 10), car(3, 0, EAST, 0), 0.0),  # overlap already
    # The crossing car's near side is x = 19, where ego's front is after 1.7 s. By then its own front has come from
    # y = -8 to y = 0.5, within ego's width: they touch.
    (car(0, 0, EAST, 10), car(20, -10, NORTH, 5), 1.7),
    # At 2 m/s its front is at y = -1 only after 3.5 s; by then ego's tail is at x = 33: past it.
    (car(0, 0, EAST, 10), car(20, -10, NORTH, 2), inf),
    # At 20 m/s its tail, at y = -12, has left y = 1 after 0.65 s: long before ego.
    (car(0, 0, EAST, 10), car(20, -10, NORTH, 20), inf),
]


@pytest.mark.parametrize(("a", "b", "expected"), HAND)
def test_ttc_by_hand(a: Mover, b: Mover, expected: float) -> None:
    assert ttc(a, b) == pytest.approx(expected, abs=1e-9)
    assert ttc(b, a) == pytest.approx(expected, abs=1e-9)


def test_ttc_of_an_absent_actor_is_none() -> None:
    assert math.isnan(ttc(HAND[0][0]._replace(x=math.nan), HAND[0][1]))


movers = st.builds(
    Mover,
    st.floats(-30, 30),
    st.floats(-30, 30),
    st.floats(-4, 4),
    st.floats(0, 15),
    st.floats(1, 8),
    st.floats(0.5, 3),
)


def later(m: Mover, seconds: float) -> Box:
    vx, vy = m.velocity
    return Box(m.x + vx * seconds, m.y + vy * seconds, m.heading, m.length, m.width)


@given(movers, movers)
def test_ttc_is_the_first_touch(a: Mover, b: Mover) -> None:
    time = ttc(a, b)
    if time == inf:
        assert not any(overlaps(later(a, t), later(b, t)) for t in np.arange(0, 12, 0.1))
        return
    assume(time < 1e4)
    before = [t for t in np.linspace(0, time, 50)[:-1] if t < time - 1e-3]
    assert not any(overlaps(later(a, t), later(b, t)) for t in before)
    grown = Box(*later(b, time)[:3], b.length + 1e-6, b.width + 1e-6)
    assert overlaps(later(a, time), grown)


def test_eta() -> None:
    assert eta(30, 10) == 3
    assert eta(30, 0.2) == 30  # counted with 1 m/s
    assert eta(0, 10) == 0
    assert eta(-0.1, 10) == inf


def crossing(gap_s: float) -> tuple[np.ndarray, np.ndarray]:
    """A goes east and B north through the origin at 10 m/s; B's centre passes it `gap_s` later than A's."""
    t = np.arange(0, 10, 0.05) - 3.0
    size = np.tile([4.0, 2.0], (len(t), 1))
    a = np.column_stack([10 * t, 0 * t, 0 * t, size])
    b = np.column_stack([0 * t, 10 * (t - gap_s), 0 * t + NORTH, size])
    return a, b


def test_pet_by_hand() -> None:
    # A leaves the square |x|, |y| < 1 with its tail at x = 1, 0.3 s after its centre; B's front reaches y = -1 0.3 s
    # before its centre: the time between is gap - 0.6 s.
    for late in (1.0, 2.5):
        a, b = crossing(late)
        assert pet(a, b) == pytest.approx(late - 0.6, abs=0.05 + 1e-9)
        assert pet(b, a) == pet(a, b)
    assert pet(*crossing(0.5)) == 0
    a, b = crossing(1.0)
    assert pet(a, b, horizon_s=0.2) == inf
    assert pet(a, b + np.array([500, 0, 0, 0, 0])) == inf
    b[:] = math.nan
    assert pet(a, b) == inf


def test_minimum_distance_and_its_frame() -> None:
    x = np.arange(10.0)
    a = np.column_stack([x, 0 * x, 0 * x, 0 * x + 4, 0 * x + 2])
    b = np.tile([6.0, 5.0, 0.0, 4.0, 2.0], (10, 1))
    # Side by side, 5 - 1 - 1 = 3 m, from x = 2 (noses level with its tail) on.
    assert minimum_distance(a, b) == (pytest.approx(3.0), 2)
    b[:, 0] = math.nan
    assert minimum_distance(a, b) == (inf, -1)
    assert minimum_distance(a[:0], b[:0]) == (inf, -1)
