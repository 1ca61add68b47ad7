"""The road network for compiler and simulator: routes, lines, the nearest lane, and the drivable area."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from foresee_dsl.compile.roads import routing
from foresee_dsl.compile.roads.polyline import XY, Points, crosses, distance, distance_to, inside, wrap
from foresee_dsl.compile.roads.route_line import RouteLine, build_line
from foresee_dsl.compile.roads.topology import Lane, LaneKind, NetRoundabout, Topology
from foresee_dsl.errors import measured
from foresee_dsl.helps import write
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.model import Building, BusStop, Network
from foresee_dsl.language.streets import layout
from foresee_dsl.language.streets.lines import shift_right
from foresee_dsl.language.traversal import si_of

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from foresee_dsl.compile.roads.polyline import FloatArray

SAME_DIRECTION_RAD = math.radians(60)
"""Largest difference between a vehicle's heading and the direction of the lane that it is on, rad (measured on CARLA's
towns: with 60 degrees all 612 waypoints find their lane)."""
_HEADING_WEIGHT_M = 1.0
"""Cost of 1 rad difference in direction, m: inside junctions, where lanes overlap, a difference of 1 rad counts like 1
m sideways (ours).
"""
CLOSE_GAPS_M = 0.3
"""Half of the widest gap between lanes that counts as road, m (ours: roundings and corners of maps; medians are
wider)."""

_WHOLE_M = 3000.0
"""Largest side of a map whose drivable area is computed at once instead of in parts, m (ours: the largest of CARLA's
towns in the tests has some 800 m)."""
_TILE_M = 500.0
"""Side of the tiles of a larger map, m (ours: most routes lie in one or two)."""
_BESIDE_M = 50.0
"""Roads within this margin around a tile count for the tile too, m (ours: more than the widest lane and the largest
cached square).
"""
Box = tuple[float, float, float, float]
"""Left, bottom, right and top, m."""
_CELL_M = 50.0
"""Side of a cell of the lane index, m. Ours: a town's lanes are 50 to 150 m long, so that each is in a few cells, and a
cell holds the lanes of a junction."""
_CORNERS = 36
"""Number of corners of a roundabout's outline (ours: at a radius of 20 m it is within 8 cm of the circle)."""
_REACHES_M = (10.0, 100.0, 1000.0)
"""Radii in which the nearest lane is searched before all lanes are compared, m (ours)."""


@dataclass(frozen=True)
class NearLane:
    """The position of a point relative to a lane: along it, and sideways (left positive), m."""

    lane: Lane
    pos_m: float
    lateral_m: float


