"""The road map as nuPlan's `AbstractMap`, for planners.

Ids are numbers as texts, as in nuPlan's maps. What the map does not hold raises `MapLacksError`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, NoReturn

import numpy as np
import shapely
from nuplan.common.actor_state.state_representation import Point2D, StateSE2
from nuplan.common.maps.abstract_map import AbstractMap
from nuplan.common.maps.abstract_map_objects import (
    Intersection,
    Lane,
    LaneConnector,
    PolygonMapObject,
    PolylineMapObject,
    RoadBlockGraphEdgeMapObject,
    StopLine,
)
from nuplan.common.maps.maps_datatypes import IntersectionType, LaneConnectorType, SemanticMapLayer, StopLineType
from shapely.geometry import LineString, Point, Polygon

from foresee_bridges.nuplan.roads import Roadblock, Roads, lane_area, sampled, stop_line_area
from foresee_dsl.drivers.protocol import FloatArray
from foresee_dsl.drivers.road_map import StopLine as RoadStopLine
from foresee_dsl.errors import DriverError

_TURNS = {
    "straight": LaneConnectorType.STRAIGHT,
    "left": LaneConnectorType.LEFT,
    "right": LaneConnectorType.RIGHT,
    "back": LaneConnectorType.UTURN,
}
_LAYERS = (
    *(SemanticMapLayer.LANE, SemanticMapLayer.LANE_CONNECTOR),
    *(SemanticMapLayer.ROADBLOCK, SemanticMapLayer.ROADBLOCK_CONNECTOR),
    *(SemanticMapLayer.INTERSECTION, SemanticMapLayer.STOP_LINE, SemanticMapLayer.CROSSWALK),
    *(SemanticMapLayer.WALKWAYS, SemanticMapLayer.CARPARK_AREA),
)


class MapLacksError(DriverError):
    """A planner asked the map for something that it does not hold."""


class Polyline(PolylineMapObject):
    """A baseline path or a border."""

    def __init__(self, polyline_id: str, points: FloatArray) -> None:
        super().__init__(polyline_id)
        self._points = sampled(points)

    @cached_property
    def linestring(self) -> LineString:
        """The line."""
        return LineString(self._points[:, :2])

    @property
    def length(self) -> float:
        """Length, m."""
        return float(self.linestring.length)

    @cached_property
    def discrete_path(self) -> list[StateSE2]:
        """Poses along the line."""
        return [StateSE2(x, y, heading) for x, y, heading in self._points.tolist()]

    def get_nearest_arc_length_from_position(self, point: Point2D) -> float:
        """Return the length along the line of the place nearest to the point."""
        return float(self.linestring.project(Point(point.x, point.y)))

    def get_nearest_pose_from_position(self, point: Point2D) -> StateSE2:
        """Return the pose on the line nearest to the point."""
        at = self.get_nearest_arc_length_from_position(point)
        place = self.linestring.interpolate(at)
        return StateSE2(place.x, place.y, self._heading(at))

    def get_curvature_at_arc_length(self, arc_length: float) -> float:
        """Return the curvature, 1/m, left positive: the change of heading over 2 m."""
        before, after = max(arc_length - 1.0, 0.0), min(arc_length + 1.0, self.length)
        turn = math.remainder(self._heading(after) - self._heading(before), 2 * math.pi)
        return turn / max(after - before, 1e-6)

    def _heading(self, arc_length: float) -> float:
        steps = np.diff(self._points[:, :2], axis=0)
        ends = np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))
        return float(self._points[min(int(np.searchsorted(ends, arc_length)), len(steps) - 1), 2])


class LaneEdge:
    """What lanes and lane connectors have in common."""

    def __init__(self, roads: RoadsMap, name: str) -> None:
        self.id = roads.roads.lane_ids[name]
        self.name, self._roads, self._lane = name, roads, roads.roads.lanes[name]

    @cached_property
    def polygon(self) -> Polygon:
        """Area."""
        return lane_area(self._lane)

    @cached_property
    def baseline_path(self) -> Polyline:
        """Centreline."""
        return Polyline(self.id, self._lane.centre)

    @cached_property
    def left_boundary(self) -> Polyline:
        """Left border; neighbours share the id of their border."""
        return Polyline(f"{self.id}_left", self._lane.left)

    @cached_property
    def right_boundary(self) -> Polyline:
        """Right border; it has the id of the right neighbour's left border."""
        right = self._roads.roads.lane_ids.get(self._lane.right_neighbour or "")
        return Polyline(f"{right}_left" if right else f"{self.id}_right", self._lane.right)

    @property
    def speed_limit_mps(self) -> float | None:
        """Speed limit, m/s."""
        return self._lane.speed_limit_mps

    @property
    def incoming_edges(self) -> list[Any]:
        """Lanes and connectors before this one."""
        return self._roads.edges(self._lane.predecessors)

    @property
    def outgoing_edges(self) -> list[Any]:
        """Lanes and connectors after this one."""
        return self._roads.edges(self._lane.successors)

    @property
    def parallel_edges(self) -> list[Any]:
        """Lanes of the same roadblock, this one included."""
        return self.parent.interior_edges

    @property
    def adjacent_edges(self) -> tuple[Any, Any]:
        """The neighbours to the left and to the right; None without one."""
        left, right = (self._roads.edges((name or "",)) for name in self._neighbours)
        return (left[0] if left else None), (right[0] if right else None)

    @property
    def parent(self) -> RoadBlock:
        """The roadblock."""
        return self._roads.roadblock(self.get_roadblock_id())

    @property
    def _neighbours(self) -> tuple[str | None, str | None]:
        return self._lane.left_neighbour, self._lane.right_neighbour

    def get_roadblock_id(self) -> str:
        """Return the id of the roadblock."""
        return self._roads.roads.roadblock_of[self.name]

    def has_traffic_lights(self) -> bool:
        """Return whether a signal controls it."""
        return self._lane.signal is not None

    @property
    def stop_lines(self) -> list[Any]:
        """The stop lines at the ends of the lanes before it, if it is a connector."""
        return self._roads.stop_lines(self._lane.predecessors) if self._lane.junction is not None else []

    def is_left_of(self, other: Any) -> bool:
        """Return whether it is to the left of another lane of its roadblock."""
        if self.get_roadblock_id() != other.get_roadblock_id():
            raise AssertionError("the lanes are not in one roadblock")  # as nuPlan's interface says
        return self.index() < int(other.index())

    def is_right_of(self, other: Any) -> bool:
        """Return whether it is to the right of another lane of its roadblock."""
        return bool(other.is_left_of(self))

    def index(self) -> int:
        """Return its position in the roadblock, 1 for the leftmost."""
        return self._roads.roads.roadblocks[self.get_roadblock_id()].lanes.index(self.name) + 1

    def get_width_left_right(self, point: Point2D, include_outside: bool = False) -> tuple[float, float]:
        """Return the distances from a point to the left and to the right border, m."""
        place = Point(point.x, point.y)
        if not include_outside and not self.polygon.buffer(1e-3).contains(place):
            return math.nan, math.nan
        return float(self.left_boundary.linestring.distance(place)), float(
            self.right_boundary.linestring.distance(place)
        )

    def oriented_distance(self, point: Point2D) -> float:
        """Return the distance of a point from the area, m, positive to the left of the centreline."""
        pose = self.baseline_path.get_nearest_pose_from_position(point)
        left = (point.y - pose.y) * math.cos(pose.heading) - (point.x - pose.x) * math.sin(pose.heading)
        return math.copysign(float(self.polygon.distance(Point(point.x, point.y))), left)


