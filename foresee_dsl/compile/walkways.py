"""Where people walk: sidewalks, corners and crossings as a graph, and random walks on it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.polyline import FloatArray, distinct, lengths, whole_millimetres
from foresee_dsl.compile.roads import Crossing

if TYPE_CHECKING:
    import networkx as nx

    from foresee_dsl.compile.geometry import RoadNetwork

ON_CROSSING_M = 0.05
"""A path whose points are so near to a crossing's centreline was laid along it (clips round to 1 mm, nets to 1 cm)."""

_End = tuple[str, int]
"""The beginning (0) or end (1) of a footway's centreline; a walking area is (id, -1)."""


class CrossingPart(NamedTuple):
    """A stretch of a path that runs over a crossing (m along the path), and the signal that it obeys ("" and -1 for
    none)."""

    enter_s: float
    exit_s: float
    tls: str
    link: int


@dataclass(frozen=True, eq=False)
class Walk:
    """A pedestrian's path, [N, 2] m, and its crossings in order."""

    points: FloatArray
    crossings: tuple[CrossingPart, ...]

    @property
    def stops(self) -> tuple[tuple[float, float, str, int], ...]:
        """The crossings with a signal: (enters m, leaves m, tls, link)."""
        return tuple((c.enter_s, c.exit_s, c.tls, c.link) for c in self.crossings if c.tls)


@dataclass(frozen=True, eq=False)
class Walkways:
    """The footways of a network.

    Attributes:
        shapes: the centreline of each sidewalk and crossing by lane id. crossings: the crossings among them.
        graph: nodes are ends of footways and walking areas; edges with the attribute `way` are footways, the others
            join what touches.
    """

    shapes: dict[str, FloatArray]
    crossings: dict[str, Crossing]
    graph: nx.Graph[_End]

    @property
    def sidewalks(self) -> tuple[str, ...]:
        """Lanes that are no crossings, in the net's order."""
        return tuple(way for way in self.shapes if way not in self.crossings)

    def walk(self, from_xy: tuple[float, float], length_m: float, rng: np.random.Generator) -> Walk | None:
        """Walk at random from the sidewalk nearest to a point, over crossings too, turning round only at dead ends.

        Args:
            from_xy: m.
            length_m: how far, at least.
            rng: draws the first direction and each way onward.

        Returns:
            The walk; None where the network has no sidewalk.
        """
        best = self._nearest(from_xy)
        if best is None:
            return None
        way, start = best
        forward = bool(rng.integers(2))
        points = [start, *_rest(self.shapes[way], start, forward)]
        end: _End = (way, 1 if forward else 0)
        walked = float(lengths(np.array(points))[-1])
        while walked < length_m:
            choices = self._onward(end) or [end]
            begin = choices[int(rng.integers(len(choices)))]
            way, at = begin
            shape = self.shapes[way] if at == 0 else self.shapes[way][::-1]
            points += list(shape)
            end = (way, 1 - at)
            walked = float(lengths(np.array(points))[-1])
        path = distinct(whole_millimetres(np.array(points)))
        return Walk(path, self.crossings_on(path))

    def crossings_on(self, path: FloatArray) -> tuple[CrossingPart, ...]:
        """Return the stretches of a path that run along the centreline of a crossing."""
        s = lengths(path)
        begin, step, owner = self._crossing_segments
        near = np.asarray(_away(path, begin, step) <= ON_CROSSING_M)
        found: list[CrossingPart] = []
        for n, crossing in enumerate(self.crossings.values()):
            on = np.asarray(near[:, owner == n].any(axis=1))
            first = len(found)
            for k in np.flatnonzero(on[:-1] & on[1:]):
                if len(found) > first and found[-1].exit_s == float(s[k]):
                    found[-1] = found[-1]._replace(exit_s=float(s[k + 1]))
                else:
                    found.append(CrossingPart(float(s[k]), float(s[k + 1]), crossing.tls or "", crossing.link))
        return tuple(sorted(found))

    @cached_property
    def _crossing_segments(self) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
        """Beginning and extent of each segment of each crossing's centreline, and whose it is."""
        shapes = [self.shapes[way] for way in self.crossings]
        if not shapes:
            return np.empty((0, 2)), np.empty((0, 2)), np.empty(0, dtype=np.int64)
        begin = np.concatenate([shape[:-1] for shape in shapes])
        step = np.concatenate([np.diff(shape, axis=0) for shape in shapes])
        return begin, step, np.repeat(np.arange(len(shapes)), [len(shape) - 1 for shape in shapes])

    def _nearest(self, xy: tuple[float, float]) -> tuple[str, FloatArray] | None:
        best: tuple[float, str, FloatArray] | None = None
        for way in self.sidewalks:
            foot = _foot(np.array(xy, dtype=np.float64), self.shapes[way])
            distance = float(np.hypot(foot[0] - xy[0], foot[1] - xy[1]))
            if best is None or distance < best[0]:
                best = distance, way, foot
        return (best[1], best[2]) if best is not None else None

    def _onward(self, end: _End) -> list[_End]:
        """Return the ends of other footways that are joined to an end, directly or across a walking area."""
        found: list[_End] = []
        for node in self.graph.adj[end]:
            if node[0] == end[0] and node[1] >= 0:
                continue
            if node[1] >= 0:
                found.append(node)
            else:
                found += [other for other in self.graph.adj[node] if other != end and other[1] >= 0]
        return found