@dataclass(frozen=True, eq=False)
class StopPlace:
    """A bus stop: its lane, the position along the lane of the front of a stopped vehicle, m, its length, m, and its
    outline, which is as wide as the lane.

    `bay` is True if the lane is a bay, which only buses may use. `beside` holds the lanes that lead to the bay, on the
    pieces of its edge before it.
    """

    lane: Lane
    pos_m: float
    length_m: float
    outline: Points
    bay: bool = False
    beside: tuple[Lane, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class RoadNetwork(Topology):
    """A road network; compared by identity, so that results can be cached per network.

    `buildings` holds the outlines of buildings, which hide actors; `bus_stops` holds the statements of the bus stops by
    name. A net file has neither.
    """

    buildings: tuple[Points, ...] = ()
    bus_stops: Mapping[str, BusStop] = field(default_factory=dict)
    _tiles: dict[tuple[int, int], BaseGeometry] = field(default_factory=dict, init=False)
    _indices: dict[LaneKind | None, _LaneIndex] = field(default_factory=dict, init=False)

    @classmethod
    def of(cls, topology: Topology, buildings: tuple[Points, ...] = (), written: Network | None = None) -> RoadNetwork:
        """Return a network with the parts of a topology and the outlines of its buildings.

        `written`: the network from which the net was built; it defines pieces of edges, roundabouts and bus stops.
        """
        read = {f.name: getattr(topology, f.name) for f in fields(Topology) if f.init}
        if written is not None:
            joints = layout.joints_of(written)
            read |= {"parts": layout.parts_of(written), "rings": rings_of(written), "joints": joints}
            read["bus_stops"] = {item.name: item for item in written.body if isinstance(item, BusStop)}
        return cls(**read, buildings=buildings)

    route_edges = routing.route_edges
    shortest_route = routing.shortest_route

    def line(
        self,
        edges: tuple[str, ...],
        *,
        start_lane: str | None = None,
        after_m: float = 0.0,
        behind_m: float = 0.0,
        beyond_m: float = 0.0,
        kind: LaneKind = "car",
    ) -> RouteLine:
        """Return the centreline for a vehicle that follows connected edges, with the fewest lane changes.

        Args:
            edges: the route. kind: the kind of lanes that the vehicle uses.
            start_lane: the lane of the first edge on which the line begins, or an internal lane between the first two
                edges, through which the line leads.
            after_m: position along the first edge before which no lane change begins.
            behind_m: length of the way to the first edge that is added before it, m.
            beyond_m: smallest length that is added after the last edge, straight on if possible, m. Both end where the
                network ends.

        Raises:
            RouteError: no lane of an edge leads to the next edge for this kind.
        """
        return build_line(self, edges, start_lane, after_m, behind_m, beyond_m, kind)

    def nearest_lane(
        self, x: float, y: float, heading_rad: float | None = None, kind: LaneKind = "car", within_m: float = 10.0
    ) -> NearLane | None:
        """Return the lane (also an internal one) that is nearest to a point; None if no lane is within `within_m` of
        it.

        With a heading, only lanes within 60 degrees of it are considered, and similar directions are preferred.
        """
        best: tuple[float, NearLane] | None = None
        for _, lane in self._index(kind).within(x, y, within_m):
            s, lateral = lane.line.project(x, y)
            within = min(max(s, 0.0), lane.line.length_m)
            cost = math.hypot(s - within, lateral)
            if heading_rad is not None:
                off = abs(wrap(lane.line.at(within)[2] - heading_rad))
                if off > SAME_DIRECTION_RAD:
                    continue
                cost += _HEADING_WEIGHT_M * off
            if best is None or cost < best[0] - 1e-9:
                best = cost, NearLane(lane, within, lateral)
        return best[1] if best is not None else None

    def distance_to_lanes(self, x: float, y: float, kind: LaneKind = "car") -> float:
        """Return the distance to the border of the nearest lane for a kind, m: 0 on a lane, infinite without lanes."""
        away, lanes = self._index(kind).nearest(x, y)
        return max(away - max((lane.width_m for lane in lanes), default=0.0) / 2, 0.0)

    def far_from_lanes(self, points: Sequence[XY], beyond_m: float) -> XY | None:
        """Return the first point that is farther than `beyond_m` from the centrelines of all lanes, if any."""
        index = self._index(None)
        return next((point for point in points if not index.any_within(*point, beyond_m)), None)

    def wall_on_the_way(self, path: Sequence[XY]) -> XY | None:
        """Return a corner of the first building that a path (or a point) touches, if any."""
        left, right = min(x for x, _ in path), max(x for x, _ in path)
        bottom, top = min(y for _, y in path), max(y for _, y in path)
        for outline, (low_x, low_y, high_x, high_y) in zip(self.buildings, self._building_boxes, strict=True):
            if low_x > right or high_x < left or low_y > top or high_y < bottom:
                continue
            if any(inside(point, outline) for point in path[:1]) or crosses(path, (*outline, outline[0])):
                return outline[0]
        return None

    def locate(self, edge: str, at_m: float, offset_m: float = 0.0) -> tuple[float, float, float]:
        """Return x, y and heading of a place on an edge's rightmost car lane, `at_m` from its beginning (negative: from
        its end).

        `offset_m` is the distance to the left of that lane's centre.

        Raises:
            RouteError: the edge does not exist or is shorter.
        """
        lane, left_m = self.place_on(edge, at_m)
        return lane.line.at(left_m, offset_m)

    def place_on(self, edge: str, at_m: float) -> tuple[Lane, float]:
        """Return the rightmost car lane at a position along an edge (negative: from its end), and the position along
        that lane, m; errors as of `locate`."""
        routing.check_edge(self, edge)
        lanes = [self.edges[piece].drivable[0] for piece in self.pieces(edge)]
        pieces = [lane.line for lane in lanes]
        gaps = [distance(first.xy[-1], second.xy[0]) for first, second in pairwise(pieces)]
        length_m = sum(piece.length_m for piece in pieces) + sum(gaps)
        if abs(at_m) > length_m + 1e-6:
            there = measured(f"{at_m:g}") + " m"
            message = f"{edge} is only " + routing.metres(length_m) + " long, so it has no place at " + there
            raise routing.RouteError(message, "use at most " + write(f"{math.floor(length_m)} m"))
        left_m = at_m if at_m >= 0 else length_m + at_m
        for lane, gap in zip(lanes, (*gaps, 0.0), strict=True):
            if left_m <= lane.line.length_m + gap + 1e-6 or lane is lanes[-1]:
                break
            left_m -= lane.line.length_m + gap
        return lane, left_m

    def stop(self, name: str) -> StopPlace:
        """Return a bus stop.

        Raises:
            RouteError: the stop does not exist, or is beyond the end of its road.
        """
        stop = self.bus_stops.get(name)
        if stop is None:
            help = did_you_mean(name, self.bus_stops)
            none = "the network has none: name a place, or add " + write("stop NAME on ROAD at 40 m")
            raise routing.RouteError(
                f"there is no bus stop called {name}", help or none + " to a network in the language"
            )
        lane, front_m = self.place_on(stop.road, si_of(stop.at))
        length_m = layout.STOP_LENGTH_M if stop.length is None else si_of(stop.length)
        if stop.bay is None:
            return StopPlace(lane, front_m, length_m, _stop_outline(lane, front_m, length_m))
        bay = self.edges[lane.edge].for_kind("bus")[0]
        pieces = self.pieces(stop.road)
        before = (self.edges[piece] for piece in pieces[: pieces.index(bay.edge)])
        beside = tuple(next(lane for lane in edge.for_kind("bus") if not lane.bay) for edge in before)
        front_m = bay.line.project(*lane.line.at(front_m)[:2])[0]
        return StopPlace(bay, front_m, length_m, _stop_outline(bay, front_m, length_m), bay=True, beside=beside)

    @cached_property
    def stops(self) -> Mapping[str, StopPlace]:
        """The bus stops that lie on their roads, by name."""
        on_their_roads = {}
        for name in self.bus_stops:
            with suppress(routing.RouteError):  # a junction cuts its road; actors that stop there have the error
                on_their_roads[name] = self.stop(name)
        return on_their_roads

    @cached_property
    def bays(self) -> frozenset[str]:
        """Ids of the lanes that are bays of bus stops."""
        return frozenset(lane.id for lane in self.lanes.values() if lane.bay)

    @cached_property
    def drivable(self) -> BaseGeometry:
        """The area where vehicles may be: car lanes with their width, and junctions without their walking areas.

        Crossings, parking strips, bus lanes and other parts of the carriageway belong to it. The geometry is prepared
        for point tests.
        """
        return self._drivable((-math.inf, -math.inf, math.inf, math.inf))

    def drivable_around(self, x: float, y: float) -> BaseGeometry:
        """Return the drivable area at a place and 25 m around it: for a large map only a part of the whole area.

        Computing the whole area of a map of 15 km by 11 km would take half of the time of a run.
        """
        left, bottom, right, top = self.bounds
        if max(right - left, top - bottom) <= _WHOLE_M:
            return self.drivable
        tile = math.floor(x / _TILE_M), math.floor(y / _TILE_M)
        if tile not in self._tiles:
            low_x, low_y = tile[0] * _TILE_M - _BESIDE_M, tile[1] * _TILE_M - _BESIDE_M
            high_x, high_y = low_x + _TILE_M + 2 * _BESIDE_M, low_y + _TILE_M + 2 * _BESIDE_M
            self._tiles[tile] = self._drivable((low_x, low_y, high_x, high_y))
        return self._tiles[tile]

    @cached_property
    def bounds(self) -> Box:
        """Bounds of the drivable area with a margin of some metres: left, bottom, right and top, m."""
        outlines = (*(lane.shape for lane in self.lanes.values()), *(j.polygon for j in self.junctions.values()))
        xs, ys = zip(*(point for outline in outlines for point in outline), strict=True)
        spare_m = max(lane.width_m for lane in self.lanes.values()) + CLOSE_GAPS_M
        return min(xs) - spare_m, min(ys) - spare_m, max(xs) + spare_m, max(ys) + spare_m

    def _drivable(self, box: Box) -> BaseGeometry:
        """Return the drivable area of the parts of the network that touch a box."""
        import shapely  # imported here: the import is slow, and placing actors does not need it

        walking = shapely.union_all([polygon(area.polygon) for area in self.walking_areas.values()
                                     if _touches(area.polygon, box)])  # fmt: skip
        junctions = shapely.union_all([polygon(j.polygon) for j in self.junctions.values()
                                       if _touches(j.polygon, box)])  # fmt: skip
        lanes = [lane for lane in self.lanes.values()
                 if ("car" in lane.kinds or lane.strip or lane.fault) and _touches(lane.shape, box)]  # fmt: skip
        bands = [shapely.LineString(lane.shape).buffer(lane.width_m / 2, quad_segs=4) for lane in lanes]
        road = shapely.union_all([shapely.difference(junctions, walking), *bands])
        area = shapely.buffer(shapely.buffer(road, CLOSE_GAPS_M, join_style="mitre"), -CLOSE_GAPS_M)
        shapely.prepare(area)
        return area

    def off_road_depth(self, points: FloatArray) -> FloatArray:
        """Return the distance of each of [K, 2] points from the drivable area, [K] m; 0 inside."""
        import numpy as np
        import shapely

        inside = shapely.contains_xy(self.drivable, points[:, 0], points[:, 1])
        depth = np.zeros(len(points))
        if not inside.all():
            outside = ~inside
            depth[outside] = shapely.distance(self.drivable, shapely.points(points[outside]))
        return depth

    @cached_property
    def _building_boxes(self) -> tuple[tuple[float, float, float, float], ...]:
        """Bounds of each building: left, bottom, right and top, m."""
        corners = (tuple(zip(*outline, strict=True)) for outline in self.buildings)
        return tuple((min(xs), min(ys), max(xs), max(ys)) for xs, ys in corners)

    def _index(self, kind: LaneKind | None) -> _LaneIndex:
        """Return an index of all lanes, or of those for a kind, without walking areas, which have no centreline."""
        if kind not in self._indices:
            lanes = self.lanes.values()
            own = (ln for ln in lanes if kind in ln.kinds and ln.edge not in self.walking_areas)
            self._indices[kind] = _LaneIndex(lanes if kind is None else own)
        return self._indices[kind]


def rings_of(network: Network | Path) -> Mapping[str, NetRoundabout]:
    """Return the roundabouts of a network written in the language, by name; an imported one has none."""
    if isinstance(network, Path):
        return {}
    return {
        name: NetRoundabout(
            frozenset(ring.nodes),
            ring.centre,
            tuple(ring.place(math.tau * k / _CORNERS, ring.outer_m) for k in range(_CORNERS)),
        )
        for name, ring in layout.rings_of(network).items()
    }


_LEAST_STOP_M = 0.5
"""If the edge's beginning cuts off a stop so that less than this length remains, the stop has no outline, m (ours)."""


def _stop_outline(lane: Lane, front_m: float, length_m: float) -> Points:
    """Return the outline of a bus stop on its lane; empty if the edge's beginning cuts off almost all of it."""
    begin_m = max(front_m - length_m, 0.0)
    if front_m - begin_m <= _LEAST_STOP_M:
        return ()
    marks = (begin_m + (front_m - begin_m) * k / 8 for k in range(9))  # nine points, because a stop on a bend is curved
    centre = [(x, y) for x, y, _ in map(lane.line.at, marks)]
    left, right = (shift_right(centre, side * lane.width_m / 2) for side in (-1, 1))
    return (*left, *reversed(right))


def buildings_of(network: Network | Path) -> tuple[Points, ...]:
    """Return the outlines of the buildings of a network written in the language; an imported one has none."""
    if isinstance(network, Path):
        return ()
    outlines = (item.outline for item in network.body if isinstance(item, Building))
    return tuple(tuple((si_of(point.x), si_of(point.y)) for point in outline) for outline in outlines)


def _touches(points: Points, box: Box) -> bool:
    """Return whether the bounding box of points touches a box; False without points."""
    xs, ys = [x for x, _ in points], [y for _, y in points]
    left, bottom, right, top = box
    return bool(points) and min(xs) <= right and max(xs) >= left and min(ys) <= top and max(ys) >= bottom


def polygon(points: Points) -> BaseGeometry:
    """Return a valid polygon for an open outline; SUMO's outlines can touch themselves or be flat."""
    import shapely

    if len(points) < 3:
        return shapely.Polygon()
    shape = shapely.make_valid(shapely.Polygon(points))
    return shape if shape.area > 0 else shapely.Polygon()


class _LaneIndex:
    """An index of lanes by the cells of a grid: a lane is in each cell that the bounding box of its centreline touches.
    It works without numpy (see `polyline`).
    """

    def __init__(self, lanes: Iterable[Lane]) -> None:
        self._lanes = tuple(lanes)
        self._cells: dict[tuple[int, int], list[int]] = {}
        self._boxes: list[tuple[float, float, float, float]] = []
        for k, lane in enumerate(self._lanes):
            xs, ys = zip(*lane.shape, strict=True)
            self._boxes.append((min(xs), min(ys), max(xs), max(ys)))
            for cell in _cells(*self._boxes[-1]):
                self._cells.setdefault(cell, []).append(k)

    def within(self, x: float, y: float, reach_m: float) -> list[tuple[float, Lane]]:
        """Return the lanes whose centreline is within `reach_m` of a point, with the distance."""
        candidates = ((distance_to(x, y, lane.shape), lane) for lane in self._may_be_within(x, y, reach_m))
        return [candidate for candidate in candidates if candidate[0] <= reach_m]

    def any_within(self, x: float, y: float, reach_m: float) -> bool:
        """Return whether a lane's centreline is within `reach_m` of a point."""
        return any(distance_to(x, y, lane.shape) <= reach_m for lane in self._may_be_within(x, y, reach_m))

    def _may_be_within(self, x: float, y: float, reach_m: float) -> Iterator[Lane]:
        """Yield the lanes whose bounding box is within `reach_m` of a point, in their order."""
        low_x, low_y, high_x, high_y = x - reach_m, y - reach_m, x + reach_m, y + reach_m
        near = set()
        for cell in _cells(low_x, low_y, high_x, high_y):
            for k in self._cells.get(cell, ()):
                left, bottom, right, top = self._boxes[k]
                if left <= high_x and right >= low_x and bottom <= high_y and top >= low_y:
                    near.add(k)
        yield from (self._lanes[k] for k in sorted(near))

    def nearest(self, x: float, y: float) -> tuple[float, tuple[Lane, ...]]:
        """Return the distance of the nearest lane's centreline, and all lanes at that distance; infinite without
        lanes."""
        for reach in _REACHES_M:
            candidates = self.within(x, y, reach)
            if candidates:
                break
        else:
            candidates = [(distance_to(x, y, lane.shape), lane) for lane in self._lanes]
        away = min((away for away, _ in candidates), default=math.inf)
        return away, tuple(lane for at, lane in candidates if at == away)


def _cells(low_x: float, low_y: float, high_x: float, high_y: float) -> list[tuple[int, int]]:
    columns = range(math.floor(low_x / _CELL_M), math.floor(high_x / _CELL_M) + 1)
    rows = range(math.floor(low_y / _CELL_M), math.floor(high_y / _CELL_M) + 1)
    return [(column, row) for column in columns for row in rows]
