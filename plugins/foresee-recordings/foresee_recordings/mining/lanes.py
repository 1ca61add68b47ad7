"""Facts about recorded actors on a map: the lanes that they are in, and the junctions; as `simulate.triggers.ways`."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.topology import Lane, LaneKind
from foresee_dsl.kernels.boxes import corners
from foresee_dsl.simulate.results.metrics import outlines_of
from foresee_dsl.simulate.triggers.ways import strip_of
from foresee_recordings.maps.matching import route_of
from foresee_recordings.mining.roads import network_of
from foresee_recordings.mining.rows import Rows
from foresee_recordings.mining.traffic import HEADING, IntArray, Traffic, X, Y
from foresee_recordings.recording import FloatArray, RecordedMap, RecordingError

_NOT_LOOKED_UP, _OFF_THE_LANES = -2, -1


class MapFacts:
    """The lanes and junctions of a recording's actors; each is computed when a condition first needs it."""

    def __init__(self, traffic: Traffic, roads: RecordedMap) -> None:
        """Begin without any; `roads`: the recording's map."""
        self._traffic, self._offset = traffic, roads.offset
        self.network: RoadNetwork = network_of(roads)
        self._lanes: list[Lane] = list(self.network.lanes.values())
        self._number = {lane.id: k for k, lane in enumerate(self._lanes)}
        self._lane_of_row: IntArray = np.full(len(traffic.states), _NOT_LOOKED_UP, dtype=np.int64)
        self._strip = lru_cache(maxsize=1024)(self._make_strip)
        self._route = lru_cache(maxsize=1024)(self._make_route)

    def same_lane(self, rows: Rows, name: str, other: str) -> FloatArray:
        """Return how far an actor's centre is inside the lane of another, or one that continues it, [R] m; the same
        with both exchanged counts too. NaN if the other is off the lanes."""
        inside, reverse = self._inside(rows, name, other), self._inside(rows, other, name)
        return np.where(np.isnan(inside), np.nan, np.where(reverse >= 0, np.fmax(inside, reverse), inside))

    def in_lane(self, rows: Rows, name: str, number: int, road: str | None) -> FloatArray:
        """Return how far an actor's centre is inside a lane of an edge, [R] m; NaN off the lanes, or without such a
        lane."""
        inside, lanes = np.full(len(rows), np.nan), self._lanes_at(rows, name)
        edges = [road] * len(rows) if road is not None else [self._edge(k) for k in lanes.tolist()]
        points = self._points(rows, name)
        for edge in {edge for edge in edges if edge}:
            at = np.array([other == edge for other in edges])
            for piece in self.network.pieces(edge):
                drivable = self.network.edges[piece].drivable
                if number <= len(drivable):
                    lane = drivable[number - 1]
                    depth = lane.width_m / 2 - shapely.distance(points[at], shapely.LineString(lane.shape))
                    inside[at] = np.fmax(inside[at], depth)
        return inside

    def in_junction(self, rows: Rows, name: str, junction: str | None) -> NDArray[np.bool_]:
        """Return whether a part of an actor's footprint is inside a junction (None: inside any), [R].

        Raises:
            RecordingError: the map has no such junction.
        """
        if junction is not None and not self.network.is_junction(junction):
            raise RecordingError(f"the map has no junction {junction!r}")
        names = [junction] if junction is not None else sorted({*self.network.junctions} - self.network.joints)
        areas = [area for each in names if not (area := outlines_of(self.network).of(each).area).is_empty]
        boxes = self._traffic.boxes(rows.states[name])
        boxes[:, :2] += self._offset
        footprints = np.asarray(shapely.polygons(corners(boxes)), dtype=np.object_)
        return np.asarray(shapely.intersects(footprints, shapely.union_all(areas)), dtype=np.bool_)

    def _inside(self, rows: Rows, name: str, of: str) -> FloatArray:
        """Return how far an actor's centre is inside the lane of another, or one that continues it, [R] m."""
        inside, lanes, points = np.full(len(rows), np.nan), self._lanes_at(rows, of), self._points(rows, name)
        for lane, actor in {*zip(lanes.tolist(), rows.actors[of].tolist(), strict=True)}:
            if lane >= 0:
                at = (lanes == lane) & (rows.actors[of] == actor)
                inside[at] = self._lanes[lane].width_m / 2 - shapely.distance(points[at], self._strip(lane, actor))
        return inside

    def _points(self, rows: Rows, name: str) -> NDArray[np.object_]:
        points: NDArray[np.object_] = shapely.points(
            self._traffic.states[rows.states[name]][:, [X, Y]] + np.array(self._offset)
        )
        return points

    def _edge(self, lane: int) -> str:
        return "" if lane < 0 or self._lanes[lane].internal else self._lanes[lane].edge

    def _lanes_at(self, rows: Rows, name: str) -> IntArray:
        """Return the number of the lane that an actor's centre is in, [R]; negative off the lanes."""
        states = rows.states[name]
        for row in np.unique(states[self._lane_of_row[states] == _NOT_LOOKED_UP]).tolist():
            actor = int(np.searchsorted(self._traffic.start, row, side="right")) - 1
            self._lane_of_row[row] = self._look_up(row, self._traffic.tracks[actor].kind)
        lanes: IntArray = self._lane_of_row[states]
        return lanes

    def _look_up(self, row: int, kind: str) -> int:
        x, y, heading = (float(self._traffic.states[row, column]) for column in (X, Y, HEADING))
        x, y = x + self._offset[0], y + self._offset[1]
        wheels = kind not in ("pedestrian", "obstacle")
        for direction in (heading, None) if wheels else (None,):
            near = self.network.nearest_lane(x, y, direction, _lane_kind(kind))
            if near is not None:
                line = shapely.LineString(near.lane.shape)
                if shapely.distance(shapely.Point(x, y), line) <= near.lane.width_m / 2:
                    return self._number[near.lane.id]
        return _OFF_THE_LANES

    def _make_route(self, actor: int) -> tuple[str, ...]:
        return route_of(self._traffic.tracks[actor], self.network, self._offset)

    def _make_strip(self, number: int, actor: int) -> shapely.LineString:
        """Return the centreline of a lane and of the lanes that continue it along the actor's route."""
        kind = _lane_kind(self._traffic.tracks[actor].kind)
        return shapely.LineString(strip_of(self.network, self._lanes[number].id, self._route(actor), kind))


def _lane_kind(kind: str) -> LaneKind:
    """Return the kind of lanes that a class uses; people count for the lanes of cars, as in `simulate.triggers`."""
    match kind:
        case "bicycle" | "bus":
            return kind
        case _:
            return "car"


@lru_cache(maxsize=2)
def map_facts(traffic: Traffic) -> MapFacts | None:
    """Return the facts of a recording on its map; None without a map."""
    roads = traffic.recording.roads
    return None if roads is None else MapFacts(traffic, roads)
