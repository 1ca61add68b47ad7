"""The road network as the compiler and the simulator see it: routes, lines, the nearest lane, where the road ends."""

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
from foresee_dsl.compile.roads.topology import Lane, LaneKind, Roundabout, Topology
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

_SAME_DIRECTION_RAD = math.radians(60)
"""A lane whose direction differs by more is not the one that a vehicle drives on (measured on CARLA's towns: with 60
degrees all 612 waypoints find their lane)."""
_HEADING_WEIGHT_M = 1.0
"""Inside junctions lanes overlap: a radian off in direction counts like a metre off sideways (ours)."""
_CLOSE_GAPS_M = 0.3
"""Gaps between lanes of up to twice this width are road (ours: roundings and corners of maps; no median is so
narrow)."""

_WHOLE_M = 3000.0
"""A map of at most this side is looked at as a whole (ours: CARLA's largest town of the tests has some 800 m)."""
_TILE_M = 500.0
"""Side of the parts of a larger map, m (ours: most ways lie in one or two)."""
_BESIDE_M = 50.0
"""Beside a part, m, what touches it counts too (ours: more than the widest lane and the largest remembered square)."""
Box = tuple[float, float, float, float]
"""Left, bottom, right and top, m."""
_CELL_M = 50.0
"""Ours: a town's lanes are 50 to 150 m long, so that each is in a few cells and a cell holds a junction's lanes."""
_CORNERS = 36
"""Corners of a roundabout's outline (ours: of 20 m radius, it is within 8 cm of the circle)."""
_REACHES_M = (10.0, 100.0, 1000.0)
"""Radii, m, in which the nearest lane is sought before all lanes are compared (ours)."""


@dataclass(frozen=True)
class NearLane:
    """Where a point is relative to a lane: length along it, distance sideways (left positive)."""

    lane: Lane
    pos_m: float
    lateral_m: float


