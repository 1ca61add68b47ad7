"""A road map in the order of nuPlan's: lanes and lane connectors in roadblocks, each with a number as its id.

Nothing here needs nuplan-devkit; `map_api.py` gives these parts to planners.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from foresee_dsl.drivers.protocol import FloatArray
from foresee_dsl.drivers.road_map import MapLane, RoadMap

SAMPLE_M = 1.0
"""Largest distance between two points of a baseline path, m. Ours: as in nuPlan's maps, where lanes are straight."""
STOP_LINE_M = 0.5
"""Depth of a stop line's area, m. Ours: about as wide as such a line is painted."""
BEYOND_M = 100.0
"""Length by which the route goes on behind the mission's last lane, m. Ours: planners of nuPlan stop at the end of
their route, and the goal is to be driven past."""
_GAP_M = 0.05
"""Width of gaps between lanes that a roadblock's area covers, m. Ours: borders are rounded to centimetres."""


@dataclass(frozen=True)
class Roadblock:
    """The lanes of one direction of a road, or the parallel lanes of one movement through a junction.

    Attributes:
        lanes: names of its lanes, from left to right. junction: the junction of a connector; None: a roadblock.
    """

    id: str
    lanes: tuple[str, ...]
    junction: str | None


class Roads:
    """The car lanes of a road map, with nuPlan's ids."""

    def __init__(self, road_map: RoadMap) -> None:
        self.road_map = road_map
        self.lanes: dict[str, MapLane] = {
            name: lane for name, lane in sorted(road_map.lanes.items()) if "car" in lane.users
        }
        groups: dict[str, list[str]] = {}
        for name in self.lanes:
            groups.setdefault(name.rpartition("_")[0], []).append(name)
        self.lane_ids = {name: str(number) for number, name in enumerate(self.lanes, start=1)}
        self.roadblocks: dict[str, Roadblock] = {}
        for number, group in enumerate(groups.values(), start=len(self.lanes) + 1):
            ordered = tuple(sorted(group, key=_index, reverse=True))
            self.roadblocks[str(number)] = Roadblock(str(number), ordered, self.lanes[group[0]].junction)
        self.roadblock_of = {name: block.id for block in self.roadblocks.values() for name in block.lanes}

    @cached_property
    def route(self) -> tuple[str, ...]:
        """The ids of the roadblocks along the mission and for `BEYOND_M` behind its last lane."""
        names = [name for name in self.road_map.route if name in self.lanes]
        beyond_m = 0.0
        while names and beyond_m < BEYOND_M:
            following = [name for name in self.lanes[names[-1]].successors if name in self.lanes and name not in names]
            if not following:
                break
            names.append(min(following, key=lambda name: self.lanes[name].turn not in (None, "straight")))
            beyond_m += length_of(self.lanes[names[-1]].centre)
        return tuple(dict.fromkeys(self.roadblock_of[name] for name in names))

    def area(self, lanes: Iterable[str]) -> Polygon:
        """Return the area of adjacent lanes."""
        areas = [lane_area(self.lanes[name]) for name in lanes]
        if len(areas) == 1:
            return areas[0]
        return largest(shapely.union_all([area.buffer(_GAP_M) for area in areas]).buffer(-_GAP_M))

    def signals(self) -> Mapping[str, tuple[str, ...]]:
        """Return the ids of the lane connectors that each signal controls."""
        controlled: dict[str, list[str]] = {}
        for name, lane in self.lanes.items():
            if lane.signal is not None:
                controlled.setdefault(lane.signal, []).append(self.lane_ids[name])
        return {key: tuple(ids) for key, ids in controlled.items()}


def lane_area(lane: MapLane) -> Polygon:
    """Return the area between a lane's borders."""
    return largest(Polygon(np.concatenate((lane.left, lane.right[::-1]))).buffer(0))


def largest(shape: BaseGeometry) -> Polygon:
    """Return the largest part of an area, which may have several where borders cross in a tight turn."""
    if isinstance(shape, MultiPolygon):
        return max(shape.geoms, key=lambda part: part.area)
    return shape if isinstance(shape, Polygon) else Polygon()


def stop_line_area(points: FloatArray) -> Polygon:
    """Return the area of a stop line between two points, [2, 2]."""
    return largest(LineString(points).buffer(STOP_LINE_M / 2, cap_style="flat"))


def length_of(points: FloatArray) -> float:
    """Return the length of a line, m."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def sampled(points: FloatArray) -> FloatArray:
    """Return [N, 3] x, y and heading at most `SAMPLE_M` apart along a line, its own points included."""
    steps = np.diff(points, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    pieces = []
    for start, step, length in zip(points, steps, lengths, strict=False):
        count = max(1, int(np.ceil(length / SAMPLE_M)))
        pieces.append(start + np.arange(count)[:, None] / count * step)
    line = np.concatenate((*pieces, points[-1:]))
    ahead = np.diff(line, axis=0)
    heading = np.arctan2(ahead[:, 1], ahead[:, 0])
    return np.column_stack((line, np.append(heading, heading[-1])))


def _index(name: str) -> int:
    """Return the number of a lane on its road: 0 is the rightmost."""
    number = re.search(r"_(\d+)$", name)
    return int(number[1]) if number else 0
