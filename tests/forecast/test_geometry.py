import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foresee_dsl.forecast.geometry import (
    distances_to_ego,
    enters_from_side,
    feet_on_path,
    local_minima,
    paths_cut,
    thinned_path,
)
from tests.support.handmade_traces import EAST, WEST, make_trace, straight, until


def minima(values, within=10.0, prominence=0.1):
    return local_minima(np.array(values, dtype=float), within_m=within, prominence_m=prominence)


def test_distance_is_between_footprints_and_infinite_where_absent():
    trace = make_trace({"ego": straight("car", 0, 0, EAST, 0), "lead": until(straight("car", 14, 0, EAST, 0), 5)})
    gaps = distances_to_ego(trace, [1])[0]
    assert gaps[0] == pytest.approx(10.0)  # 14 m between the centres of two cars of 4 m
    assert np.isinf(gaps[101:]).all()


def test_distance_beyond_the_radius_is_not_computed_and_never_too_small():
    trace = make_trace({"ego": straight("car", 0, 0, EAST, 5), "runner": straight("car", 100, 40, WEST, 7)})
    full, near = distances_to_ego(trace, [1])[0], distances_to_ego(trace, [1], np.array([30.0]))[0]
    assert np.array_equal(near[full <= 30], full[full <= 30])
    assert np.isinf(near[full > 45]).all()


def test_a_plateau_counts_once_from_its_first_to_its_last_frame():
    assert minima([9, 5, 5, 5, 9]) == [(1, 3)]


def test_every_minimum_counts_where_the_distance_rises_between():
    assert minima([9, 5, 8, 4, 9, 6]) == [(1, 1), (3, 3), (5, 5)]


def test_trembling_makes_no_minima_and_the_lowest_is_kept():
    assert minima([9, 5.02, 5.05, 5.0, 5.04, 5.01, 9]) == [(3, 5)]


def test_presence_begins_and_ends_with_a_minimum():
    assert minima([math.inf, 3, 4, 5, math.inf, 7, 6, math.inf]) == [(1, 1), (6, 6)]


def test_minima_beyond_the_radius_are_left_out():
    assert minima([30, 20, 30, 9.9, 30]) == [(3, 3)]


@given(st.lists(st.floats(0, 20), min_size=1, max_size=60), st.floats(0.5, 20))
def test_the_smallest_distance_is_among_the_minima(values, within):
    found = minima(values, within)
    lowest = min(values)
    if lowest <= within:
        assert min(values[first] for first, _ in found) == lowest
    else:
        assert found == []


def test_a_path_is_thinned_to_its_step_and_keeps_its_ends():
    points = np.column_stack([np.linspace(0, 10, 1001), np.zeros(1001)])
    thin = thinned_path(points, 0.5)
    assert 20 <= len(thin) <= 22
    assert thin[0].tolist() == [0, 0]
    assert thin[-1].tolist() == [10, 0]
    assert len(thinned_path(np.zeros((50, 2)), 0.5)) == 1


def test_feet_lie_beside_a_path_or_beyond_its_ends():
    path = np.array([[0.0, 0.0], [10.0, 0.0]])
    gap, beside = feet_on_path(np.array([[5.0, 3.0], [-4.0, 3.0]]), path)
    assert gap.tolist() == [3.0, 5.0]
    assert beside.tolist() == [True, False]


def test_paths_cut_at_an_angle_only():
    east = np.array([[0.0, 0.0], [10.0, 0.0]])
    north = np.array([[5.0, -5.0], [5.0, 5.0]])
    nearly = np.array([[0.0, -0.1], [10.0, 0.1]])
    assert paths_cut(east, north, angle_rad=math.radians(20))
    assert not paths_cut(east, nearly, angle_rad=math.radians(20))
    assert not paths_cut(east, north + 20, angle_rad=0.0)


def test_a_cut_in_enters_from_the_side_and_a_follower_does_not():
    ego = np.column_stack([np.linspace(0, 100, 201), np.zeros(201)])
    cut_in = np.array([[20.0, 3.3], [40.0, 3.3], [60.0, 0.0], [90.0, 0.0]])
    follower = np.column_stack([np.linspace(-30, 70, 201), np.full(201, 0.1)])
    leader_that_turns_off = np.array([[20.0, 0.0], [60.0, 0.0], [60.0, 30.0]])
    assert enters_from_side(thinned(cut_in), ego, half_width_m=1.8)
    assert not enters_from_side(follower, ego, half_width_m=1.8)
    assert not enters_from_side(thinned(leader_that_turns_off), ego, half_width_m=1.8)


def thinned(corners):
    """The corners with points every half metre between."""
    gone = np.r_[0, np.cumsum(np.hypot(*np.diff(corners, axis=0).T))]
    s = np.arange(0, gone[-1], 0.5)
    return np.column_stack([np.interp(s, gone, corners[:, 0]), np.interp(s, gone, corners[:, 1])])
