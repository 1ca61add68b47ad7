"""Who is in sight from the ego: near enough, in the field of view, and not hidden by others or buildings."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.polyline import Points
from foresee_dsl.simulate.sensing.occlusion import Walls, cut_by_boxes, marks
from foresee_dsl.simulate.sensing.settings import STANDARD, SensorSettings
from foresee_dsl.simulate.sensing.weather import CLEAR, Air

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]


@dataclass(frozen=True)
class Bodies:
    """What there is to see: of N objects the classes, [N, 2] lengths and widths, and [N] heights, m."""

    kinds: tuple[str, ...]
    sizes_m: FloatArray
    heights_m: FloatArray

    @classmethod
    def of(cls, models: Sequence[ModelSpec]) -> Bodies:
        """Those of catalogue entries."""
        rows = [(model.length_m, model.width_m, model.height_m) for model in models]
        numbers = np.array(rows, dtype=np.float64).reshape(-1, 3)
        return cls(tuple(model.kind for model in models), numbers[:, :2], numbers[:, 2])


class Sight:
    """Lines of sight in a scene.

    Attributes:
        range_m: [N] how far each object is seen in this weather.
    """

    def __init__(
        self, bodies: Bodies, buildings: Iterable[Points], settings: SensorSettings = STANDARD, air: Air = CLEAR
    ) -> None:
        """Know what there is to see.

        Args:
            bodies: the N objects. buildings: outlines, m. settings: of the sensors. air: the weather.
        """
        self._settings = settings
        clear = asdict(settings.ranges)
        reach = {kind: air.object_range_m(far) if settings.weather else far for kind, far in clear.items()}
        self.range_m = np.array([reach[kind] for kind in bodies.kinds], dtype=np.float64)
        self.signal_range_m = (
            air.signal_range_m(settings.signal_range_m) if settings.weather else settings.signal_range_m
        )
        self._sizes = bodies.sizes_m
        self._ahead_share = math.cos(min(settings.field_of_view_rad / 2, math.pi))
        self._tops = bodies.heights_m - settings.eye_m
        shares = np.array((settings.high_share, settings.low_share))
        self._rises = bodies.heights_m[:, None] * shares - settings.eye_m
        # Whoever is farther than all that can be seen hides nothing of it.
        self._reach_m = max(float(self.range_m.max(initial=0.0)), self.signal_range_m)
        self._walls = Walls(buildings, self._reach_m)

    def seen(self, x: float, y: float, heading: float, poses: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return who is in sight.

        Args:
            x, y, heading: of the ego. poses: [N, >=3] x, y, heading of the objects; NaN where there is none.

        Returns:
            [S] which objects; [S, 2] their centres relative to the ego (not turned), m; [S] their distances, m.
        """
        offsets = poses[:, :2] - (x, y)
        gaps = np.sqrt((offsets * offsets).sum(axis=1))
        near = np.flatnonzero(gaps <= self._reach_m)  # NaN is not
        offsets, gaps = offsets[near], gaps[near]
        shown = gaps <= self.range_m[near]
        if self._settings.field_of_view_rad < math.tau:
            ahead = offsets @ (math.cos(heading), math.sin(heading))
            shown &= ahead >= gaps * self._ahead_share
        if self._settings.seen_share > 0.0 and shown.any():
            self._hide(x, y, self._boxes(offsets, poses, near), near, shown)
        return near[shown], offsets[shown], gaps[shown]

    def _hide(self, x: float, y: float, boxes: FloatArray, near: IntArray, shown: BoolArray) -> None:
        """Take from `shown` those of whom too little is in line of sight; `near` says who has which box."""
        own = np.flatnonzero(shown)
        points = marks(boxes[own])
        least = self._settings.seen_share * points.shape[1]
        walled = self._walls.cut(x, y, points.reshape(-1, 2))
        behind = np.zeros(points.shape[:2], dtype=np.bool_) if walled is None else walled.reshape(points.shape[:2])
        left = points.shape[1] - np.count_nonzero(behind, axis=1) >= least
        shown[own] = left  # whom walls hide needs no look at the others
        own, behind = own[left], behind[left]
        hidden = cut_by_boxes(points[left], self._rises[near[own]], own, boxes, self._tops[near]) | behind[..., None]
        hidden_points = np.count_nonzero(hidden, axis=(1, 2))
        shown[own] = hidden.shape[1] - hidden_points / hidden.shape[2] >= least

    def clear(self, x: float, y: float, poses: FloatArray, points: FloatArray, heights: FloatArray) -> BoolArray:
        """Say which points nothing hides.

        Args:
            x, y: of the ego. poses: as in `seen`. points: [M, 2] m. heights: [M] over the ground, m.

        Returns:
            [M].
        """
        if self._settings.seen_share <= 0.0:
            return np.ones(len(points), dtype=np.bool_)
        offsets = poses[:, :2] - (x, y)
        near = np.flatnonzero((offsets * offsets).sum(axis=1) <= self._reach_m**2)
        boxes = self._boxes(offsets[near], poses, near)
        lines = points - (x, y)
        rises = (heights - self._settings.eye_m)[:, None]
        nobody = np.full(len(points), -1)
        hidden = cut_by_boxes(lines[:, None], rises, nobody, boxes, self._tops[near])[:, 0, 0]
        walled = self._walls.cut(x, y, lines)
        free: BoolArray = ~(hidden if walled is None else hidden | walled)
        return free

    def _boxes(self, offsets: FloatArray, poses: FloatArray, who: IntArray) -> FloatArray:
        """The footprints of some, relative to the ego: x, y, heading, length, width."""
        boxes = np.empty((len(who), 5))
        boxes[:, :2], boxes[:, 2], boxes[:, 3:] = offsets, poses[who, 2], self._sizes[who]
        return boxes
