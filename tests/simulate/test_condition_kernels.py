"""Conditions are decided by the same numbers, and in the same way, as by plain Python and by shapely."""

from __future__ import annotations

import math

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st

from foresee_dsl.kernels.boxes import Box, Mover, box_distance, corner_points
from foresee_dsl.kernels.conditions import INSIDE, OUTSIDE, UNSURE, beside_area, gap, gap_within
from foresee_dsl.simulate.results.metrics import Outline, outline_of
from tests.support.compiled_metrics import ttc
from tests.support.plain_conditions import plain_ttc

metres = st.floats(-40, 40)
headings = st.sampled_from([0.0, math.pi / 2, math.pi, -math.pi / 2]) | st.floats(-7, 7)
boxes = st.builds(Box, metres, metres, headings, st.floats(0.3, 12), st.floats(0.3, 3))
speeds = st.just(0.0) | st.floats(0, 20)
movers = st.builds(Mover, metres, metres, headings, speeds, st.floats(0.3, 12), st.floats(0.3, 3))


@given(boxes, boxes)
def test_a_condition_uses_the_same_distance_as_every_measure(a: Box, b: Box) -> None:
    both = np.array((a, b))
    assert gap(both, both[:, 3:], 0, 1) == box_distance(a, b)


@given(boxes, boxes, st.floats(-1, 60))
def test_who_is_told_to_be_farther_than_a_bound_is(a: Box, b: Box, bound: float) -> None:
    both = np.array((a, b))
    told, away = gap_within(both, both[:, 3:], 0, 1, bound), box_distance(a, b)
    assert told == away or (told == math.inf and away > bound)


@given(movers, movers)
def test_times_to_collision_have_the_bits_of_plain_python(a: Mover, b: Mover) -> None:
    assert ttc(a, b) == plain_ttc(a, b)


@st.composite
def areas(draw: st.DrawFn) -> Outline:
    """A star of some corners, perhaps one that cuts itself, perhaps long and thin."""
    count = draw(st.integers(3, 9))
    turns = draw(st.sampled_from([1, 1, 1, 2]))
    reach = st.floats(1, 25)
    points = []
    for k in range(count):
        away, angle = draw(reach), turns * math.tau * k / count
        points.append((away * math.cos(angle), draw(st.sampled_from([1.0, 1.0, 0.05])) * away * math.sin(angle)))
    return outline_of(tuple(points))


@given(areas(), boxes)
def test_who_is_told_to_be_in_an_area_is_in_it(outline: Outline, box: Box) -> None:
    area, borders, bounds = outline
    table = np.array([box])
    told = beside_area(table, table[:, 3:], 0, borders, bounds)
    away = shapely.distance(area, shapely.Polygon(corner_points(box)))
    assert told in (INSIDE, OUTSIDE, UNSURE)
    if told == INSIDE:
        assert away == 0
    if told == OUTSIDE:
        assert away > 0 or area.is_empty


@given(areas(), boxes)
def test_who_is_clear_of_the_border_is_told_about(outline: Outline, box: Box) -> None:
    area, borders, bounds = outline
    table, shape = np.array([box]), shapely.Polygon(corner_points(box))
    if not len(borders):
        return
    told = beside_area(table, table[:, 3:], 0, borders, bounds)
    if shapely.distance(area, shape) > 1e-3:
        assert told == OUTSIDE
    if shapely.contains_properly(area, shapely.buffer(shape, 1e-3)):
        assert told == INSIDE
