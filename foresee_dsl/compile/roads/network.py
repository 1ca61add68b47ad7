"""The road network as the compiler and the simulator see it: names, ways, lines, and where the road ends."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from foresee_dsl.compile.nets.net_reader import NetParts, read_net
from foresee_dsl.compile.roads import route_line, routing
from foresee_dsl.compile.roads.lane_index import LaneIndex
from foresee_dsl.compile.roads.polyline import XY, Points, crosses, inside, wrap
from foresee_dsl.compile.roads.route_line import Passage, RouteLine
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.compile.roads.topology import Crossing, Edge, Junction, Lane, LaneKind, Movement, WalkingArea
from foresee_dsl.language.model import Building, EdgeRoute, Network, Route
from foresee_dsl.language.traversal import si_of

if TYPE_CHECKING:
    import networkx as nx
    from shapely.geometry.base import BaseGeometry

    from foresee_dsl.compile.roads.polyline import FloatArray

__all__ = ["NearLane", "Passage", "RoadNetwork", "RouteError", "RouteLine", "buildings_of"]

_SAME_WAY_RAD = math.radians(60)
"""A lane whose direction differs by more is not the one that a vehicle drives on (measured on CARLA's towns: with 60
degrees all 612 waypoints find their lane)."""
_HEADING_WEIGHT_M = 1.0
"""Inside junctions lanes overlap: a radian off in direction counts like a metre off sideways (ours)."""
_CLOSE_GAPS_M = 0.3
"""Slits up to twice this between lanes are road (ours: roundings and corners of maps, no median is so narrow)."""


@dataclass(frozen=True)
class NearLane:
    """Where a point is relative to a lane: length along it, distance sideways (left positive)."""

    lane: Lane
    pos_m: float
    lateral_m: float


@dataclass(frozen=True, eq=False, repr=False)
class RoadNetwork:
    """A road network; compared by identity, so that results can be kept per network."""

    lanes: Mapping[str, Lane]
    edges: Mapping[str, Edge]
    junctions: Mapping[str, Junction]
    movements: tuple[Movement, ...]
    crossings: Mapping[str, Crossing]
    walking_areas: Mapping[str, WalkingArea]
    footways: tuple[tuple[str, str], ...]
    buildings: tuple[Points, ...] = ()
    """Outlines of what hides things; the net file knows nothing of them."""

    @classmethod
    def from_net(cls, net_file: Path, buildings: tuple[Points, ...] = ()) -> RoadNetwork:
        """Read a SUMO network, and add the outlines of its buildings.

        Raises:
            CompileError: it cannot be read, or is no SUMO network.
        """
        return cls.of(read_net(net_file), buildings)

    @classmethod
    def of(cls, parts: NetParts, buildings: tuple[Points, ...] = ()) -> RoadNetwork:
        """Make one from what was read, and the outlines of its buildings."""
        return cls(
            lanes=parts.lanes,
            edges=parts.edges,
            junctions=parts.junctions,
            movements=parts.movements,
            crossings=parts.crossings,
            walking_areas=parts.walking_areas,
            footways=parts.footways,
            buildings=buildings,
        )

    def movements_from(self, edge: str, kind: LaneKind = "car") -> tuple[Movement, ...]:
        """Return the movements that leave an edge and are open to a kind."""
        return tuple(m for m in self._from_edge.get(edge, ()) if kind in m.kinds)

    def movements_into(self, lane: str, kind: LaneKind = "car") -> tuple[Movement, ...]:
        """Return the movements that end on a lane and are open to a kind."""
        return tuple(m for m in self._into_lane.get(lane, ()) if kind in m.kinds)

    def movements_through(self, lane: str) -> Sequence[Movement]:
        """Return the movements that a lane inside a junction is part of; none for other lanes."""
        return self._through_lane.get(lane, ())

    def movements_at(self, junction: str) -> tuple[Movement, ...]:
        """Return all movements through a junction."""
        return tuple(m for m in self.movements if m.junction == junction)

    def crossings_at(self, junction: str) -> tuple[Crossing, ...]:
        """Return the pedestrian crossings of a junction."""
        return tuple(c for c in self.crossings.values() if c.junction == junction)

    def graph(self, kind: LaneKind = "car") -> nx.DiGraph[str]:
        """Return the graph of edges open to a kind; the weight `length` is that of the edge that is entered."""
        if kind not in self._graphs:
            import networkx as nx  # here: it takes long to import, and few need it

            graph: nx.DiGraph[str] = nx.DiGraph()
            for edge in self.edges.values():
                if edge.for_kind(kind):
                    graph.add_node(edge.id)
            for m in self.movements:
                if kind in m.kinds:
                    graph.add_edge(m.from_edge, m.to_edge, length=self.lanes[m.to_lane].length_m)
            self._graphs[kind] = graph
        return self._graphs[kind]

    def route_edges(self, route: Route | EdgeRoute, kind: LaneKind = "car") -> tuple[str, ...]:
        """Return the edges of a route statement.

        A `Route` starts on a road in the direction of its first junction; its turns are looked up in the junctions'
        movements; junctions without a choice on the way need not be named. An `EdgeRoute` is checked, and filled
        with the shortest way where it says so.

        Raises:
            RouteError: an unknown name, a turn that is not possible, edges that do not touch.
        """
        return routing.route_edges(self, route, kind)

    def shortest_route(self, start: str, end: str, kind: LaneKind = "car") -> tuple[str, ...]:
        """Return the shortest way between two edges, both included.

        Raises:
            RouteError: an edge does not exist, or there is no way.
        """
        return routing.shortest_route(self, start, end, kind)

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
            edges: the route.
            start_lane: the lane of the first edge to begin on, or a lane inside the junction between the first two
                edges; the line then goes through it.
            after_m: no lane change on the first edge begins before this length along it.
            behind_m: add this much of the way to the first edge. beyond_m: add at least this much after the last
                edge, straight on where possible; both as far as the network goes.
            kind: whose lanes to use.

        Raises:
            RouteError: no lane of an edge leads to the next for this kind.
        """
        return route_line.build_line(
            self, edges, start_lane=start_lane, after_m=after_m, behind_m=behind_m, beyond_m=beyond_m, kind=kind
        )

    def nearest_lane(
        self,
        x: float,
        y: float,
        heading_rad: float | None = None,
        kind: LaneKind = "car",
        within_m: float = 10.0,
    ) -> NearLane | None:
        """Return the lane (inside junctions too) nearest to a point, or None.

        Args:
            x, y: m.
            heading_rad: only lanes within 60 degrees of it, and of several the one that points the same way.
            kind: whose lanes.
            within_m: no farther away than this.
        """
        best: tuple[float, NearLane] | None = None
        for _, lane in self._index(kind).within(x, y, within_m):
            s, lateral = lane.line.project(x, y)
            within = min(max(s, 0.0), lane.line.length_m)
            cost = math.hypot(s - within, lateral)
            if heading_rad is not None:
                off = abs(wrap(lane.line.at(within)[2] - heading_rad))
                if off > _SAME_WAY_RAD:
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
        return next((point for point in points if not self._all_lanes.any_within(*point, beyond_m)), None)

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
        """Return x, y, heading of a place along an edge.

        Args:
            edge: its id.
            at_m: m from its beginning, negative from its end, along the rightmost car lane.
            offset_m: sideways from that lane's centre, left positive.

        Raises:
            RouteError: no such edge, or it is shorter than that.
        """
        routing.check_edge(self, edge)
        line = self.edges[edge].drivable[0].line
        if abs(at_m) > line.length_m + 1e-6:
            message = f"{edge} is only {line.length_m:.1f} m long, there is no {at_m:g} m along it"
            raise RouteError(message, f"use at most {math.floor(line.length_m)} m")
        return line.at(at_m if at_m >= 0 else line.length_m + at_m, offset_m)

    @cached_property
    def drivable(self) -> BaseGeometry:
        """Where vehicles may be: car lanes with their width, and junctions without their walking areas.

        Crossings and parking strips count as road. Prepared for point tests.
        """
        import shapely  # here: it takes long to import, and placing actors does without

        walking = shapely.union_all([_polygon(area.polygon) for area in self.walking_areas.values()])
        junctions = shapely.union_all([_polygon(j.polygon) for j in self.junctions.values()])
        lanes = [lane for lane in self.lanes.values() if "car" in lane.kinds or lane.parking]
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
    def _from_edge(self) -> dict[str, list[Movement]]:
        found: dict[str, list[Movement]] = {}
        for m in self.movements:
            found.setdefault(m.from_edge, []).append(m)
        return found

    @cached_property
    def _into_lane(self) -> dict[str, list[Movement]]:
        found: dict[str, list[Movement]] = {}
        for m in self.movements:
            found.setdefault(m.to_lane, []).append(m)
        return found

    @cached_property
    def _through_lane(self) -> dict[str, list[Movement]]:
        found: dict[str, list[Movement]] = {}
        for m in self.movements:
            for via in m.via:
                found.setdefault(via, []).append(m)
        return found

    @cached_property
    def _graphs(self) -> dict[LaneKind, nx.DiGraph[str]]:
        return {}

    @cached_property
    def _indices(self) -> dict[LaneKind, LaneIndex]:
        return {}

    @cached_property
    def _all_lanes(self) -> LaneIndex:
        return LaneIndex(self.lanes.values())

    def _index(self, kind: LaneKind) -> LaneIndex:
        """Lanes of a kind by place; walking areas have an outline, no centreline, and are left out."""
        if kind not in self._indices:
            lanes = (ln for ln in self.lanes.values() if kind in ln.kinds and ln.edge not in self.walking_areas)
            self._indices[kind] = LaneIndex(lanes)
        return self._indices[kind]


def buildings_of(network: Network | Path) -> tuple[Points, ...]:
    """Return the outlines of the buildings of a network written in the language; an imported one has none."""
    if isinstance(network, Path):
        return ()
    outlines = (item.outline for item in network.body if isinstance(item, Building))
    return tuple(tuple((si_of(point.x), si_of(point.y)) for point in outline) for outline in outlines)


def _polygon(points: Points) -> BaseGeometry:
    """A polygon from an open outline; SUMO's can touch themselves or be flat."""
    import shapely

    if len(points) < 3:
        return shapely.Polygon()
    shape = shapely.make_valid(shapely.Polygon(points))
    return shape if shape.area > 0 else shapely.Polygon()
