"""The forward view: a pinhole camera over flat ground, with boxes and walls that hide everything behind them.

The camera is level, so everything upright in a column of the picture lies in one vertical plane. For each column, a ray
over the ground gives the places where it enters each box and each wall; height and distance give the rows. In each
pixel the nearest one is shown.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.roads.polyline import Points
from foresee_dsl.kernels.arrays import FloatArray, IntArray
from foresee_dsl.simulate.sensing.views import CAMERA_RANGE_M
from foresee_learned.rasters.birdseye import Pose
from foresee_learned.rasters.ground import GroundMap
from foresee_learned.rasters.layout import (
    BUILDING_HEIGHT_M,
    CAMERA_AHEAD_M,
    CAMERA_HEIGHT_M,
    FORWARD,
    FORWARD_CHANNELS,
    INVERSE_DEPTH_SCALE,
    MAP_BITS,
)

_NEAR_M = 0.1
"""An object nearer to the camera than this is not drawn, m; a box around the camera is drawn from this distance on."""
_SNAP = 1024
"""Rows are rounded to this fraction of a pixel. Ours: processors that differ in the last digit then draw the same
picture."""
_CLASSES = len(FORWARD_CHANNELS) - 1
_NONE = _CLASSES
"""The label of a pixel that shows nothing."""
_BUILDING = FORWARD_CHANNELS.index("building")
_PLANES = np.arange(_CLASSES, dtype=np.uint8)[:, None, None]


def _labels_of_ground() -> NDArray[np.uint8]:
    """Return the class in the forward view for each of the 256 values of a map's bits."""
    values = np.arange(256)
    bit = {name: (values >> k & 1).astype(bool) for k, name in enumerate(MAP_BITS)}
    label = {name: FORWARD_CHANNELS.index(name) for name in ("road", "marking", "footway", "ground")}
    labels = np.full(256, label["ground"], np.uint8)
    labels[bit["footway"]] = label["footway"]
    labels[bit["drivable"] | bit["parking"]] = label["road"]
    labels[bit["marking"] | bit["crossing"]] = label["marking"]
    return labels


_GROUND = _labels_of_ground()