class RoadLane(LaneEdge, Lane):
    """A lane outside junctions."""


class RoadLaneConnector(LaneEdge, LaneConnector):
    """A lane inside a junction."""

    @property
    def turn_type(self) -> LaneConnectorType:
        """The turn."""
        return _TURNS.get(self._lane.turn or "", LaneConnectorType.UNKNOWN)


class RoadBlock(RoadBlockGraphEdgeMapObject):
    """A roadblock or a roadblock connector."""

    def __init__(self, roads: RoadsMap, block: Roadblock) -> None:
        super().__init__(block.id)
        self._roads, self._block = roads, block

    @cached_property
    def polygon(self) -> Polygon:
        """Area of all its lanes."""
        return self._roads.roads.area(self._block.lanes)

    @property
    def interior_edges(self) -> list[Any]:
        """Its lanes, from left to right."""
        return self._roads.edges(self._block.lanes)

    @property
    def incoming_edges(self) -> list[Any]:
        """Roadblocks before this one."""
        return self._beside([name for lane in self._lanes() for name in lane.predecessors])

    @property
    def outgoing_edges(self) -> list[Any]:
        """Roadblocks after this one."""
        return self._beside([name for lane in self._lanes() for name in lane.successors])

    @property
    def parallel_edges(self) -> list[Any]:
        """This roadblock: the map holds no others beside it."""
        return [self]

    @property
    def children_stop_lines(self) -> list[Any]:
        """Stop lines at the ends of its lanes."""
        return self._roads.stop_lines(self._block.lanes)

    @property
    def intersection(self) -> Any:
        """The junction in which a connector lies; None for a roadblock."""
        return self._roads.junction(self._block.junction) if self._block.junction is not None else None

    def _lanes(self) -> list[Any]:
        return [self._roads.roads.lanes[name] for name in self._block.lanes]

    def _beside(self, names: Sequence[str]) -> list[Any]:
        of = self._roads.roads.roadblock_of
        return [self._roads.roadblock(number) for number in dict.fromkeys(of[name] for name in names if name in of)]


