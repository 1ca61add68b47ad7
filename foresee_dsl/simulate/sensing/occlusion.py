"""Who hides what: lines of sight past boxes with a height and past buildings, which are as high as one likes.

All is relative to an eye at some height over a flat ground. A body hides a point when the straight line from the eye to
the point runs through the body's footprint and, somewhere on that stretch, lower than the body's top. So a child
behind a parked car is hidden, an adult's head behind it is not, and a lorry hides both.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.polyline import Points
from foresee_dsl.simulate.collision import corners

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

_AROUND_M = 10.0
"""The walls near the eye are looked up again when it has moved this far."""
_TINY = 1e-12
"""Stands for 0 in a division."""


def marks(boxes: FloatArray) -> FloatArray:
    """Return where bodies are looked at: the corners and the centres of boxes.

    Args:
        boxes: [N, 5] x, y, heading, length, width.

    Returns:
        [N, 5, 2] m, the centres last.
    """
    points = np.empty((len(boxes), 5, 2))
    points[:, :4] = corners(boxes)
    points[:, 4] = boxes[:, :2]
    return points


@lru_cache(maxsize=8)
def _sides(buildings: tuple[Points, ...]) -> tuple[FloatArray, FloatArray]:
    """Return where the sides of buildings begin, counter-clockwise, and how they go on, [M, 2] m: once a network."""
    outlines = [np.array(outline, dtype=np.float64).reshape(-1, 2) for outline in buildings]
    outlines = [outline[::-1] if _area(outline) < 0 else outline for outline in outlines if len(outline) > 2]
    empty = np.empty((0, 2))
    ways = [np.roll(outline, -1, axis=0) - outline for outline in outlines]
    return np.concatenate([empty, *outlines]), np.concatenate([empty, *ways])


class Walls:
    """The outlines of buildings. An eye inside one sees out of it, and through it."""

    def __init__(self, buildings: Iterable[Points], reach_m: float) -> None:
        """Take up outlines, open or closed, in either direction.

        Args:
            buildings: outlines, m. reach_m: how far lines of sight go at most.
        """
        self._from, self._way = _sides(tuple(tuple(outline) for outline in buildings))
        empty = np.empty((0, 2))
        self._reach_m = reach_m
        self._near_from, self._near_way, self._near_outer = empty, empty, empty
        self._looked_up: tuple[float, float] | None = None

    def cut(self, x: float, y: float, points: FloatArray) -> BoolArray | None:
        """Say which lines of sight run through a building.

        Args:
            x, y: the eye, m. points: [N, 2] relative to it.

        Returns:
            [N]; None where there is no building near.
        """
        self._look_up(x, y)
        if not len(self._near_way):
            return None
        starts = self._near_from - (x, y)
        outer = self._near_outer
        # The eye sees the walls on whose outer side it is. A line that enters a building does so through one of these.
        depths = (starts * outer).sum(axis=1)
        facing = np.flatnonzero(depths < 0.0)
        starts, depths = starts[facing], depths[facing]
        behind = points @ outer[facing].T < depths
        # The wall's ends lie on both sides of the line: crosswise products with them have different signs.
        turned = points[:, ::-1] * (-1.0, 1.0)
        left, right = turned @ starts.T, turned @ (starts + self._near_way[facing]).T
        hidden: BoolArray = np.any(behind & (left * right <= 0.0), axis=1)
        return hidden

    def _look_up(self, x: float, y: float) -> None:
        at = self._looked_up
        if at is not None and abs(x - at[0]) <= _AROUND_M and abs(y - at[1]) <= _AROUND_M:
            return
        self._looked_up = (x, y)
        if not len(self._way):
            return
        to_eye = np.array((x, y)) - self._from
        lengths = np.maximum((self._way**2).sum(axis=1), _TINY)
        nearest = np.clip((to_eye * self._way).sum(axis=1) / lengths, 0.0, 1.0)
        gaps = np.hypot(*(to_eye - nearest[:, None] * self._way).T)
        near = gaps <= self._reach_m + 2 * _AROUND_M
        self._near_from, self._near_way = self._from[near], self._way[near]
        self._near_outer = self._near_way[:, ::-1] * (1.0, -1.0)


def _area(outline: FloatArray) -> float:
    """Twice the signed area, positive when the outline runs counter-clockwise."""
    x, y = outline[:, 0], outline[:, 1]
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def cut_by_boxes(
    points: FloatArray, rises: FloatArray, own: IntArray, boxes: FloatArray, tops: FloatArray
) -> BoolArray:
    """Say which lines of sight run through a box, below its top.

    A body's own box does not hide it: it lies around the points.

    Args:
        points: [N, P, 2] of N bodies, relative to the eye, the last one in the middle of the others.
        rises: [N, H] heights over the eye at which the points are looked at, m.
        own: [N] each body's box, -1 for a body that has none (a point).
        boxes: [K, 5] x, y relative to the eye, heading, length, width.
        tops: [K] height of the boxes over the eye, m; mostly negative.

    Returns:
        [N, P, H].
    """
    hidden = np.zeros((*points.shape[:2], rises.shape[1]), dtype=np.bool_)
    if not len(boxes) or not len(points):
        return hidden
    bodies, others = _may_hide(points[:, -1], own, boxes)
    if not len(bodies):
        return hidden
    enter, leave = _stretches(points[bodies], boxes[others])
    rise = rises[bodies][:, None, :]
    # The line's height is linear along it: it is lowest where it leaves the box, or enters when the line rises.
    lowest = rise * np.where(rise < 0.0, leave[..., None], enter[..., None])
    cuts = (enter < leave)[..., None] & (lowest < tops[others][:, None, None])
    first = np.flatnonzero(np.concatenate(([True], bodies[1:] != bodies[:-1])))  # pairs come body by body
    hidden[bodies[first]] = np.logical_or.reduceat(cuts, first, axis=0)
    return hidden


def _may_hide(centres: FloatArray, own: IntArray, boxes: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the pairs of body and box near enough to a common line of sight, [C] and [C], body by body."""
    gaps = np.maximum(np.sqrt((centres * centres).sum(axis=1)), _TINY)
    ways = centres / gaps[:, None]
    radii = 0.5 * np.sqrt(boxes[:, 3] ** 2 + boxes[:, 4] ** 2)
    room = radii + np.where(own < 0, 0.0, radii[own])[:, None]
    along = ways @ boxes[:, :2].T
    aside = np.abs(ways[:, :1] * boxes[:, 1] - ways[:, 1:] * boxes[:, 0])
    near = (aside < room) & (along > -room) & (along < gaps[:, None] + room)
    near &= own[:, None] != np.arange(len(boxes))
    bodies, others = np.nonzero(near)
    return bodies, others


def _stretches(points: FloatArray, boxes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where lines from the eye to points [C, P, 2] enter and leave one box each, as shares of the way.

    In the box's own axes it is the set of points within half its length and half its width; a line is within each over
    one stretch, and runs through the box where the stretches meet. A line that misses it enters after it leaves.
    """
    cos, sin = np.cos(boxes[:, 2:3]), np.sin(boxes[:, 2:3])
    x, y = boxes[:, 0:1], boxes[:, 1:2]
    px, py = points[..., 0], points[..., 1]
    begin, end = np.zeros_like(px), np.ones_like(px)
    for along, way, half in (
        (x * cos + y * sin, px * cos + py * sin, boxes[:, 3:4] / 2),
        (y * cos - x * sin, py * cos - px * sin, boxes[:, 4:5] / 2),
    ):
        per_m = 1.0 / np.where(np.abs(way) < _TINY, _TINY, way)
        middle, reach = along * per_m, half * np.abs(per_m)
        begin, end = np.maximum(begin, middle - reach), np.minimum(end, middle + reach)
    return begin, end
