"""The lane ahead of a place on an OpenDRIVE map, along the lanes' links, as a player follows it."""

from __future__ import annotations

import math
from collections.abc import Iterator

from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.errors import CompileError
from foresee_dsl.exchange.outcome import SourceError
from foresee_exchange.openscenario.reading.roads import RoadPlace, Roads, linked_lane

_STEP_M = 1.0
"""Sampling distance of lanes, m (ours: within 0.02 m of a bend of 10 m radius)."""
_MOST_ROADS = 1000


def lane_ahead(roads: Roads, place: RoadPlace, length_m: float, *, onward: bool) -> list[Pose]:
    """Return the poses of a lane from a place on, at the place's lateral offset, straight on at junctions.

    `onward`: in the road's direction, whatever the direction of traffic; otherwise against it.
    """
    poses: list[Pose] = []
    road, lane, begin, offset = place.road, place.lane, place.s, place.offset
    try:
        for _ in range(_MOST_ROADS):
            for s, there in _along(roads, road, lane, begin, onward=onward):
                pose, lane = roads.on_lane(road, there, s, offset), there
                poses.append(pose if onward else Pose(pose.x, pose.y, pose.heading_rad + math.pi))
                if len(poses) * _STEP_M > length_m:
                    return poses
            step = roads.lane_behind(road, lane, onward=onward) if lane else None
            if step is None:
                break
            offset = -offset if step[2] != onward else offset
            road, lane, onward = step
            begin = 0.0 if onward else roads.length(road)
    except (CompileError, SourceError):
        pass  # the lane ends, or the map is incomplete
    return poses


def _along(roads: Roads, road: str, lane: int, begin: float, *, onward: bool) -> Iterator[tuple[float, int]]:
    """Yield lengths along a road in a direction, each with the lane there, which begins as `lane`."""
    sections = roads.lane_sections(road)
    for k, (first, last, section) in enumerate(sections if onward else reversed(sections)):
        begun = begin < last if onward else begin > first
        if not begun and k < len(sections) - 1:
            continue
        low, high = (max(first, begin), last) if onward else (min(last, begin), first)
        steps = max(math.floor(abs(high - low) / _STEP_M), 0)
        for step in range(steps + 1):
            yield low + step * _STEP_M * (1 if onward else -1), lane
        if k < len(sections) - 1:
            lane = linked_lane(section, lane, onward=onward)
            if not lane:
                return
