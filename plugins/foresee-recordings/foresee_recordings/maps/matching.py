"""Matches recorded tracks to the lanes of a network: which edges a vehicle drives along.

The most likely sequence of lanes is searched (Newson and Krumm, "Hidden Markov map matching through noise and
sparseness", 2009): each sample costs its distance and its turn from a lane, each step a change of lanes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
import shapely

from foresee_dsl.compile.roads.network import SAME_DIRECTION_RAD, RoadNetwork
from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.compile.roads.routing import RouteError, shortest_route
from foresee_dsl.compile.roads.topology import Lane, LaneKind
from foresee_recordings.recording import FloatArray, Track

_SPACING_M = 3.0
"""Distance between the samples that are matched, m. Ours: shorter than any lane that a vehicle may pass unnoticed."""
_REACH_M = 4.0
"""Farthest distance of a sample from the centre line of its lane, m. Ours: a lane's width."""
_TURN_M = 2.0
"""Cost of 1 rad of turn, in metres of distance. Ours: where lanes overlap, 30 degrees count like 1 m."""
_CHANGE_COST = 1.0
"""Cost of a change to another lane of the same edge (ours: as 1 m of distance at one sample)."""
_DETOUR, _DETOUR_M = 1.5, 20.0
"""Longest way between two edges of a track, as a multiple of their distance, and added to it, m. Ours: a quarter of a
circle is 1.1 times as long as its chord, half of one 1.6 times; a detour around a roundabout is longer."""
_HOPS = 6
"""Largest number of lanes between two samples. Ours: where lanes touch, the lanes inside the junction are centimetres
long, and two junctions may lie side by side."""
_KINDS: dict[str, LaneKind] = {"bicycle": "bicycle", "pedestrian": "pedestrian", "bus": "bus"}


@dataclass(frozen=True)
class _Lanes:
    """The lanes of a network for one kind, with an index of their lines and the lanes that follow each."""

    lanes: tuple[Lane, ...]
    tree: shapely.STRtree
    number: dict[str, int]
    onward: tuple[tuple[int, ...], ...]
    beside: tuple[tuple[int, ...], ...]

    def reach(self, start: int) -> dict[int, float]:
        """Return the lanes that can be reached between two samples, with the cost of lane changes."""
        costs = {start: 0.0}
        border = [start]
        for _ in range(_HOPS):
            further = []
            for at in border:
                steps = [(other, 0.0) for other in self.onward[at]] + [(o, _CHANGE_COST) for o in self.beside[at]]
                for other, cost in steps:
                    if costs[at] + cost < costs.get(other, math.inf):
                        costs[other] = costs[at] + cost
                        further.append(other)
            border = further
        return costs


def route_of(track: Track, roads: RoadNetwork, offset: tuple[float, float] = (0.0, 0.0)) -> tuple[str, ...]:
    """Return the edges that a recorded vehicle drives along, in order; empty if it is never on a lane.

    Consecutive edges are connected, and no edge comes twice. If the vehicle leaves the network in between, the edges
    between are those of the shortest way; if that is none or a detour, only the longest part is returned. If the track
    begins or ends inside a junction, the edge before or after the junction is included.

    Args:
        offset: `RecordedMap.offset`: x and y from the recording's coordinates to the network's, m.
    """
    kind = _KINDS.get(track.kind, "car")
    lanes = _lanes_of(roads, kind)
    places = lane_places(track, roads, offset)
    runs = [
        _edges(roads, [lanes.lanes[k] for k in run], first=run is places[0], last=run is places[-1]) for run in places
    ]
    return _joined(roads, runs, kind)


def lane_places(track: Track, roads: RoadNetwork, offset: tuple[float, float] = (0.0, 0.0)) -> list[list[int]]:
    """Return the numbers of the lanes that a track uses in order, in runs without an interruption."""
    lanes = _lanes_of(roads, _KINDS.get(track.kind, "car"))
    runs: list[list[int]] = []
    costs: dict[int, float] = {}
    back: list[dict[int, int | None]] = []
    for x, y, heading in _spaced(track, offset):
        near = _candidates(lanes, x, y, heading)
        if not near:
            continue
        steps: dict[int, tuple[float, int]] = {}
        for previous, cost in costs.items():
            for other, more in lanes.reach(previous).items():
                if other in near and cost + more < steps.get(other, (math.inf, 0))[0]:
                    steps[other] = cost + more, previous
        if steps:
            back.append({other: previous for other, (_, previous) in steps.items()})
            costs = {other: cost + near[other] for other, (cost, _) in steps.items()}
        else:
            if costs:
                runs.append(_path(costs, back))
            back, costs = [dict.fromkeys(near)], dict(near)
    if costs:
        runs.append(_path(costs, back))
    return [_through(lanes, run) for run in runs]


def _spaced(track: Track, offset: tuple[float, float]) -> FloatArray:
    """Return x, y and heading of a track's samples at distances of about `_SPACING_M`, [K, 3]."""
    states = track.states[:, :3] + np.array([*offset, 0.0])
    marks = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(states[:, :2], axis=0).T))))
    wanted = np.arange(0.0, marks[-1] + _SPACING_M, _SPACING_M)
    rows = np.unique(np.minimum(np.searchsorted(marks, wanted), len(marks) - 1))
    spaced: FloatArray = states[rows]
    return spaced