@lru_cache(maxsize=32)
def walkways(network: RoadNetwork) -> Walkways:
    """Return the footways of a network."""
    import networkx as nx  # here: it takes long to import, and few need it

    shapes: dict[str, FloatArray] = {}
    for lane in network.lanes.values():
        if lane.kinds == {"pedestrian"} and lane.edge not in network.walking_areas:
            shapes[lane.id] = distinct(lane.shape)
    graph: nx.Graph[_End] = nx.Graph()
    for way in shapes:
        graph.add_edge((way, 0), (way, 1), way=way)
    for first, second in network.footways:
        graph.add_edge(
            (first, -1) if first in network.walking_areas else (first, 1),
            (second, -1) if second in network.walking_areas else (second, 0),
        )
    return Walkways(shapes, {c.lane.id: c for c in network.crossings.values()}, graph)


def _rest(shape: FloatArray, start: FloatArray, forward: bool) -> list[FloatArray]:
    """The corners of a polyline after a point on it."""
    s = lengths(shape)
    here = _along(start, shape)
    return list(shape[s > here]) if forward else list(shape[s < here][::-1])


def _segments(point: FloatArray, shape: FloatArray) -> tuple[FloatArray, FloatArray]:
    """For each segment the share where a point's foot is, and the foot."""
    begin, step = shape[:-1], np.diff(shape, axis=0)
    share = np.clip(((point - begin) * step).sum(axis=1) / (step * step).sum(axis=1), 0.0, 1.0)
    return share, begin + share[:, None] * step


def _foot(point: FloatArray, shape: FloatArray) -> FloatArray:
    _, feet = _segments(point, shape)
    return np.asarray(feet[int(np.hypot(*(feet - point).T).argmin())])


def _along(point: FloatArray, shape: FloatArray) -> float:
    share, feet = _segments(point, shape)
    k = int(np.hypot(*(feet - point).T).argmin())
    s = lengths(shape)
    return float(s[k] + share[k] * (s[k + 1] - s[k]))


def _away(points: FloatArray, begin: FloatArray, step: FloatArray) -> FloatArray:
    """[K, S] m from [K, 2] points to segments."""
    relative = points[:, None] - begin
    share = (relative * step).sum(axis=2) / (step * step).sum(axis=1)
    away = relative - np.clip(share, 0.0, 1.0)[..., None] * step
    return np.asarray(np.hypot(away[..., 0], away[..., 1]))