@dataclass(frozen=True, eq=False)
class StopPlace:
    """A bus stop: its lane, how far along it the front of a vehicle that stops there stands, m, its length, m, and its
    outline, of the lane's width. `bay`: the lane is a bay, for buses alone; `beside`: the lanes that lead to it, on the
    pieces of its edge before it."""

    lane: Lane
    pos_m: float
    length_m: float
    outline: Points
    bay: bool = False
    beside: tuple[Lane, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class RoadNetwork(Topology):
    """A road network; compared by identity, so that results can be cached per network.

    `buildings`: outlines of what hides things; the net file has none. `bus_stops`: the statements of the bus stops, by
    name; likewise.
    """

    buildings: tuple[Points, ...] = ()
    bus_stops: Mapping[str, BusStop] = field(default_factory=dict)

    @classmethod
    def from_net(cls, net_file: Path, buildings: tuple[Points, ...] = ()) -> RoadNetwork:
        """Read a SUMO network, and add the outlines of its buildings."""
        from foresee_dsl.compile.nets.net_reader import read_net  # XML, which a net that was read before does without

        return cls.of(read_net(net_file), buildings)

    @classmethod
    def of(cls, topology: Topology, buildings: tuple[Points, ...] = (), written: Network | None = None) -> RoadNetwork:
        """Make one from what was read, and the outlines of its buildings.

        `written`: the network that the net was built from: it says which edges are pieces of one, and what a
        roundabout is.
        """
        read = {f.name: getattr(topology, f.name) for f in fields(Topology)}
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
        """Return the centreline for a vehicle that follows connected edges, with the fewest lane changes; a
        `RouteError` where no lane of an edge leads to the next for this kind.

        Args:
            start_lane: the lane of the first edge to begin on, or a lane inside the junction between the first two
            edges; the line then goes through it.
            after_m: no lane change on the first edge begins before this length along it.
            behind_m: add this much of the way to the first edge. beyond_m: add at least this much after the last edge,
            straight on where possible; both as far as the network goes.
        """
        return build_line(self, edges, start_lane, after_m, behind_m, beyond_m, kind)

    def nearest_lane(
        self, x: float, y: float, heading_rad: float | None = None, kind: LaneKind = "car", within_m: float = 10.0
    ) -> NearLane | None:
        """Return the lane (inside junctions too) nearest to a point, m, no farther away than `within_m`; or None.

        With a heading only lanes within 60 degrees of it, and of several the one that points the same way.
        """
        best: tuple[float, NearLane] | None = None
        for _, lane in self._index(kind).within(x, y, within_m):
            s, lateral = lane.line.project(x, y)
            within = min(max(s, 0.0), lane.line.length_m)
            cost = math.hypot(s - within, lateral)
            if heading_rad is not None:
                off = abs(wrap(lane.line.at(within)[2] - heading_rad))
                if off > _SAME_DIRECTION_RAD:
                    continue
                cost += _HEADING_WEIGHT_M * off
            if best is None or cost < best[0] - 1e-9:
                best = cost, NearLane(lane, within, lateral)
        return best[1] if best is not None else None

    def distance_to_lanes(self, x: float, y: float, kind: LaneKind = "car") -> float:
        """Return the distance (m) to the edge of the nearest lane for a kind: 0 on one, infinite for none."""
        away, lanes = self._index(kind).nearest(x, y)
        return max(away - max((lane.width_m for lane in lanes), default=0.0) / 2, 0.0)

    def far_from_lanes(self, points: Sequence[XY], beyond_m: float) -> XY | None:
        """Return the first of some points that is farther than a distance from every lane's centreline, if any."""
        index = self._index(None)
        return next((point for point in points if not index.any_within(*point, beyond_m)), None)

    def wall_on_the_way(self, path: Sequence[XY]) -> XY | None:
        """Return a corner of the first building that a path (or a point) is in or goes through, if any."""
        left, right = min(x for x, _ in path), max(x for x, _ in path)
        bottom, top = min(y for _, y in path), max(y for _, y in path)
        for outline, (low_x, low_y, high_x, high_y) in zip(self.buildings, self._building_boxes, strict=True):
            if low_x > right or high_x < left or low_y > top or high_y < bottom:
                continue
            if any(inside(point, outline) for point in path[:1]) or crosses(path, (*outline, outline[0])):
                return outline[0]
        return None

    def locate(self, edge: str, at_m: float, offset_m: float = 0.0) -> tuple[float, float, float]:
        """Return x, y, heading of a place along an edge's rightmost car lane, `at_m` from its beginning (negative: its
        end).

        `offset_m`: sideways from that lane's centre, left positive. A `RouteError` for no such edge, or a shorter one.
        """
        lane, left_m = self.place_on(edge, at_m)
        return lane.line.at(left_m, offset_m)

    def place_on(self, edge: str, at_m: float) -> tuple[Lane, float]:
        """Return the rightmost lane for cars at a length along an edge (negative: from its end), and the length along
        that lane; errors as of `locate`."""
        routing.check_edge(self, edge)
        lanes = [self.edges[piece].drivable[0] for piece in self.pieces(edge)]
        pieces = [lane.line for lane in lanes]
        gaps = [distance(one.xy[-1], other.xy[0]) for one, other in pairwise(pieces)]
        length_m = sum(piece.length_m for piece in pieces) + sum(gaps)
        if abs(at_m) > length_m + 1e-6:
            message = (
                f"{edge} is only "
                + measured(f"{length_m:.1f}")
                + " m long, there is no "
                + measured(f"{at_m:g}")
                + " m along it"
            )
            raise routing.RouteError(message, "use at most " + write(f"{math.floor(length_m)} m"))
        left_m = at_m if at_m >= 0 else length_m + at_m
        for lane, gap in zip(lanes, (*gaps, 0.0), strict=True):
            if left_m <= lane.line.length_m + gap + 1e-6 or lane is lanes[-1]:
                break
            left_m -= lane.line.length_m + gap
        return lane, left_m

    def stop(self, name: str) -> StopPlace:
        """Return where a bus stop is; a `RouteError` where there is none, or it lies beyond the end of its road."""
        stop = self.bus_stops.get(name)
        if stop is None:
            help = did_you_mean(name, self.bus_stops)
            none = "the network has none: name a place, or add " + write("stop NAME on ROAD at 40 m")
            raise routing.RouteError(f"there is no bus stop called {name}", help or none + " to a network of ours")
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
            with suppress(routing.RouteError):  # an actor that stops there is told so
                on_their_roads[name] = self.stop(name)
        return on_their_roads

    @cached_property
    def bays(self) -> frozenset[str]:
        """The lanes that are bays of bus stops, by their ids."""
        return frozenset(lane.id for lane in self.lanes.values() if lane.bay)

    @cached_property
    def drivable(self) -> BaseGeometry:
        """Where vehicles may be: car lanes with their width, and junctions without their walking areas.

        Crossings, parking strips, bus lanes and what else lies on the carriageway count as road. Prepared for tests of
        points.
        """
        return self._drivable((-math.inf, -math.inf, math.inf, math.inf))

    def drivable_around(self, x: float, y: float) -> BaseGeometry:
        """Return the drivable area for questions about a place, and 25 m around it: of a large map only a part of it.

        Of a map of 15 km by 11 km the whole area takes half of the time of a run.
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
    def _tiles(self) -> dict[tuple[int, int], BaseGeometry]:
        return {}

    @cached_property
    def bounds(self) -> Box:
        """Left, bottom, right and top of all that is drivable, m, with some metres to spare."""
        outlines = (*(lane.shape for lane in self.lanes.values()), *(j.polygon for j in self.junctions.values()))
        xs, ys = zip(*(point for outline in outlines for point in outline), strict=True)
        spare_m = max(lane.width_m for lane in self.lanes.values()) + _CLOSE_GAPS_M
        return min(xs) - spare_m, min(ys) - spare_m, max(xs) + spare_m, max(ys) + spare_m

    def _drivable(self, box: Box) -> BaseGeometry:
        """The drivable area of what lies in a box, wholly or partly."""
        import shapely  # here: it takes long to import, and placing actors does without

        walking = shapely.union_all([_polygon(area.polygon) for area in self.walking_areas.values()
                                     if _touches(area.polygon, box)])  # fmt: skip
        junctions = shapely.union_all([_polygon(j.polygon) for j in self.junctions.values()
                                       if _touches(j.polygon, box)])  # fmt: skip
        lanes = [lane for lane in self.lanes.values()
                 if ("car" in lane.kinds or lane.strip or lane.fault) and _touches(lane.shape, box)]  # fmt: skip
        bands = [shapely.LineString(lane.shape).buffer(lane.width_m / 2, quad_segs=4) for lane in lanes]
        road = shapely.union_all([shapely.difference(junctions, walking), *bands])
        area = shapely.buffer(shapely.buffer(road, _CLOSE_GAPS_M, join_style="mitre"), -_CLOSE_GAPS_M)
        shapely.prepare(area)
        return area

    def off_road_depth(self, points: FloatArray) -> FloatArray:
        """Return [K] m: how far each of [K, 2] points is outside the drivable area, 0 inside."""
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
        """Left, bottom, right and top of each building."""
        corners = (tuple(zip(*outline, strict=True)) for outline in self.buildings)
        return tuple((min(xs), min(ys), max(xs), max(ys)) for xs, ys in corners)

    @cached_property
    def _indices(self) -> dict[LaneKind | None, _LaneIndex]:
        return {}

    def _index(self, kind: LaneKind | None) -> _LaneIndex:
        """Lanes by place: all, or those of a kind without walking areas, which have an outline and no centreline."""
        if kind not in self._indices:
            lanes = self.lanes.values()
            own = (ln for ln in lanes if kind in ln.kinds and ln.edge not in self.walking_areas)
            self._indices[kind] = _LaneIndex(lanes if kind is None else own)
        return self._indices[kind]


def rings_of(network: Network | Path) -> Mapping[str, Roundabout]:
    """Return the roundabouts of a network written in the language, by name; an imported one has none."""
    if isinstance(network, Path):
        return {}
    return {
        name: Roundabout(
            frozenset(ring.nodes),
            ring.centre,
            tuple(ring.place(math.tau * k / _CORNERS, ring.outer_m) for k in range(_CORNERS)),
        )
        for name, ring in layout.rings_of(network).items()
    }


_LEAST_STOP_M = 0.5
"""A shorter stop, cut off by the edge's beginning, has no outline (ours)."""


def _stop_outline(lane: Lane, front_m: float, length_m: float) -> Points:
    """Return the outline of a bus stop on its lane; none where the edge's beginning cuts almost all of it off."""
    begin_m = max(front_m - length_m, 0.0)
    if front_m - begin_m <= _LEAST_STOP_M:
        return ()
    marks = (begin_m + (front_m - begin_m) * k / 8 for k in range(9))  # a stop on a bend follows it
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
    """Whether the bounding box of some points touches a box; of no points it does not."""
    xs, ys = [x for x, _ in points], [y for _, y in points]
    left, bottom, right, top = box
    return bool(points) and min(xs) <= right and max(xs) >= left and min(ys) <= top and max(ys) >= bottom


def _polygon(points: Points) -> BaseGeometry:
    """A polygon from an open outline; SUMO's can touch themselves or be flat."""
    import shapely

    if len(points) < 3:
        return shapely.Polygon()
    shape = shapely.make_valid(shapely.Polygon(points))
    return shape if shape.area > 0 else shapely.Polygon()


class _LaneIndex:
    """Lanes by the cells of a grid that the bounding box of their centreline touches (no numpy: see `polyline`)."""

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
        """Return the lanes whose centreline comes so near to a point, with the distance."""
        found = ((distance_to(x, y, lane.shape), lane) for lane in self._may_be_within(x, y, reach_m))
        return [one for one in found if one[0] <= reach_m]

    def any_within(self, x: float, y: float, reach_m: float) -> bool:
        """Say whether a lane's centreline comes so near to a point."""
        return any(distance_to(x, y, lane.shape) <= reach_m for lane in self._may_be_within(x, y, reach_m))

    def _may_be_within(self, x: float, y: float, reach_m: float) -> Iterator[Lane]:
        """Yield the lanes whose bounding box comes so near to a point, in their order."""
        low_x, low_y, high_x, high_y = x - reach_m, y - reach_m, x + reach_m, y + reach_m
        near = set()
        for cell in _cells(low_x, low_y, high_x, high_y):
            for k in self._cells.get(cell, ()):
                left, bottom, right, top = self._boxes[k]
                if left <= high_x and right >= low_x and bottom <= high_y and top >= low_y:
                    near.add(k)
        yield from (self._lanes[k] for k in sorted(near))

    def nearest(self, x: float, y: float) -> tuple[float, tuple[Lane, ...]]:
        """Return the distance of the nearest lane's centreline, and all that are so near; infinite for no lanes."""
        for reach in _REACHES_M:
            found = self.within(x, y, reach)
            if found:
                break
        else:
            found = [(distance_to(x, y, lane.shape), lane) for lane in self._lanes]
        away = min((away for away, _ in found), default=math.inf)
        return away, tuple(lane for at, lane in found if at == away)


def _cells(low_x: float, low_y: float, high_x: float, high_y: float) -> list[tuple[int, int]]:
    columns = range(math.floor(low_x / _CELL_M), math.floor(high_x / _CELL_M) + 1)
    rows = range(math.floor(low_y / _CELL_M), math.floor(high_y / _CELL_M) + 1)
    return [(column, row) for column in columns for row in rows]
