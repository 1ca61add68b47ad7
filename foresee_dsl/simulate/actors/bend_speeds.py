"""Speeds at which a vehicle can drive through the bends of a line without sliding or tipping over."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import remainder, sqrt, tau
from typing import NamedTuple

import numpy as np

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.placement.statements import lane_kind
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import lengths
from foresee_dsl.compile.roads.topology import Movement, per_network
from foresee_dsl.kernels.arrays import FloatArray, Records
from foresee_dsl.kernels.lines import speed_points
from foresee_dsl.simulate.actors.dynamics import lateral_limit_mps2

TURNS_WITH = 0.6
"""Share of the lateral limit of a vehicle (tyres or tipping, `lateral_limit_mps2`) that it uses in a bend. Ours: 5.3
m/s^2 on a dry road, just under the 5.5 m/s^2 from which netconvert computes the speed limits inside junctions. The
remaining 40 % is a reserve for corners in a map's lines and for braking within a bend."""

PLANNED_SHARE = 0.8
"""A vehicle slows down before a bend with this share of its comfortable braking. Ours: the rest makes up for the delay
of the brakes."""

_SLOWEST_MPS = 1.0
"""Lowest speed limit of a bend, m/s. Where a line folds back on itself, no vehicle could drive its curvature; without
this lowest limit the vehicle would stop there."""


AHEAD_M = 60.0
"""Distance beyond the end of its lane up to which a vehicle considers bends, m. Ours: braking from 70 km/h with
3.2 m/s^2 takes 58 m."""
_EDGES = 4
"""Maximum number of edges of its route on which a vehicle looks for bends. Ours: in a town four edges are longer than
`AHEAD_M`."""


class BendSpeeds:
    """The highest speed at each point of a line from which a vehicle can still slow down for every bend that follows.

    Args:
        marks: [N] m along the line. heading: [N] rad, continuous.
        axle_m: distance of the rear axle behind the point that follows the line, m; a bend that is shorter than this
            counts as this long.
        lateral_mps2: largest lateral acceleration of the vehicle, m/s^2, of which it uses the share `TURNS_WITH`.
        braking_mps2: comfortable braking of the vehicle, m/s^2.

    Attributes:
        marks: [N] m along the line. speeds: [N] m/s. slowest_mps: the lowest of these speeds.
    """

    def __init__(
        self,
        marks: Sequence[float],
        heading: Sequence[float],
        *,
        axle_m: float,
        lateral_mps2: float,
        braking_mps2: float,
    ) -> None:
        """Compute the speeds."""
        s, angle = np.asarray(marks), np.asarray(heading)
        turned = np.maximum(_turned(s, angle, 0.0, axle_m), _turned(s, angle, axle_m / 2, axle_m))
        bent = np.maximum(turned / axle_m, 1e-9)
        free = np.maximum(np.sqrt(TURNS_WITH * lateral_mps2 / bent), _SLOWEST_MPS)
        self.marks = marks
        self.speeds = approached(free.tolist(), marks, PLANNED_SHARE * braking_mps2)
        self.slowest_mps = min(self.speeds)


class BendStretch(NamedTuple):
    """The part of `LaneBends.points` that holds the bends of one lane and of the lanes that follow it.

    Attributes:
        begin: index of the first point. end: index after the last point. slowest_mps: lowest speed of these points,
            m/s.
    """

    begin: int
    end: int
    slowest_mps: float


NO_BENDS = BendStretch(0, 0, math.inf)
"""The stretch for a vehicle that is not on a lane: it contains no bends."""


class _StretchCache:
    """The stretches of one network computed so far.

    Attributes:
        stretches: the stretches; the key is the lane, the model, the next edges and the friction. points: the
            `SpeedPoint`s of all stretches.
    """

    def __init__(self, _: RoadNetwork) -> None:
        self.clear()

    def clear(self) -> None:
        self.stretches: dict[tuple[str, ModelSpec, tuple[str, ...], float], BendStretch] = {}
        self.points = speed_points((), ())

    def add(self, bends: BendSpeeds) -> BendStretch:
        begin = len(self.points)
        self.points = np.concatenate([self.points, speed_points(bends.marks, bends.speeds)])
        return BendStretch(begin, len(self.points), bends.slowest_mps)


_cache_of = per_network(_StretchCache)
_MOST_POINTS = 2**18
"""Number of cached points (4 MB) above which the network's next run starts with an empty cache. Ours: 400 random test
cases of one town have 350,000."""


