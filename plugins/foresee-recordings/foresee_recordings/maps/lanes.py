"""A map of lanes with borders, as CommonRoad and lanelet2 describe roads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from foresee_recordings.recording import FloatArray

LaneType = Literal["road", "shoulder", "bus", "bicycle"]
"""`road`: for all vehicles; `shoulder`: part of the carriageway, closed to traffic."""
RightOfWay = Literal["", "priority", "yield", "stop"]
_REPEATED_M = 1e-3
"""Points nearer to each other than this are one point, m. Ours: netconvert writes millimetres."""


@dataclass(frozen=True, eq=False)
class Lane:
    """A lane between two borders, which both run in the driving direction.

    Attributes:
        id: its id in the map.
        left, right: [N, 2] and [M, 2] float64, points of the borders, m.
        predecessors, successors: ids of the lanes from which and to which traffic continues.
        left_neighbour, right_neighbour: id of the adjacent lane in the same direction, or "".
        speed_mps: speed limit, m/s; None if the map has none.
        type: who may use it.
        way: its right of way at its end: `yield` or `stop` in front of a sign, `priority` if others must yield.
        signal: id of the traffic light that controls its end, or "".
    """

    id: str
    left: FloatArray
    right: FloatArray
    predecessors: tuple[str, ...] = ()
    successors: tuple[str, ...] = ()
    left_neighbour: str = ""
    right_neighbour: str = ""
    speed_mps: float | None = None
    type: LaneType = "road"
    way: RightOfWay = ""
    signal: str = ""

    @cached_property
    def _borders(self) -> tuple[FloatArray, FloatArray]:
        """The borders with equally many points, at equal shares of their lengths."""
        if len(self.left) == len(self.right):
            return self.left, self.right
        shares = np.union1d(_shares(self.left), _shares(self.right))
        return at_shares(self.left, shares), at_shares(self.right, shares)

    @cached_property
    def centre(self) -> FloatArray:
        """The centre line, [N, 2] m: halfway between the borders, without repeated points."""
        left, right = self._borders
        return without_repeats((left + right) / 2)

    @cached_property
    def width_m(self) -> float:
        """The median distance of the borders, m."""
        left, right = self._borders
        return float(np.median(np.hypot(*(left - right).T)))

    @cached_property
    def length_m(self) -> float:
        """The length of the centre line, m."""
        return float(np.hypot(*np.diff(self.centre, axis=0).T).sum())

    def part(self, first: float, last: float) -> tuple[FloatArray, FloatArray]:
        """Return the borders, left and right, between two shares (0 to 1) of the centre line's length."""
        left, right = self._borders
        own = _shares((left + right) / 2)
        shares = np.concatenate(([first], own[(own > first) & (own < last)], [last]))
        cut = [np.column_stack([np.interp(shares, own, column) for column in line.T]) for line in (left, right)]
        return cut[0], cut[1]


@dataclass(frozen=True)
class LaneMap:
    """All lanes of a map, by id, in the map's order, and what of the map is left out, by description.

    `in_utm` is True if the coordinates are eastings and northings of UTM, False if they are local.
    """

    lanes: Mapping[str, Lane]
    left_out: Mapping[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    in_utm: bool = False


def without_repeats(points: FloatArray) -> FloatArray:
    """Return a line's points without those that repeat the previous point."""
    keep = np.concatenate(([True], np.hypot(*np.diff(points, axis=0).T) > _REPEATED_M))
    return points[keep]


def at_shares(line: FloatArray, shares: FloatArray) -> FloatArray:
    """Return the points of a line at shares (0 to 1) of its length."""
    own = _shares(line)
    return np.column_stack([np.interp(shares, own, column) for column in line.T])


def _shares(line: FloatArray) -> FloatArray:
    """Return the share of a line's length at each of its points."""
    marks = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))))
    shares: FloatArray = marks / marks[-1] if marks[-1] > 0.0 else np.linspace(0.0, 1.0, len(line))
    return shares
