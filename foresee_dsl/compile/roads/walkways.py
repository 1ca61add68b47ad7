"""Makes the graph of sidewalks, walking areas and crossings, and draws random walks of pedestrians on it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

from foresee_dsl.compile.roads.polyline import (
    XY,
    Points,
    Polyline,
    distance,
    distance_to,
    distinct,
    lengths,
    whole_millimetres,
)
from foresee_dsl.compile.roads.topology import Crossing, Topology

if TYPE_CHECKING:
    import numpy as np

ON_CROSSING_M = 0.05
"""Largest distance of a path's point from the centreline of the crossing that it is on, m (clips round to 1 mm, nets to
1 cm)."""

_End = tuple[str, int]
"""The begin (0) or end (1) of a footway's centreline; a walking area is (id, -1)."""


Stop = tuple[float, float, str, int]
"""A crossing with a signal on a path: begin and end along the path, m; tls; link."""


@dataclass(frozen=True, eq=False)
class Walkways:
    """The footways of a network.

    Attributes:
        shapes: centreline of each sidewalk and crossing by lane id. crossings: the crossings among them.
        joints: pairs of ends of footways, or of an end and a walking area, that touch.
    """

    shapes: dict[str, Points]
    crossings: dict[str, Crossing]
    joints: tuple[tuple[_End, _End], ...]
    _stops: dict[Points, tuple[Stop, ...]] = field(default_factory=dict, init=False)

    @cached_property
    def neighbours(self) -> dict[_End, dict[_End, None]]:
        """The nodes beside each node, in the net's order: nodes are ends of footways and walking areas, and those of a
        footway, or that touch, are beside each other.

        Plain dictionaries, because the import of networkx takes longer than the walks.
        """
        nodes: dict[_End, dict[_End, None]] = {}
        for one_end, other_end in (*(((way, 0), (way, 1)) for way in self.shapes), *self.joints):
            nodes.setdefault(one_end, {})[other_end] = None
            nodes.setdefault(other_end, {})[one_end] = None
        return nodes

    @property
    def sidewalks(self) -> tuple[str, ...]:
        """Ids of the lanes that are sidewalks, not crossings, in the net's order."""
        return tuple(way for way in self.shapes if way not in self.crossings)

    @cached_property
    def sidewalk_points(self) -> Points:
        """Points along all sidewalks, m; cached for all test cases of a network."""
        return tuple(xy for way in self.sidewalks for xy in Polyline.of(self.shapes[way]).xy)

    def walk(self, from_xy: XY, length_m: float, rng: np.random.Generator) -> Points | None:
        """Return a random walk of at least `length_m` from the sidewalk nearest to a point; None without a sidewalk.

        It may use crossings, and reverses only at dead ends.
        """
        feet = [(_foot(from_xy, self.shapes[way]), way) for way in self.sidewalks]
        if not feet:
            return None
        (start, start_s), way = min(feet, key=lambda foot: distance(foot[0][0], from_xy))
        forward = bool(rng.integers(2))
        corners = list(zip(lengths(self.shapes[way]), self.shapes[way], strict=True))
        ahead = [xy for s, xy in corners if s > start_s] if forward else [xy for s, xy in corners[::-1] if s < start_s]
        points: list[XY] = [start, *ahead]
        end: _End = (way, 1 if forward else 0)
        walked = lengths(points)[-1]
        while walked < length_m:
            choices = self._onward(end) or [end]
            way, at = choices[int(rng.integers(len(choices)))]
            points += self.shapes[way] if at == 0 else self.shapes[way][::-1]
            end = (way, 1 - at)
            walked = lengths(points)[-1]
        return distinct(whole_millimetres(points))

    def stops_on(self, path: Points) -> tuple[Stop, ...]:
        """Return the stretches of a path that lie on the centreline of a crossing with a signal, in order."""
        if path not in self._stops:
            self._stops[path] = self._find_stops(path)
        return self._stops[path]

    def _find_stops(self, path: Points) -> tuple[Stop, ...]:
        s = lengths(path)
        stops: list[Stop] = []
        for way, crossing in self.crossings.items():
            if crossing.tls is None:
                continue
            shape = self.shapes[way]
            on = [distance_to(x, y, shape) <= ON_CROSSING_M for x, y in path]
            first = len(stops)
            for k in (k for k in range(len(path) - 1) if on[k] and on[k + 1]):
                begin_s = s[k]
                if len(stops) > first and stops[-1][1] == s[k]:
                    begin_s = stops.pop()[0]
                stops.append((begin_s, s[k + 1], crossing.tls, crossing.link))
        return tuple(sorted(stops))

    def _onward(self, end: _End) -> list[_End]:
        """Return the ends of other footways that are connected to an end, directly or across a walking area."""
        ends: list[_End] = []
        for node in self.neighbours[end]:
            if node[1] < 0:  # the end touches a walking area
                ends += [other for other in self.neighbours[node] if other != end and other[1] >= 0]
            elif node[0] != end[0]:
                ends.append(node)
        return ends


@lru_cache(maxsize=32)
def walkways(network: Topology) -> Walkways:
    """Return the footways of a network."""
    shapes = {
        lane.id: distinct(lane.shape)
        for lane in network.lanes.values()
        if lane.kinds == {"pedestrian"} and lane.edge not in network.walking_areas
    }
    areas = network.walking_areas
    joints = tuple(
        ((first, -1 if first in areas else 1), (second, -1 if second in areas else 0))
        for first, second in network.footways
    )
    return Walkways(shapes, {c.lane.id: c for c in network.crossings.values()}, joints)


def _foot(point: XY, shape: Points) -> tuple[XY, float]:
    """Return the point of a polyline nearest to a point, and its position along the polyline, m."""
    s, best = lengths(shape), (math.inf, shape[0], 0.0)
    for k, ((x0, y0), (x1, y1)) in enumerate(pairwise(shape)):
        dx, dy = x1 - x0, y1 - y0
        share = min(max(((point[0] - x0) * dx + (point[1] - y0) * dy) / (dx * dx + dy * dy), 0.0), 1.0)
        foot = (x0 + share * dx, y0 + share * dy)
        away = distance(point, foot)
        if away < best[0]:
            best = away, foot, s[k] + share * (s[k + 1] - s[k])
    return best[1], best[2]
