"""Where movements through a junction cross: intervals along both, and who goes first."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray

from foresee_dsl.compile.roads.polyline import Polyline, distinct
from foresee_dsl.compile.roads.route_line import approach
from foresee_dsl.compile.roads.topology import LaneKind, Movement, Topology

HALF_WIDTH_M = 1.0
"""Two movements conflict where bands of this half width around their centrelines overlap: a car's body, not its
lane."""
APPROACH_M = 60.0
"""How much of a foe's approach is given (the driver protocol): at 50 km/h a car comes from there in 4.3 s."""


@dataclass(frozen=True, eq=False)
class Conflict:
    """A stream that crosses or joins a movement.

    Attributes:
        path: [N, 2] m; of vehicles with their approach. entry_s: where on it they enter the junction.
        own: (first, last) m along the movement's own way through the junction. other: the same along `path`.
        yields: our movement must let it go first while both may go.
        tls, link: the signal that it obeys ("" and -1 for none).
    """

    path: NDArray[np.float64]
    entry_s: float
    own: tuple[float, float]
    other: tuple[float, float]
    yields: bool
    pedestrian: bool
    tls: str
    link: int


@lru_cache(maxsize=4096)
def conflicts_of(network: Topology, movement: Movement) -> tuple[Conflict, ...]:
    """Return everything that conflicts with a movement: from the right-of-way matrix and the shapes of the lanes."""
    junction = network.junctions[movement.junction]
    own = _way(network, movement)
    if own is None:
        return ()
    found: list[Conflict] = []
    for other in network.movements_at(junction.id):
        if not junction.conflicts(movement.index, other.index) or not other.kinds - {"pedestrian"}:
            continue
        way = _way(network, other)
        if way is None:
            continue
        kind: LaneKind = "car" if "car" in other.kinds else "bicycle"
        lane = network.lanes[other.from_lane]
        line = lane.line
        before = line.xy[bisect_left(line.marks, line.length_m - APPROACH_M) :]
        if line.length_m < APPROACH_M:
            before = (*approach(network, lane, APPROACH_M - line.length_m, kind), *before)
        entry = Polyline.of(before).length_m
        overlap = _overlap(own, way)
        if overlap is not None:
            path = np.array(distinct((*before, *way.xy)))
            mine, theirs = overlap
            found.append(
                Conflict(
                    path=path,
                    entry_s=entry,
                    own=mine,
                    other=(entry + theirs[0], entry + theirs[1]),
                    yields=junction.yields(movement.index, other.index),
                    pedestrian=False,
                    tls=other.tls or "",
                    link=other.link,
                )
            )
    return (*found, *_crossings(network, movement, own))


def _crossings(network: Topology, movement: Movement, own: Polyline) -> list[Conflict]:
    junction = network.junctions[movement.junction]
    found = []
    for crossing in network.crossings_at(junction.id):
        way = crossing.lane.line
        overlap = _overlap(own, way, crossing.lane.width_m / 2)
        if overlap is None:
            continue
        found.append(
            Conflict(
                path=way.points,
                entry_s=0.0,
                own=overlap[0],
                other=overlap[1],
                yields=junction.yields(movement.index, crossing.index),
                pedestrian=True,
                tls=crossing.tls or "",
                link=crossing.link,
            )
        )
    return found


def _way(network: Topology, movement: Movement) -> Polyline | None:
    """The way through the junction; None where the net has no lanes inside junctions."""
    if not movement.via:
        return None
    return Polyline.of([point for lane in movement.via for point in network.lanes[lane].shape])


def _overlap(
    own: Polyline, other: Polyline, other_half_width_m: float = HALF_WIDTH_M
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Intervals along both lines where their bands overlap, or None."""
    band = shapely.LineString(own.points).buffer(HALF_WIDTH_M, cap_style="flat")
    area = band.intersection(shapely.LineString(other.points).buffer(other_half_width_m, cap_style="flat"))
    if area.is_empty or area.area <= 0:
        return None
    corners = shapely.get_coordinates(area)
    return _interval(own, corners), _interval(other, corners)


def _interval(line: Polyline, corners: NDArray[np.float64]) -> tuple[float, float]:
    s, _ = line.project(corners[:, 0], corners[:, 1])
    return max(float(s.min()), 0.0), min(float(s.max()), line.length_m)
