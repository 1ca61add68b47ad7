"""The forecaster's compiled loops, against shapely and against every pair of pieces looked at."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
import pytest
from shapely import LineString, Point, Polygon

from foresee_dsl.forecast.geometry import (
    distances_to_ego,
    ever_near,
    feet_on_path,
    paths_cut,
)
from foresee_dsl.kernels import boxes as box_kernels
from foresee_dsl.kernels import lines as path_kernels
from foresee_dsl.kernels.boxes import box_distance, corners
from tests.support.handmade_traces import EAST, NORTH, make_trace, straight, until


def winding(rng: np.random.Generator, pieces: int) -> np.ndarray:
    """A path of pieces of half a metre whose heading drifts, from somewhere in a square of 12 m."""
    heading = rng.uniform(-math.pi, math.pi) + np.cumsum(rng.normal(0, 0.15, pieces))
    steps = 0.5 * np.column_stack([np.cos(heading), np.sin(heading)])
    return rng.uniform(-6, 6, 2) + np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])


def cuts_by_pairs(a: np.ndarray, b: np.ndarray, angle_rad: float) -> bool:
    for p, q in itertools.pairwise(a):
        for r, s in itertools.pairwise(b):
            turn = math.atan2(*(q - p)[::-1]) - math.atan2(*(s - r)[::-1])
            if LineString([p, q]).intersects(LineString([r, s])) and abs(math.sin(turn)) >= math.sin(angle_rad):
                return True
    return False


def test_paths_cut_where_shapely_says_so() -> None:
    rng = np.random.default_rng(1)
    found = {True: 0, False: 0}
    for _ in range(300):
        a, b = winding(rng, int(rng.integers(1, 120))), winding(rng, int(rng.integers(1, 120)))
        cut = paths_cut(a, b, angle_rad=0.0)
        assert cut == LineString(a).intersects(LineString(b))
        assert paths_cut(b, a, angle_rad=0.0) == cut
        found[cut] += 1
    assert min(found.values()) > 40


def test_the_angle_is_that_of_the_pieces_that_cut() -> None:
    rng = np.random.default_rng(2)
    angle = math.radians(50)
    found = {True: 0, False: 0}
    for _ in range(60):
        a, b = winding(rng, 40), winding(rng, 40)
        if paths_cut(a, b, angle_rad=0.0):
            steep = paths_cut(a, b, angle_rad=angle)
            assert steep == cuts_by_pairs(a, b, angle)
            found[steep] += 1
    assert min(found.values()) > 0


def test_points_are_projected_as_shapely_does() -> None:
    rng = np.random.default_rng(3)
    beyond = 0
    for _ in range(40):
        path, points = winding(rng, int(rng.integers(1, 200))), winding(rng, 60)
        gaps, beside = feet_on_path(points, path)
        line = LineString(path)
        assert gaps == pytest.approx([line.distance(Point(p)) for p in points], abs=1e-9)
        along = np.array([line.project(Point(p)) for p in points])
        inside = (along > 1e-9) & (along < line.length - 1e-9)
        assert beside[inside].all()
        beyond += int((~beside).sum())
        # Not beside it: an end of the path is what is nearest.
        ends = np.minimum(np.hypot(*(points - path[0]).T), np.hypot(*(points - path[-1]).T))
        assert gaps[~beside] == pytest.approx(ends[~beside], abs=1e-9)
    assert beyond > 100


def test_a_path_that_stays_in_one_place_has_a_distance() -> None:
    there = np.zeros((3, 2))
    gaps, _ = feet_on_path(np.array([[3.0, 4.0]]), there)
    assert gaps.tolist() == [5.0]
    assert not paths_cut(there, np.array([[-1.0, 0.0], [1.0, 0.0]]), angle_rad=0.0)


def plain(module: ModuleType) -> dict[str, Callable[..., Any]]:
    """A file's kernels as plain functions that call each other: in Python an index out of range is an error."""
    space = dict(vars(module))
    made = {n: FunctionType(f.py_func.__code__, space) for n, f in vars(module).items() if hasattr(f, "py_func")}
    space.update(made)
    return made


