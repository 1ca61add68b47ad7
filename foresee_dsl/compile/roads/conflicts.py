"""Finds the conflicts between movements through a junction: the intervals along both, and which movement yields."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray

from foresee_dsl.compile.roads.polyline import Points, Polyline, distinct
from foresee_dsl.compile.roads.route_line import approach
from foresee_dsl.compile.roads.topology import Crossing, LaneKind, Movement, Topology

HALF_WIDTH_M = 1.0
"""Half of the width of the bands around centrelines, m: two movements conflict where their bands overlap. The bands are
as wide as a car's body, not as its lane.
"""
APPROACH_M = 60.0
"""Length of a foe's approach in the data for drivers, m (ours: at 50 km/h a car covers it in 4.3 s)."""


@dataclass(frozen=True, eq=False)
class Conflict:
    """A conflicting movement or pedestrian crossing, whose area a movement crosses or joins.

    Attributes:
        path: way of the foe, [N, 2] m; for vehicles it begins with their approach.
        entry_s: position along `path` at which the junction begins, m.
        own: first and last position in the conflict area along the movement's own way through the junction, m.
        other: first and last position in the conflict area along `path`, m.
        yields: True if the movement must yield to the foe when both may go.
        tls, link: the signal of the foe ("" and -1 for none).
        of: the foe itself.
    """

    path: NDArray[np.float64]
    entry_s: float
    own: tuple[float, float]
    other: tuple[float, float]
    yields: bool
    pedestrian: bool
    tls: str
    link: int
    of: Movement | Crossing


@lru_cache(maxsize=4096)
def conflicts_of(network: Topology, movement: Movement) -> tuple[Conflict, ...]:
    """Return all conflicts of a movement, from the right-of-way matrix and the shapes of the lanes."""
    junction = network.junctions[movement.junction]
    own = _way(network, movement)
    if own is None:
        return ()
    conflicts: list[Conflict] = []
    others: tuple[Movement | Crossing, ...] = (*network.movements_at(junction.id), *network.crossings_at(junction.id))
    for other in others:
        way: Polyline | None = None
        if isinstance(other, Crossing):
            way, half_width_m = other.lane.line, other.lane.width_m / 2
        elif junction.conflicts(movement.index, other.index) and other.kinds - {"pedestrian"}:
            way, half_width_m = _way(network, other), HALF_WIDTH_M
        overlap = _overlap(own, way, half_width_m) if way is not None else None
        if way is None or overlap is None:
            continue
        mine, (first, last) = overlap
        before = _before(network, other) if isinstance(other, Movement) else ()
        entry = Polyline.of(before).length_m if before else 0.0
        conflicts.append(
            Conflict(
                path=np.array(distinct((*before, *way.xy))) if before else way.points,
                entry_s=entry,
                own=mine,
                other=(entry + first, entry + last),
                yields=junction.yields(movement.index, other.index),
                pedestrian=isinstance(other, Crossing),
                tls=other.tls or "",
                link=other.link,
                of=other,
            )
        )
    return tuple(conflicts)


def _before(network: Topology, movement: Movement) -> Points:
    """Return the last `APPROACH_M` of the way to a movement's junction."""
    kind: LaneKind = "car" if "car" in movement.kinds else "bicycle"
    lane = network.lanes[movement.from_lane]
    before = lane.line.xy[bisect_left(lane.line.marks, lane.line.length_m - APPROACH_M) :]
    if lane.line.length_m < APPROACH_M:
        before = (*approach(network, lane, APPROACH_M - lane.line.length_m, kind), *before)
    return before


def _way(network: Topology, movement: Movement) -> Polyline | None:
    """Return the way of a movement through its junction; None if the net has no internal lanes."""
    if not movement.via:
        return None
    return Polyline.of([point for lane in movement.via for point in network.lanes[lane].shape])


def _overlap(
    own: Polyline, other: Polyline, other_half_width_m: float
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Return the intervals along both lines in which their bands overlap, or None."""
    band = shapely.LineString(own.points).buffer(HALF_WIDTH_M, cap_style="flat")
    area = band.intersection(shapely.LineString(other.points).buffer(other_half_width_m, cap_style="flat"))
    if area.is_empty or area.area <= 0:
        return None
    corners = shapely.get_coordinates(area)
    return _interval(own, corners), _interval(other, corners)


def _interval(line: Polyline, corners: NDArray[np.float64]) -> tuple[float, float]:
    s = [line.project(x, y)[0] for x, y in corners.tolist()]
    return max(min(s), 0.0), min(max(s), line.length_m)