class Camera:
    """Draws forward views on one map."""

    def __init__(self, ground: GroundMap, buildings: Sequence[Points] = ()) -> None:
        """Prepare a map with the outlines of its buildings, m."""
        layout = FORWARD
        self._map, self._layout = ground, layout
        outlines = [_counter_clockwise(outline) for outline in buildings]
        walls = [(a, b) for outline in outlines for a, b in zip(outline, (*outline[1:], outline[0]), strict=True)]
        self._walls = np.array(walls, dtype=np.float64).reshape(-1, 2, 2)
        middle = layout.rows // 2
        below: FloatArray = np.arange(middle, dtype=np.float64) + 0.5  # rows under the horizon
        self._slopes: FloatArray = (
            layout.columns / 2 - np.arange(layout.columns, dtype=np.float64) - 0.5
        ) / layout.focal_px
        depth: FloatArray = layout.focal_px * CAMERA_HEIGHT_M / below[:, None]
        self._ground_ahead: FloatArray = depth + CAMERA_AHEAD_M
        self._ground_left: FloatArray = depth * self._slopes
        self._ground_depth = np.full((layout.rows, layout.columns), np.inf, np.float32)
        self._ground_depth[middle:] = depth
        self._rows = np.arange(layout.rows)[:, None]

    def draw(
        self, pose: Pose, boxes: FloatArray, labels: IntArray, *, range_m: float = CAMERA_RANGE_M
    ) -> NDArray[np.uint8]:
        """Draw one picture.

        Args:
            pose: the ego's middle (m) and heading (rad).
            boxes: [K, 7] x, y (m), heading (rad), length, width, lower and upper edge above the road (m); NaN where
                one is absent.
            labels: [K] index into `FORWARD_CHANNELS`.
            range_m: objects farther ahead than this are not drawn.

        Returns:
            [C, H, W] uint8, channels as in `FORWARD_CHANNELS`.
        """
        depth = self._ground_depth.copy()
        label = np.full(depth.shape, _NONE, np.uint8)
        middle = self._layout.rows // 2
        label[middle:] = _GROUND[self._map.sample(pose, self._ground_ahead, self._ground_left)]
        self._draw_walls(pose, depth, label, range_m)
        self._draw_boxes(pose, boxes, labels, depth, label, range_m)
        far = depth > range_m
        label[far] = _NONE
        depth[far] = np.inf
        picture = np.empty(self._layout.shape, np.uint8)
        planes = picture[:_CLASSES]
        np.equal(label, _PLANES, out=planes.view(np.bool_))
        np.negative(planes, out=planes)  # 1 becomes 255
        picture[_CLASSES] = np.minimum(np.rint(INVERSE_DEPTH_SCALE / depth), 255)
        return picture

    def _draw_walls(self, pose: Pose, depth: NDArray[np.float32], label: NDArray[np.uint8], range_m: float) -> None:
        """Draw the nearest wall of each column; it hides all others, because all buildings are equally high."""
        if not len(self._walls):
            return
        ahead, left = self._seen_from(pose, self._walls[..., 0], self._walls[..., 1])
        inside = (ahead.max(axis=1) > 0) & (ahead.min(axis=1) < range_m)
        # Distance of both ends of a wall to the left of the picture's left edge and of its right edge, m.
        side = left - ahead * self._slopes[[0, -1], None, None]
        inside &= (side[0].min(axis=1) < 0) & (side[1].max(axis=1) > 0)
        # Outlines run counter-clockwise, so a wall that faces the camera has the camera on its right.
        inside &= ahead[:, 0] * left[:, 1] < ahead[:, 1] * left[:, 0]
        if not inside.any():
            return
        (z0, z1), (l0, l1) = ahead[inside].T[..., None], left[inside].T[..., None]
        off0, off1 = l0 - z0 * self._slopes, l1 - z1 * self._slopes
        meets = (off0 > 0) != (off1 > 0)
        share = off0 / np.where(meets, off0 - off1, 1.0)
        z = np.where(meets, z0 + (z1 - z0) * share, np.inf)
        nearest = np.where(z > _NEAR_M, z, np.inf).min(axis=0)
        columns = np.flatnonzero(nearest <= range_m)
        if len(columns):
            at = nearest[columns]
            top, below = self._row(BUILDING_HEIGHT_M, at), self._row(0.0, at)
            visible = (self._rows >= top) & (self._rows < below)
            label[:, columns] = np.where(visible, np.uint8(_BUILDING), label[:, columns])
            depth[:, columns] = np.where(visible, at, depth[:, columns])

    def _draw_boxes(
        self,
        pose: Pose,
        boxes: FloatArray,
        labels: IntArray,
        depth: NDArray[np.float32],
        label: NDArray[np.uint8],
        range_m: float,
    ) -> None:
        if not len(boxes):
            return
        ahead, left = self._seen_from(pose, boxes[:, 0], boxes[:, 1])
        radius = np.hypot(boxes[:, 3], boxes[:, 4]) / 2
        near = (ahead + radius > _NEAR_M) & (ahead - radius < range_m)  # False for NaN
        near &= np.abs(left) - radius * 1.5 <= np.maximum(ahead + radius, 0.0) * self._slopes[0]
        chosen = np.flatnonzero(near)
        if not len(chosen):
            return
        entry, exit_ = self._entered(boxes[chosen], ahead[chosen], left[chosen], boxes[chosen, 2] - pose[2])
        low, high = boxes[chosen, 5, None], boxes[chosen, 6, None]
        # A box that ends below the camera shows its top up to its far edge; one that begins above the camera shows its
        # underside.
        top = self._row(high, np.where(high < CAMERA_HEIGHT_M, exit_, entry))
        below = np.maximum(self._row(low, np.where(low > CAMERA_HEIGHT_M, exit_, entry)), top + 1)
        for k, box in enumerate(chosen.tolist()):
            columns = np.flatnonzero(entry[k] <= range_m)
            if not len(columns):
                continue
            across = slice(int(columns[0]), int(columns[-1]) + 1)  # a box is convex, so its columns are neighbours
            over = slice(max(int(top[k, across].min()), 0), max(int(below[k, across].max()), 0))
            rows, at = self._rows[over], entry[k, across]
            behind = depth[over, across]
            visible = (rows >= top[k, across]) & (rows < below[k, across]) & (at < behind)
            label[over, across][visible] = labels[box]
            np.copyto(behind, at, where=visible, casting="same_kind")

    def _entered(
        self, boxes: FloatArray, ahead: FloatArray, left: FloatArray, turned: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return [K, W] how far ahead the ray of each column enters and leaves each box, m; infinite if it does not."""
        c, s = np.cos(turned)[:, None], np.sin(turned)[:, None]
        # An object that is thin and far away gets at least one column, so that no pedestrian is lost between two rays.
        least = np.maximum(ahead, 0.0)[:, None] / self._layout.focal_px
        half_length, half_width = (np.maximum(boxes[:, k, None], least) / 2 for k in (3, 4))
        along, across = ahead[:, None] * c + left[:, None] * s, left[:, None] * c - ahead[:, None] * s
        step_along, step_across = c + s * self._slopes, c * self._slopes - s
        low_a, high_a = _stretch(along, half_length, step_along)
        low_b, high_b = _stretch(across, half_width, step_across)
        entry, exit_ = np.maximum(low_a, low_b), np.minimum(high_a, high_b)
        hit = exit_ > np.maximum(entry, _NEAR_M)
        return np.where(hit, np.maximum(entry, _NEAR_M), np.inf), np.where(hit, exit_, np.inf)

    def _seen_from(self, pose: Pose, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far ahead of the camera and to its left points are, m."""
        c, s = math.cos(pose[2]), math.sin(pose[2])
        dx, dy = x - pose[0], y - pose[1]
        return c * dx + s * dy - CAMERA_AHEAD_M, c * dy - s * dx

    def _row(self, height_m: FloatArray | float, depth_m: FloatArray) -> IntArray:
        """Return the first row whose middle is below a height at a distance; outside the picture, the row at
        its edge.
        """
        rows = self._layout.rows
        over = (np.asarray(height_m) - CAMERA_HEIGHT_M) * self._layout.focal_px / depth_m
        exact = np.clip(rows / 2 - over, -1.0, rows + 1.0)
        return np.ceil(np.rint(exact * _SNAP) / _SNAP - 0.5).astype(np.int64)


def _counter_clockwise(outline: Points) -> Points:
    twice_area = sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in pairwise((*outline, outline[0])))
    return outline if twice_area > 0 else outline[::-1]


def _stretch(middle: FloatArray, half: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and the largest z with |step * z - middle| <= half, [K, W]."""
    safe = np.where(np.abs(step) < 1e-12, 1e-12, step)
    first, other = (middle - half) / safe, (middle + half) / safe
    return np.minimum(first, other), np.maximum(first, other)
