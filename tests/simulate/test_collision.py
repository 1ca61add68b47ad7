"""Oriented boxes against shapely, which computes the same with general polygons."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon

from foresee_dsl.kernels.boxes import (
    Box,
    box_distance,
    box_overlap,
    corner_points,
    corners,
    hits,
    overlaps,
)

boxes = st.builds(Box, st.floats(-8, 8), st.floats(-8, 8), st.floats(-7, 7), st.floats(0.3, 12), st.floats(0.3, 3))


def polygon(box: Box) -> Polygon:
    return Polygon(corner_points(box))


@given(boxes, boxes)
def test_distance_and_overlap_agree_with_shapely(a: Box, b: Box) -> None:
    expected = polygon(a).distance(polygon(b))
    assert box_distance(a, b) == pytest.approx(expected, abs=1e-9)
    if expected > 1e-9:
        assert not overlaps(a, b)
    elif polygon(a).intersection(polygon(b)).area > 1e-9:
        assert overlaps(a, b)


@given(boxes, st.lists(boxes, min_size=1, max_size=12))
def test_sets_agree_with_single_pairs(ego: Box, others: list[Box]) -> None:
    rows = np.array(others)
    single = [box_distance(ego, o) for o in others]
    assert box_distance(ego, rows) == pytest.approx(np.array(single), abs=1e-9)
    assert box_distance(np.array([ego] * len(others)), rows) == pytest.approx(np.array(single), abs=1e-9)
    found = [k for k, o in enumerate(others) if overlaps(ego, o)]
    assert hits(np.array(ego), rows[:, :3], rows[:, 3:]).tolist() == found
    assert np.flatnonzero(box_overlap(np.array(ego), rows)).tolist() == found


@given(boxes, boxes)
def test_distance_is_symmetric_and_moves_with_the_frame(a: Box, b: Box) -> None:
    distance = box_distance(a, b)
    assert box_distance(b, a) == pytest.approx(distance, abs=1e-9)
    turn, c, s = 0.7, math.cos(0.7), math.sin(0.7)

    def moved(o: Box) -> Box:
        return Box(o.x * c - o.y * s + 100, o.x * s + o.y * c - 50, o.heading + turn, o.length, o.width)

    assert box_distance(moved(a), moved(b)) == pytest.approx(distance, abs=1e-9)


def test_distances_worked_out_by_hand() -> None:
    car = Box(0, 0, 0, 4, 2)
    assert box_distance(car, Box(7, 0, 0, 4, 2)) == pytest.approx(3)  # nose to tail: 7 - 2 - 2
    assert box_distance(car, Box(0, 3, math.pi, 4, 2)) == pytest.approx(1)  # side by side: 3 - 1 - 1
    assert box_distance(car, Box(7, 6, 0, 4, 2)) == pytest.approx(5)  # corner to corner: 3 along, 4 across
    assert box_distance(car, Box(5, 0, math.pi / 2, 4, 2)) == pytest.approx(2)  # across ahead: 5 - 2 - 1
    root = math.sqrt(2)
    assert box_distance(car, Box(5, 0, math.pi / 4, 2, 2)) == pytest.approx(3 - root)  # a square on its corner
    assert box_distance(car, Box(0, 0, math.pi / 2, 8, 1)) == 0  # a cross: no corner of either lies in the other
    assert box_distance(car, Box(4, 0, 0, 4, 2)) == 0  # touching


def test_touching_counts_and_a_hair_does_not() -> None:
    car = Box(0, 0, 0, 4, 2)
    assert overlaps(car, Box(4, 0, 0, 4, 2))
    assert not overlaps(car, Box(4 + 1e-9, 0, 0, 4, 2))


def test_corners_run_counter_clockwise_from_front_left() -> None:
    box = Box(1, 2, math.pi / 2, 4, 2)
    expected = [(0, 4), (0, 0), (2, 0), (2, 4)]
    assert corners(box) == pytest.approx(np.array(expected, dtype=float))
    assert np.array(corner_points(box)) == pytest.approx(corners(box))
    assert corners(np.array([[box, box], [box, box]])).shape == (2, 2, 4, 2)
    assert polygon(box).exterior.is_ccw


def test_the_absent_hit_nothing() -> None:
    nan = math.nan
    poses = np.array([[nan, nan, nan], [1.0, 0.0, 0.0]])
    sizes = np.array([[4.0, 2.0], [4.0, 2.0]])
    assert hits(np.array((0.0, 0, 0, 4, 2)), poses, sizes).tolist() == [1]
    distances = box_distance(Box(0, 0, 0, 4, 2), np.hstack([poses, sizes]))
    assert math.isnan(distances[0])
    assert distances[1] == 0
    assert math.isnan(box_distance(Box(0, 0, 0, 4, 2), Box(nan, nan, nan, 4, 2)))
    assert hits(np.array((0.0, 0, 0, 4, 2)), np.empty((0, 3)), np.empty((0, 2))).size == 0