class Area(PolygonMapObject):
    """A crossing or a walkway."""

    def __init__(self, area_id: str, polygon: Polygon) -> None:
        super().__init__(area_id)
        self._polygon = polygon

    @property
    def polygon(self) -> Polygon:
        """Area."""
        return self._polygon


class RoadJunction(Intersection):
    """A junction."""

    def __init__(self, roads: RoadsMap, junction_id: str, name: str) -> None:
        self._roads, self.name = roads, name
        kind = IntersectionType.TRAFFIC_LIGHT if self.is_signaled else IntersectionType.DEFAULT
        super().__init__(junction_id, kind)

    @cached_property
    def polygon(self) -> Polygon:
        """Area."""
        return Polygon(self._roads.roads.road_map.junctions[self.name]).buffer(0)

    @property
    def interior_edges(self) -> list[Any]:
        """Its roadblock connectors."""
        blocks = self._roads.roads.roadblocks.values()
        return [self._roads.roadblock(block.id) for block in blocks if block.junction == self.name]

    @property
    def incoming_edges(self) -> list[Any]:
        """The lanes that lead into it."""
        lanes = self._roads.roads.lanes
        before = [name for lane in lanes.values() if lane.junction == self.name for name in lane.predecessors]
        return self._roads.edges([name for name in dict.fromkeys(before) if lanes[name].junction is None])

    @property
    def is_signaled(self) -> bool:
        """Whether a signal controls any movement."""
        lanes = self._roads.roads.lanes.values()
        return any(lane.signal is not None for lane in lanes if lane.junction == self.name)


class RoadStop(StopLine):
    """A stop line."""

    def __init__(self, roads: RoadsMap, line_id: str, line: RoadStopLine) -> None:
        super().__init__(line_id, StopLineType.UNKNOWN if line.signal is None else StopLineType.TRAFFIC_LIGHT)
        self._roads, self._line = roads, line

    @cached_property
    def polygon(self) -> Polygon:
        """Area."""
        return stop_line_area(self._line.points)

    @property
    def intersection_from(self) -> Any:
        """The junction behind it."""
        return next(edge.parent.intersection for edge in self._roads.edges((self._line.lane,))[0].outgoing_edges)

    @property
    def layer_type(self) -> StopLineType:
        """Its kind."""
        return self.stop_line_type

    @property
    def parent(self) -> Any:
        """The roadblock before it."""
        return self._roads.edges((self._line.lane,))[0].parent