def _candidates(lanes: _Lanes, x: float, y: float, heading: float) -> dict[int, float]:
    """Return the lanes on which a vehicle may be, with the costs of distance and turn."""
    costs = {}
    for number in lanes.tree.query(shapely.Point(x, y), predicate="dwithin", distance=_REACH_M):
        line = lanes.lanes[number].line
        s, _ = line.project(x, y)
        at_x, at_y, angle = line.at(min(max(s, 0.0), line.length_m))
        turn = abs(wrap(angle - heading))
        if turn <= SAME_DIRECTION_RAD:
            costs[int(number)] = math.hypot(x - at_x, y - at_y) + _TURN_M * turn
    return costs


def _path(costs: dict[int, float], back: list[dict[int, int | None]]) -> list[int]:
    """Return the cheapest sequence of lanes, without repetitions."""
    at: int | None = min(costs, key=lambda number: (costs[number], number))
    path: list[int] = []
    for previous in reversed(back):
        if at is None:
            break
        if not path or path[-1] != at:
            path.append(at)
        at = previous[at]
    return path[::-1]


def _through(lanes: _Lanes, run: list[int]) -> list[int]:
    """Return a run with the short lanes that lie between those of neighbouring samples."""
    full = run[:1]
    for before, after in pairwise(run):
        full += _between(lanes, before, after)
    return full


def _between(lanes: _Lanes, before: int, after: int) -> list[int]:
    """Return the lanes from one to another, without the first, with the fewest lane changes."""
    paths: dict[int, tuple[float, list[int]]] = {before: (0.0, [])}
    border = [before]
    for _ in range(_HOPS):
        further = []
        for at in border:
            cost, path = paths[at]
            steps = [(other, 0.0) for other in lanes.onward[at]] + [(o, _CHANGE_COST) for o in lanes.beside[at]]
            for other, more in steps:
                if other not in paths or cost + more < paths[other][0]:
                    paths[other] = cost + more, [*path, other]
                    further.append(other)
        border = further
    return paths.get(after, (0.0, [after]))[1]


def _edges(roads: RoadNetwork, run: Sequence[Lane], *, first: bool, last: bool) -> list[str]:
    """Return the edges of connected lanes.

    Of the first run, an edge before the junction in which it begins is included; of the last one, an edge behind that
    in which it ends.
    """
    edges = [lane.edge for lane in run if not lane.internal]
    into = roads.movements_through(run[0].id) if first and run[0].internal else ()
    out = roads.movements_through(run[-1].id) if last and run[-1].internal else ()
    before = [m.from_edge for m in into if not edges or m.to_edge == edges[0]]
    edges = before[:1] + edges
    return edges + [m.to_edge for m in out if edges and m.from_edge == edges[-1]][:1]


def _joined(roads: RoadNetwork, runs: list[list[str]], kind: LaneKind) -> tuple[str, ...]:
    """Return runs of edges joined by the shortest ways; without a way, the longest of the joined parts."""
    parts: list[list[str]] = []
    for edge in (edge for run in runs for edge in run):
        if parts and edge == parts[-1][-1]:
            continue
        between = _between_edges(roads, parts[-1][-1], edge, kind) if parts else None
        if between is None or not set(parts[-1]).isdisjoint((*between, edge)):
            parts.append([edge])  # an edge that a route uses twice would not mean a single place
        else:
            parts[-1] += [*between, edge]
    lengths = [sum(roads.edges[edge].lanes[0].line.length_m for edge in part) for part in parts]
    return tuple(parts[lengths.index(max(lengths))]) if parts else ()


def _between_edges(roads: RoadNetwork, before: str, after: str, kind: LaneKind) -> tuple[str, ...] | None:
    """Return the edges between two edges of a track; None if the way between them is a detour, or there is none."""
    if any(m.to_edge == after for m in roads.movements_from(before, kind)):
        return ()
    try:
        between = shortest_route(roads, before, after, kind)[1:-1]
    except RouteError:
        return None
    gap_m = math.dist(roads.edges[before].lanes[0].shape[-1], roads.edges[after].lanes[0].shape[0])
    length_m = sum(roads.edges[edge].lanes[0].line.length_m for edge in between)
    return between if length_m <= _DETOUR * gap_m + _DETOUR_M else None


@lru_cache(maxsize=8)
def _lanes_of(roads: RoadNetwork, kind: LaneKind) -> _Lanes:
    """Return the lanes of a network that are open to a kind."""
    own = tuple(lane for lane in roads.lanes.values() if kind in lane.kinds and lane.edge not in roads.walking_areas)
    number = {lane.id: k for k, lane in enumerate(own)}
    onward: list[dict[int, None]] = [{} for _ in own]
    for movement in roads.movements:
        chain = (movement.from_lane, *movement.via, movement.to_lane)
        for before, after in pairwise(chain):
            if before in number and after in number:
                onward[number[before]][number[after]] = None
    beside = tuple(
        tuple(number[other.id] for other in _same_edge(roads, lane) if other.id in number and other is not lane)
        for lane in own
    )
    tree = shapely.STRtree([lane.centreline for lane in own])
    return _Lanes(own, tree, number, tuple(tuple(others) for others in onward), beside)


def _same_edge(roads: RoadNetwork, lane: Lane) -> Sequence[Lane]:
    return () if lane.internal else roads.edges[lane.edge].lanes