class LaneBends:
    """The speeds at which the vehicles that SUMO drives can take the bends of their lane and of the next ones.

    A bend that the vehicle has just driven through is not counted. The speeds thus do not depend on earlier positions,
    and a run rebuilt from a description continues in the same way.
    """

    def __init__(self, network: RoadNetwork, friction: float) -> None:
        """Use the cache of a network; `friction`: tyre-road friction coefficient."""
        self._network, self._friction = network, friction
        self._cache = _cache_of(network)
        if len(self._cache.points) > _MOST_POINTS:
            self._cache.clear()
        self._passed: dict[str, int] = {}

    @property
    def points(self) -> Records:
        """The `SpeedPoint`s of all stretches, [P]. Each holds a length, m, counted from the beginning of its stretch's
        first lane, and the highest speed at that place, m/s.
        """
        return self._cache.points

    def ahead(self, vehicle: str, model: ModelSpec, lane: str, route: Sequence[str]) -> BendStretch:
        """Return the bends of a vehicle's lane and of the lanes that follow on its route."""
        if lane not in self._network.lanes:
            return NO_BENDS
        return self._of(vehicle, model, lane, route)

    def _of(self, vehicle: str, model: ModelSpec, lane: str, route: Sequence[str]) -> BendStretch:
        movement = next(reversed(self._network.movements_through(lane)), None)
        edge = movement.to_edge if movement is not None else self._network.lanes[lane].edge
        edges = self._left(vehicle, route, edge)
        key = (lane, model, edges, self._friction)
        stretch = self._cache.stretches.get(key)
        if stretch is None:
            stretch = self._cache.stretches[key] = self._cache.add(self._bends(lane, movement, edges, model))
        return stretch

    def _left(self, vehicle: str, route: Sequence[str], edge: str) -> tuple[str, ...]:
        """Return the edges of a route that follow the vehicle's current edge.

        A route may pass an edge twice, so the search continues from the vehicle's last position.
        """
        done = self._passed.get(vehicle, 0)
        if edge not in route[done:]:
            return (edge,)
        done = self._passed[vehicle] = route.index(edge, done)
        return tuple(route[done : done + _EDGES])

    def _bends(self, lane: str, movement: Movement | None, edges: tuple[str, ...], model: ModelSpec) -> BendSpeeds:
        points = list(self._network.lanes[lane].line.xy)
        angles = list(self._network.lanes[lane].line.angles)
        for name in self._following(lane, movement, edges, model):
            line = self._network.lanes[name].line
            turn = remainder(line.angles[0] - angles[-1], tau) - (line.angles[0] - angles[-1])
            # Where two lanes meet, their end points may coincide. Both points are kept, because the heading may change
            # between them.
            points += line.xy
            angles += [angle + turn for angle in line.angles]
        marks = lengths(points)
        return BendSpeeds(
            marks,
            angles,
            axle_m=model.front_overhang_m + model.wheelbase_m,
            lateral_mps2=lateral_limit_mps2(model.name, self._friction),
            braking_mps2=model.braking_mps2,
        )

    def _following(
        self, lane: str, movement: Movement | None, edges: tuple[str, ...], model: ModelSpec
    ) -> Iterator[str]:
        """Yield the lanes that follow on a route, up to `AHEAD_M`; where several lanes are parallel, yield the lane
        that is nearest to the current one.
        """
        far = 0.0
        if movement is not None:
            rest = (*movement.via[movement.via.index(lane) + 1 :], movement.to_lane)
            yield from rest
            lane = movement.to_lane
            far = sum(self._network.lanes[name].length_m for name in rest)
        for edge, following in pairwise(edges):
            if far > AHEAD_M:
                return
            index = self._network.lanes[lane].index
            ways = [m for m in self._network.movements_from(edge, lane_kind(model)) if m.to_edge == following]
            if not ways:
                return
            way = min(ways, key=lambda m: abs(self._network.lanes[m.from_lane].index - index))
            yield from (*way.via, way.to_lane)
            lane = way.to_lane
            far += sum(self._network.lanes[name].length_m for name in (*way.via, way.to_lane))


def approached(limits: Sequence[float], s: Sequence[float], braking_mps2: float) -> list[float]:
    """Return, for each point, the highest speed (m/s) from which a vehicle that brakes at this rate keeps every later
    limit.
    """
    speeds = list(limits)
    for k in range(len(speeds) - 2, -1, -1):
        speeds[k] = min(speeds[k], sqrt(speeds[k + 1] ** 2 + 2 * braking_mps2 * (s[k + 1] - s[k])))
    return speeds


def _turned(s: FloatArray, heading: FloatArray, behind_m: float, span_m: float) -> FloatArray:
    """Return, for each point, by how much the heading changes (rad) over a stretch of `span_m` that ends `behind_m`
    before the point.
    """
    ends = s - behind_m
    turned: FloatArray = np.abs(np.interp(ends, s, heading) - np.interp(ends - span_m, s, heading))
    return turned