def test_compiled_they_answer_as_plain_functions() -> None:
    rng = np.random.default_rng(4)
    of_paths, of_boxes = plain(path_kernels), plain(box_kernels)
    for pieces in (1, 15, 16, 17, 33):
        a, b = winding(rng, pieces), winding(rng, 20)
        assert of_paths["paths_cut"](a, b, 0.0) == path_kernels.paths_cut(a, b, 0.0)
        answers = []
        for project in (of_paths["feet_on_path"], path_kernels.feet_on_path):
            out = np.empty(len(b)), np.empty(len(b), dtype=np.int64), np.empty(len(b))
            project(b, a, *out)
            answers.append(out)
        for one, other in zip(*answers, strict=True):
            assert one == pytest.approx(other, abs=1e-12)
    poses, sizes = rng.uniform(-5, 5, (4, 30, 3)), rng.uniform(0.5, 5, (4, 2))
    functions = of_boxes["gaps_to_first"], box_kernels.gaps_to_first
    found = [function(poses, sizes, np.array([1.0, 5.0, 50.0])) for function in functions]
    assert found[0] == pytest.approx(found[1], abs=1e-12)
    for radius in (0.0, 0.5):
        arguments = poses[:2], poses[2], sizes[:2], radius
        assert of_boxes["ever_within"](*arguments) == box_kernels.ever_within(*arguments)


def test_all_at_once_is_one_after_the_other() -> None:
    trace = make_trace({
        "ego": straight("car", 0, 0, EAST, 5),
        "lead": until(straight("van", 14, 0.3, EAST, 4), 8),
        "walker": straight("pedestrian", 40, -10, NORTH, 1),
        "far": straight("car", 500, 0, EAST, 1),
    })  # fmt: skip
    gaps = distances_to_ego(trace, [1, 2, 3], np.array([10.0, 50.0, 10.0]))
    for row, actor, within in zip(gaps, (1, 2, 3), (10.0, 50.0, 10.0), strict=True):
        assert np.array_equal(row, distances_to_ego(trace, [actor], np.array([within]))[0])
        full = box_distance(trace.boxes(0), trace.boxes(actor))
        assert row[np.isfinite(row)] == pytest.approx(full[np.isfinite(row)], abs=1e-12)
        assert not (full[np.isinf(row)] <= within).any()
    assert np.isinf(gaps[2]).all() and np.isfinite(gaps[0]).any()
    assert distances_to_ego(trace, [], np.empty(0)).shape == (0, trace.frames)


def test_gaps_between_boxes_are_those_of_shapely() -> None:
    rng = np.random.default_rng(6)
    poses, sizes = rng.uniform(-8, 8, (2, 3000, 3)), np.array([[4.5, 1.8], [8.0, 2.4]])
    poses[0, 0, 0] = poses[1, 1, 1] = np.nan
    found = box_kernels.gaps_to_first(poses, sizes, np.array([100.0]))
    boxes = [np.column_stack([p, np.broadcast_to(size, (3000, 2))]) for p, size in zip(poses, sizes, strict=True)]
    outlines = [[Polygon(points) for points in corners(of)[2:]] for of in boxes]
    exact = [one.distance(other) for one, other in zip(*outlines, strict=True)]
    assert np.isinf(found[0, :2]).all()
    assert found[0, 2:] == pytest.approx(exact, abs=1e-9)
    assert np.isnan(box_distance(*boxes)[:2]).all()
    assert box_distance(*boxes)[2:] == pytest.approx(exact, abs=1e-9)
    assert 0.1 < (found == 0).mean() < 0.9


def test_near_is_what_the_exact_distances_say() -> None:
    rng = np.random.default_rng(5)
    found = {True: 0, False: 0}
    trace = make_trace({"ego": straight("car", 0, 0, EAST, 0), "van": straight("van", 1, 2, NORTH, 0.1)})
    boxes = trace.boxes(1)[10:13]
    for _ in range(300):
        ways = rng.uniform(-9, 9, (2, 3, 3))
        ways[0, 0, 0] = np.nan  # absent
        near = ever_near(trace, 1, ways, 10, 0.5)
        ego = np.concatenate([ways, np.broadcast_to((4.0, 1.8), (2, 3, 2))], axis=2)
        assert near == bool((box_distance(ego, np.broadcast_to(boxes, ego.shape)) <= 0.5).any())
        found[near] += 1
    assert min(found.values()) > 50
    assert not ever_near(trace, 1, np.full((2, 3, 3), np.nan), 10, 1e9)