class RoadsMap(AbstractMap):
    """nuPlan's map interface over a road map."""

    def __init__(self, roads: Roads) -> None:
        self.roads = roads
        self._edges: dict[str, RoadLane | RoadLaneConnector] = {
            name: (RoadLane if lane.junction is None else RoadLaneConnector)(self, name)
            for name, lane in roads.lanes.items()
        }
        self._roadblocks = {number: RoadBlock(self, block) for number, block in roads.roadblocks.items()}
        last = len(roads.lanes) + len(roads.roadblocks)
        self._junctions = {name: RoadJunction(self, str(last := last + 1), name) for name in roads.road_map.junctions}
        self._stop_lines = {
            line.lane: RoadStop(self, str(last := last + 1), line) for line in roads.road_map.stop_lines
        }
        crossings = [
            Area(str(last := last + 1), Polygon(crossing.outline).buffer(0)) for crossing in roads.road_map.crossings
        ]
        walkways = [
            Area(str(last := last + 1), lane_area(lane))
            for lane in roads.road_map.lanes.values()
            if lane.users == {"pedestrian"}
        ]
        parts: dict[SemanticMapLayer, list[Any]] = {layer: [] for layer in _LAYERS}
        for edge in self._edges.values():
            kind = SemanticMapLayer.LANE if isinstance(edge, RoadLane) else SemanticMapLayer.LANE_CONNECTOR
            parts[kind].append(edge)
        for block in self._roadblocks.values():
            connector = roads.roadblocks[block.id].junction is not None
            parts[SemanticMapLayer.ROADBLOCK_CONNECTOR if connector else SemanticMapLayer.ROADBLOCK].append(block)
        parts[SemanticMapLayer.INTERSECTION] = list(self._junctions.values())
        parts[SemanticMapLayer.STOP_LINE] = list(self._stop_lines.values())
        parts[SemanticMapLayer.CROSSWALK], parts[SemanticMapLayer.WALKWAYS] = crossings, walkways
        self._layers: Mapping[SemanticMapLayer, dict[str, Any]] = {
            layer: {part.id: part for part in objects} for layer, objects in parts.items()
        }
        self._trees: dict[SemanticMapLayer, shapely.STRtree] = {}

    def edges(self, names: Sequence[str]) -> list[Any]:
        """Return the lanes and connectors of these names, without those that are closed to cars."""
        return [self._edges[name] for name in names if name in self._edges]

    def roadblock(self, number: str) -> RoadBlock:
        """Return the roadblock or roadblock connector of an id."""
        return self._roadblocks[number]

    def junction(self, name: str) -> RoadJunction | None:
        """Return the junction of a name."""
        return self._junctions.get(name)

    def stop_lines(self, names: Sequence[str]) -> list[Any]:
        """Return the stop lines at the ends of these lanes."""
        return [self._stop_lines[name] for name in names if name in self._stop_lines]

    @property
    def map_name(self) -> str:
        """A name."""
        return "foresee"

    def get_available_map_objects(self) -> list[SemanticMapLayer]:
        """Return the layers that the map holds."""
        return list(self._layers)

    def get_available_raster_layers(self) -> list[SemanticMapLayer]:
        """Return no layer: the map holds no rasters."""
        return []

    def get_all_map_objects(self, point: Point2D, layer: SemanticMapLayer) -> list[Any]:
        """Return the objects of a layer that contain a point."""
        return self._near(Point(point.x, point.y), layer)

    def get_one_map_object(self, point: Point2D, layer: SemanticMapLayer) -> Any:
        """Return the object of a layer that contains a point; None without one."""
        objects = self.get_all_map_objects(point, layer)
        if len(objects) > 1:  # as nuPlan's interface says
            raise AssertionError(f"{len(objects)} objects of {layer.name} contain the point; expected one")
        return objects[0] if objects else None

    def is_in_layer(self, point: Point2D, layer: SemanticMapLayer) -> bool:
        """Return whether an object of a layer contains a point; the drivable area consists of the roadblocks."""
        if layer == SemanticMapLayer.DRIVABLE_AREA:
            drivable = (SemanticMapLayer.ROADBLOCK, SemanticMapLayer.ROADBLOCK_CONNECTOR)
            return any(self.get_all_map_objects(point, kind) for kind in drivable)
        return bool(self.get_all_map_objects(point, layer))

    def get_proximal_map_objects(
        self, point: Point2D, radius: float, layers: list[SemanticMapLayer]
    ) -> dict[SemanticMapLayer, list[Any]]:
        """Return the objects of each layer that are at most `radius` m from a point."""
        circle = Point(point.x, point.y).buffer(radius)
        return {layer: self._near(circle, layer) for layer in layers}

    def get_map_object(self, object_id: str, layer: SemanticMapLayer) -> Any:
        """Return the object of an id; None without one."""
        return self._layer(layer).get(str(object_id))

    def get_distance_to_nearest_map_object(
        self, point: Point2D, layer: SemanticMapLayer
    ) -> tuple[str | None, float | None]:
        """Return id and distance, m, of the nearest object of a layer; None and None without one."""
        objects = list(self._layer(layer).values())
        if not objects:
            return None, None
        place = Point(point.x, point.y)
        nearest = objects[int(self._tree(layer).nearest(place))]
        return nearest.id, float(nearest.polygon.distance(place))

    def get_distances_matrix_to_nearest_map_object(self, points: list[Point2D], layer: SemanticMapLayer) -> Any:
        """Return the distance of each point to the nearest object of a layer, [N] m; None without one."""
        distances = [self.get_distance_to_nearest_map_object(point, layer)[1] for point in points]
        return None if None in distances else np.array(distances, dtype=np.float64)

    def get_raster_map_layer(self, layer: SemanticMapLayer) -> NoReturn:
        """Raise: the map holds no rasters."""
        _lacks(f"a raster of {layer.name}")

    def get_raster_map(self, layers: list[SemanticMapLayer]) -> NoReturn:
        """Raise: the map holds no rasters."""
        _lacks("rasters")

    def get_distance_to_nearest_raster_layer(self, point: Point2D, layer: SemanticMapLayer) -> NoReturn:
        """Raise: the map holds no rasters."""
        _lacks(f"a raster of {layer.name}")

    def initialize_all_layers(self) -> None:
        """Prepare all layers for queries."""
        for layer in self._layers:
            self._tree(layer)

    def _get_roadblock(self, roadblock_id: str) -> Any:
        """Return a roadblock: planners call this method of nuPlan's own class, which its interface lacks."""
        return self.get_map_object(roadblock_id, SemanticMapLayer.ROADBLOCK)

    def _get_roadblock_connector(self, roadblock_connector_id: str) -> Any:
        """Return a roadblock connector, as above."""
        return self.get_map_object(roadblock_connector_id, SemanticMapLayer.ROADBLOCK_CONNECTOR)

    def _layer(self, layer: SemanticMapLayer) -> dict[str, Any]:
        if layer not in self._layers:
            _lacks(layer.name)
        return self._layers[layer]

    def _tree(self, layer: SemanticMapLayer) -> shapely.STRtree:
        if layer not in self._trees:
            self._trees[layer] = shapely.STRtree([part.polygon for part in self._layer(layer).values()])
        return self._trees[layer]

    def _near(self, shape: Any, layer: SemanticMapLayer) -> list[Any]:
        objects = list(self._layer(layer).values())
        return [objects[i] for i in sorted(self._tree(layer).query(shape, predicate="intersects"))]


def _lacks(what: str) -> NoReturn:
    held = ", ".join(layer.name for layer in _LAYERS)
    raise MapLacksError(f"the planner asks the map for {what}, which it does not hold; it holds {held}")
