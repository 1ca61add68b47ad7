"""The lines of roads and of the ways between them, which join without kinks.

Lanelets may join at an angle: their centre lines run halfway between borders, which begin and end at oblique lines.
Vehicles do not turn on the spot, and the core closes connections with such kinks. So a line with a kink at a joint is
smoothed, over the last metres of the road before it and the first metres of the road behind it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from foresee_recordings.maps.junctions import LaneLink, Layout
from foresee_recordings.maps.lanes import without_repeats
from foresee_recordings.recording import FloatArray

_TRIM_M = 0.1
"""Length by which a lane's ends are shortened, m. Ours: the lane between two lanes that touch then has a direction."""
_REACH_M, _SHARE = 3.0, 0.4
"""Length of a road before and behind a kink that is smoothed with it, m, and its largest share of the road (ours)."""
_KINK_RAD, _WITHIN_M = np.radians(45), 2.0
"""A turn by more than this within this length is a kink. Ours: the core closes connections that turn by 60 degrees
within 2 m; a turn with a radius of 3 m has 38 degrees."""
_STEP_M, _SIGMA_M = 0.25, 1.2
"""Spacing of the points of a smoothed line, and standard deviation of the smoothing, m. Ours: a line on a circle of 5 m
moves inwards by 0.15 m, a kink of 90 degrees spreads over 3 m."""

Move = Callable[[FloatArray], FloatArray]
"""Moves points of the map to the network."""
LaneKey = tuple[str, int]
"""Id of an edge, and index of a lane."""


@dataclass(frozen=True)
class Lines:
    """The lines of the lanes of roads, and of the ways between them, [N, 2] m each."""

    lanes: Mapping[LaneKey, FloatArray]
    ways: tuple[tuple[LaneLink, FloatArray], ...]


def lines_of(layout: Layout, move: Move) -> Lines:
    """Return the lines of a layout in the network."""
    centres = {(road.id, k): move(lane.centre) for road in layout.roads for k, lane in enumerate(road.lanes)}
    trims: dict[tuple[LaneKey, str], float] = {}
    kinked: set[int] = set()
    for number, way in enumerate(layout.ways):
        if _has_kink(_joined(way, centres, _reach(centres[way.start]), _reach(centres[way.end]), move)):
            kinked.add(number)
            trims[way.start, "end"] = _reach(centres[way.start])
            trims[way.end, "start"] = _reach(centres[way.end])

    def trim_m(key: LaneKey, end: str) -> float:
        return trims.get((key, end), min(_TRIM_M, length_of(centres[key]) / 4))

    lanes = {key: _part(line, trim_m(key, "start"), trim_m(key, "end")) for key, line in centres.items()}
    ways = []
    for number, way in enumerate(layout.ways):
        line = _joined(way, centres, trim_m(way.start, "end"), trim_m(way.end, "start"), move)
        ways.append((way, _smooth(line) if number in kinked else line))
    return Lines(lanes, tuple(ways))


def length_of(line: FloatArray) -> float:
    """Return the length of a line, m."""
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def _reach(line: FloatArray) -> float:
    return min(_REACH_M, _SHARE * length_of(line))


def _joined(
    way: LaneLink, centres: Mapping[LaneKey, FloatArray], before_m: float, behind_m: float, move: Move
) -> FloatArray:
    """Return the line of a way with the last metres of the lane before it and the first metres of that behind it."""
    before, behind = centres[way.start], centres[way.end]
    between = [] if way.shape is None else [move(way.shape)]
    tail = _part(before, length_of(before) - before_m, 0.0)
    head = _part(behind, 0.0, length_of(behind) - behind_m)
    return without_repeats(np.concatenate([tail, *between, head]))


def _part(line: FloatArray, begin_m: float, end_m: float) -> FloatArray:
    """Return a line without its first and its last metres."""
    marks = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))))
    begin, end = begin_m, marks[-1] - end_m
    wanted = np.concatenate(([begin], marks[(marks > begin) & (marks < end)], [end]))
    return np.column_stack([np.interp(wanted, marks, column) for column in line.T])


def _has_kink(line: FloatArray) -> bool:
    points = _spaced(line)
    if len(points) < 3:
        return False
    headings = np.unwrap(np.arctan2(*np.diff(points, axis=0).T[::-1]))
    count = min(round(_WITHIN_M / _STEP_M), len(headings) - 1)
    windows = np.lib.stride_tricks.sliding_window_view(headings, count + 1)
    return bool((windows.max(axis=1) - windows.min(axis=1)).max() > _KINK_RAD)


def _smooth(line: FloatArray) -> FloatArray:
    """Return a line after a Gaussian smoothing that keeps its ends and their directions."""
    points = _spaced(line)
    count = min(round(3 * _SIGMA_M / _STEP_M), len(points) - 1)
    if count < 1:
        return line
    kernel = np.exp(-0.5 * (np.arange(-count, count + 1) * _STEP_M / _SIGMA_M) ** 2)
    # reflected at the ends, so that the ends stay
    padded = np.concatenate((2 * points[0] - points[count:0:-1], points, 2 * points[-1] - points[-2 : -count - 2 : -1]))
    smooth = [np.convolve(column, kernel / kernel.sum(), mode="valid") for column in padded.T]
    return np.column_stack(smooth)


def _spaced(line: FloatArray) -> FloatArray:
    """Return points on a line at equal distances of about `_STEP_M`, with its ends."""
    marks = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))))
    wanted = np.linspace(0.0, marks[-1], max(round(marks[-1] / _STEP_M), 1) + 1)
    return np.column_stack([np.interp(wanted, marks, column) for column in line.T])
