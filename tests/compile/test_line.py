"""A path moved to the side."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foresee_dsl.compile.placement.paths import LINE_OVER_M, shifted
from foresee_dsl.compile.roads.polyline import Polyline


def test_it_goes_over_from_where_it_is_and_stays_beside() -> None:
    assert shifted(((0.0, 0.0), (20.0, 0.0)), 3.0, 0.6) == ((0.0, 0.0), (3.0, 0.0), (8.0, 0.6), (20.0, 0.6))


def test_where_less_than_that_is_left_it_still_ends_beside() -> None:
    assert shifted(((0.0, 0.0), (4.0, 0.0)), 2.0, -0.6) == ((0.0, 0.0), (2.0, 0.0), (4.0, -0.6))


def test_at_a_corner_the_parallels_meet() -> None:
    path = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0))
    assert shifted(path, 0.0, 0.6) == ((0.0, 0.0), (5.0, 0.6), (9.4, 0.6), (9.4, 10.0))
    assert shifted(path, 0.0, -0.6) == ((0.0, 0.0), (5.0, -0.6), (10.6, -0.6), (10.6, 10.0))


def test_at_the_end_nothing_is_left_to_move() -> None:
    assert shifted(((0.0, 0.0), (10.0, 0.0)), 10.0, 0.6)[0] == (0.0, 0.0)


@given(
    turn=st.floats(-100, 100),
    legs=st.tuples(st.floats(12, 30), st.floats(12, 30)),
    along=st.floats(0.1, 10),  # points that are nearer together become one
    left=st.floats(-1.5, 1.5),
)
def test_what_lies_behind_is_as_it_was_and_the_end_lies_beside(
    turn: float, legs: tuple[float, float], along: float, left: float
) -> None:
    heading = math.radians(turn)
    corner = (legs[0], 0.0)
    path = ((0.0, 0.0), corner, (corner[0] + legs[1] * math.cos(heading), legs[1] * math.sin(heading)))
    old, new = Polyline.of(path), Polyline.of(shifted(path, along, left))
    for share in (0.0, 0.5, 1.0):
        assert new.at(share * along)[:2] == pytest.approx(old.at(share * along)[:2], abs=2e-3)
    assert new.xy[-1] == pytest.approx(old.at(old.length_m, left)[:2], abs=1e-3)
    middle = new.at(along + LINE_OVER_M / 2)
    if along + LINE_OVER_M < legs[0] - 2:
        assert middle[1] == pytest.approx(left / 2, abs=0.05)  # the oblique is a little longer than what it replaces
