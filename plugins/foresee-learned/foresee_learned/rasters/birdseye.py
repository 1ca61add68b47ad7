"""The bird's-eye view: a window of the map around the ego, and the road users and stop lines on it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.protocol import SignalColour, Window
from foresee_dsl.kernels.arrays import FloatArray, IntArray
from foresee_learned.rasters.fill import box_pixels
from foresee_learned.rasters.ground import GroundMap
from foresee_learned.rasters.layout import (
    BIRDS_EYE,
    BIRDS_EYE_CHANNELS,
    GROUPS,
    MAP_BITS,
    VELOCITY_PER_MPS,
    VELOCITY_ZERO,
    WHOLE,
)

Pose = tuple[float, float, float]
"""x, y (m), heading (rad)."""

_LEAST_PX = 2.0
"""Shortest length at which the side of a footprint is drawn, px. From the square root of two on, at least the middle of
one pixel is inside, at any angle. Ours: with 1.5 a pedestrian was often a single pixel."""
_STOP_M = 1.0
"""Thickness of a stop line along the road, m. Ours: two pixels; painted lines have 0.3 to 0.5 m."""
_MAP = len(MAP_BITS)
_STOP = {name: BIRDS_EYE_CHANNELS.index(f"stop_{name}") for name in ("red", "amber", "green", "other")}
_GROUP = BIRDS_EYE_CHANNELS.index(GROUPS[0])
_AHEAD, _LEFT, _EGO = (BIRDS_EYE_CHANNELS.index(name) for name in ("velocity_ahead", "velocity_left", "ego"))


@dataclass(frozen=True, slots=True)
class StopLine:
    """A place at which the ego's route reaches a junction: the line's middle (m), the route's heading (rad), the line's
    width (m).

    `signal`: the key into `Observation.signals`, or None. `heads`: places of the signal's lamps: x, y, height above the
    road (m).
    """

    x: float
    y: float
    heading_rad: float
    width_m: float
    signal: str | None
    heads: tuple[tuple[float, float, float], ...] = ()


class BirdsEye:
    """Draws bird's-eye views on one map."""

    def __init__(
        self,
        ground: GroundMap,
        stops: Sequence[StopLine] = (),
        ego_size_m: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Use a map on which the route is drawn already, and the route's stop lines.

        An ego without a size (length, width) is not drawn.
        """
        layout = BIRDS_EYE
        self._ground, self._stops, self._layout = ground, stops, layout
        scale = layout.m_per_px
        self._ahead_m: FloatArray = (
            layout.rows_ahead - np.arange(layout.rows, dtype=np.float64)[:, None] - 0.5
        ) * scale
        self._left_m: FloatArray = (
            layout.columns / 2 - np.arange(layout.columns, dtype=np.float64)[None, :] - 0.5
        ) * scale
        self._lines = np.array([(s.x, s.y, s.heading_rad, 0.0, _STOP_M, s.width_m) for s in stops]).reshape(-1, 6)
        self._bit = (1 << np.arange(_MAP, dtype=np.uint8))[:, None, None]
        ego = np.array([(0.0, 0.0, 0.0, 0.0, *ego_size_m)]) if min(ego_size_m) > 0 else np.empty((0, 6))
        self._ego, self._own_pixels = ego, dict[Window, IntArray]()

    def draw(
        self,
        pose: Pose,
        actors: FloatArray,
        groups: IntArray,
        signals: Mapping[str, SignalColour],
        window: Window = WHOLE,
    ) -> NDArray[np.uint8]:
        """Draw one picture.

        Args:
            pose: the ego's middle and heading.
            actors: [K, 6] x, y (m), heading (rad), speed (m/s), length, width (m); NaN where one is absent.
            groups: [K] index into `GROUPS`. signals: the colours that are seen.
            window: the part to draw; its pixels are those of the whole picture.

        Returns:
            [C, H, W] uint8, channels as in `BIRDS_EYE_CHANNELS`.
        """
        picture = np.empty((len(BIRDS_EYE_CHANNELS), window.rows, window.columns), np.uint8)
        self._draw_map(pose, picture[:_MAP], window)
        picture[_MAP:] = 0
        flat = picture.reshape(len(BIRDS_EYE_CHANNELS), -1)
        # Stop lines and road users are drawn in the same calls, because a call takes longer than its arithmetic.
        channels = [_STOP.get(signals.get(s.signal or "", ""), _STOP["other"]) for s in self._stops]
        box, pixel = self._pixels(pose, np.concatenate((self._lines, actors)), window)
        flat[np.concatenate((np.array(channels, np.int64), groups + _GROUP))[box], pixel] = 255
        first = np.searchsorted(box, len(channels))
        actor, pixel = box[first:] - len(channels), pixel[first:]
        turned, speed = actors[:, 2] - pose[2], actors[:, 3]
        flat[_AHEAD, pixel] = _velocity(speed * np.cos(turned))[actor]
        flat[_LEFT, pixel] = _velocity(speed * np.sin(turned))[actor]
        flat[_EGO, self._own(window)] = 255
        return picture

    def _own(self, window: Window) -> IntArray:
        """Return the pixels of the ego, which are the same in every picture."""
        if window not in self._own_pixels:
            self._own_pixels[window] = self._pixels((0.0, 0.0, 0.0), self._ego, window)[1]
        return self._own_pixels[window]

    def _draw_map(self, pose: Pose, planes: NDArray[np.uint8], window: Window) -> None:
        rows, columns = slice(window.top, window.top + window.rows), slice(window.left, window.left + window.columns)
        bits = self._ground.sample(pose, self._ahead_m[rows], self._left_m[:, columns])
        np.bitwise_and(bits, self._bit, out=planes)
        np.not_equal(planes, 0, out=planes.view(np.bool_))
        np.negative(planes, out=planes)  # 1 becomes 255

    def _pixels(self, pose: Pose, boxes: FloatArray, window: Window) -> tuple[IntArray, IntArray]:
        """Return the pixels of [K, 6] boxes as `actors` has them: index of the box, flat index of the pixel."""
        layout, (x, y, heading) = self._layout, pose
        c, s = math.cos(heading), math.sin(heading)
        dx, dy = boxes[:, 0] - x, boxes[:, 1] - y
        ahead, left = (c * dx + s * dy) / layout.m_per_px, (c * dy - s * dx) / layout.m_per_px
        # This drops actors that are too far away, and absent ones: a distance of NaN is not within the picture's reach.
        reach = max(layout.rows, layout.columns) + boxes[:, 4] / layout.m_per_px
        near = np.flatnonzero(np.hypot(ahead, left) <= reach)
        turned = boxes[near, 2] - heading
        size = np.maximum(boxes[near, 4:6] / layout.m_per_px, _LEAST_PX)
        # Up in the picture is ahead, left is left: in the picture's axes (x right, y down) the direction is (-sin,
        # -cos).
        drawn = np.column_stack(
            (
                layout.columns / 2 - left[near],
                layout.rows_ahead - ahead[near],
                -np.sin(turned),
                -np.cos(turned),
                size,
            )
        )
        box, pixel = box_pixels(drawn, window)
        return near[box], pixel


def _velocity(speed_mps: FloatArray) -> NDArray[np.uint8]:
    # An absent actor (NaN) has no pixels, so the integers that its NaN becomes here are never used.
    finite = np.nan_to_num(speed_mps)
    value: NDArray[np.uint8] = np.clip(np.rint(finite * VELOCITY_PER_MPS) + VELOCITY_ZERO, 1, 255).astype(np.uint8)
    return value
