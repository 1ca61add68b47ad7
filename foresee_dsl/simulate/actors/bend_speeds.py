"""How fast the bends of a line may be taken, so that no vehicle turns with more than its tyres or its balance hold."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import remainder, sqrt, tau
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.placement.statements import lane_kind
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import lengths
from foresee_dsl.compile.roads.topology import Movement
from foresee_dsl.kernels.arrays import FloatArray, Records
from foresee_dsl.kernels.lines import speed_points
from foresee_dsl.simulate.actors.dynamics import lateral_limit_mps2

TURNS_WITH = 0.6
"""Share of the lateral acceleration that a vehicle can hold with which it takes bends. Ours: 5.3 m/s^2 on a dry road,
just under the 5.5 m/s^2 that netconvert makes the limits inside junctions from; the rest is for what comes on top of a
bend: corners of a map's lines, and braking."""

PLANNED_SHARE = 0.8
"""Share of comfortable braking that is planned with; ours, the rest is for the lag."""

_SLOWEST_MPS = 1.0
"""A line that folds back says nothing of how fast it can be driven."""


AHEAD_M = 60.0
"""So far beyond its lane the bends are known. Ours: braking from 70 km/h with 3.2 m/s^2 takes 58 m."""
_EDGES = 4
"""Nor beyond so many edges of its route; ours, in a town they are more than `AHEAD_M`."""


class BendSpeeds:
    """The speed at each place of a line from which every bend that follows can be met.

    Args:
        marks: [N] m along the line. heading: [N] rad, continuous.
        axle_m: how far the rear axle lies behind what follows the line: a bend that is shorter counts as this long.
        lateral_mps2: what the vehicle can hold; it uses `TURNS_WITH` of it.
        braking_mps2: how hard it brakes in comfort.

    Attributes:
        marks: [N] m. speeds: [N] m/s. slowest_mps: the least of these.
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


class Stretch(NamedTuple):
    """Where the bends of a lane and of those that follow it lie in the arrays of `LaneBends`.

    Attributes:
        begin, end: of them. slowest_mps: the least of their speeds.
    """

    begin: int
    end: int
    slowest_mps: float


NO_BENDS = Stretch(0, 0, math.inf)
"""Of a vehicle that is on no lane."""


class _Known:
    """What was computed for a network: the children of a clip drive on the same one.

    Attributes:
        stretches: by lane, model, next edges and friction. points: of all of them, one after the other.
    """

    def __init__(self) -> None:
        self.stretches: dict[tuple[str, ModelSpec, tuple[str, ...], float], Stretch] = {}
        self.points = speed_points((), ())

    def add(self, bends: BendSpeeds) -> Stretch:
        begin = len(self.points)
        self.points = np.concatenate([self.points, speed_points(bends.marks, bends.speeds)])
        return Stretch(begin, len(self.points), bends.slowest_mps)


_KNOWN: WeakKeyDictionary[RoadNetwork, _Known] = WeakKeyDictionary()
_MOST_POINTS = 2**18
"""With more points, 4 MB, a network's next run begins anew. Ours: 400 drawn test cases of a town have 350,000."""


class LaneBends:
    """How fast the vehicles that SUMO drives may go, by their lane and those that follow on their route.

    Nothing depends on where a vehicle was before, so that a run that is rebuilt from a description continues in the
    same way: what a lane's vehicle has just turned through is not counted.
    """

    def __init__(self, network: RoadNetwork, friction: float) -> None:
        """Know a network, and how wet it is."""
        self._network, self._friction = network, friction
        if len(_KNOWN.setdefault(network, _Known()).points) > _MOST_POINTS:
            _KNOWN[network] = _Known()
        self._known = _KNOWN[network]
        self._done: dict[str, int] = {}

    @property
    def points(self) -> Records:
        """[P] `SpeedPoint`s: lengths along the lane of the stretch that a point belongs to, and what may be driven."""
        return self._known.points

    def ahead(self, vehicle: str, model: ModelSpec, lane: str, route: Sequence[str]) -> Stretch:
        """Return the bends of the lane that a vehicle is on and of those that follow on its route."""
        if lane not in self._network.lanes:
            return NO_BENDS
        return self._of(vehicle, model, lane, route)

    def _of(self, vehicle: str, model: ModelSpec, lane: str, route: Sequence[str]) -> Stretch:
        movement = next(reversed(self._network.movements_through(lane)), None)
        edge = movement.to_edge if movement is not None else self._network.lanes[lane].edge
        edges = self._left(vehicle, route, edge)
        key = (lane, model, edges, self._friction)
        found = self._known.stretches.get(key)
        if found is None:
            found = self._known.stretches[key] = self._known.add(self._bends(lane, movement, edges, model))
        return found

    def _left(self, vehicle: str, route: Sequence[str], edge: str) -> tuple[str, ...]:
        """Return the next edges of a route, which may pass an edge twice."""
        done = self._done.get(vehicle, 0)
        if edge not in route[done:]:
            return (edge,)
        done = self._done[vehicle] = route.index(edge, done)
        return tuple(route[done : done + _EDGES])

    def _bends(self, lane: str, movement: Movement | None, edges: tuple[str, ...], model: ModelSpec) -> BendSpeeds:
        points = list(self._network.lanes[lane].line.xy)
        angles = list(self._network.lanes[lane].line.angles)
        for name in self._following(lane, movement, edges, model):
            line = self._network.lanes[name].line
            turn = remainder(line.angles[0] - angles[-1], tau) - (line.angles[0] - angles[-1])
            # Two points may fall on each other where lanes meet: the turn there is what matters.
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
        """Yield the lanes after one on a route, for `AHEAD_M`; where there are several, the one nearest beside."""
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
    """Return the speeds (m/s) at points of a line from which this braking meets every limit that follows."""
    found = list(limits)
    for k in range(len(found) - 2, -1, -1):
        found[k] = min(found[k], sqrt(found[k + 1] ** 2 + 2 * braking_mps2 * (s[k + 1] - s[k])))
    return found


def _turned(s: FloatArray, heading: FloatArray, behind_m: float, span_m: float) -> FloatArray:
    """Return by how much a line turns, at each of its points, over a span that ends so far behind it, rad."""
    ends = s - behind_m
    found: FloatArray = np.abs(np.interp(ends, s, heading) - np.interp(ends - span_m, s, heading))
    return found
