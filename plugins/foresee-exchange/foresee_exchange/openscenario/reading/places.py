"""Positions of OpenSCENARIO as points of the map, and the places of entities at the beginning."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from typing import TypeVar
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.language import model as m
from foresee_exchange.naming import number, quantity
from foresee_exchange.openscenario.losses import NotExpressed, SourceError
from foresee_exchange.openscenario.reading.roads import RoadPlace, Roads

_Found = TypeVar("_Found")


@dataclass(frozen=True)
class ByMover:
    """A place that moves with an entity: its distance ahead of the entity's reference point along the entity's way, and
    to the left, m."""

    entity: str
    ahead_m: float
    left_m: float


@dataclass
class Places:
    """Evaluates positions.

    Attributes:
        roads: the map; None if the network is not an OpenDRIVE map.
        inits: the `<Position>` elements of entities at the beginning, by their names.
        referred: returns the child element of a kind, or the one in a catalogue that it refers to.
        along: returns the direction of the road at a point, rad, or None off the roads.
        mirrored: coordinates are left-handed, as in CARLA. minor: second number of the standard's version.
        earlier: places that entities had before their last place, which may be relative to an earlier one.
        moving: entities that may leave their first place.
        line_of: returns the poses along a `<Trajectory>`.
    """

    roads: Roads | None
    inits: Mapping[str, Element]
    referred: Callable[[Element | None, str], Element | None] = lambda holder, tag: (
        None if holder is None else holder.find(tag)
    )
    along: Callable[[float, float], float | None] = lambda x, y: None  # noqa: ARG005 - a default without lanes
    mirrored: bool = False
    minor: int = 2
    earlier: Mapping[str, Sequence[Element]] = field(default_factory=dict)
    moving: Set[str] = frozenset()
    line_of: Callable[[Element, Places], Sequence[Pose]] = lambda trajectory, places: ()  # noqa: ARG005 - a default without trajectories
    _working: list[str] = field(default_factory=list)

    def initial(self, entity: str) -> Pose:
        """Return the pose of an entity's reference point at the beginning; `NotExpressed` if it is unknown."""
        return self._of_entity(entity, self.pose)

    def pose(self, position: Element) -> Pose:
        """Return the pose of a `<Position>` (or `<TargetPosition>` and similar); errors as in `initial`."""
        kind = next(iter(position), None)
        if kind is None:
            raise NotExpressed("empty positions")
        if kind.tag == "WorldPosition":
            return self._world(kind)
        if kind.tag in ("RelativeWorldPosition", "RelativeObjectPosition"):
            return self._beside(kind)
        if kind.tag == "RoadPosition":
            where = self._roads(kind).on_reference(kind.get("roadId", ""), number(kind, "s"), self._left(kind, "t"))
            return self._turned(where, kind)
        if kind.tag == "RelativeRoadPosition":
            base = self._road_place_of(kind.get("entityRef", ""))
            moved, _ = self._roads(kind).moved(base, number(kind, "ds"))
            where = self._roads(kind).on_reference(moved.road, moved.s, base.t + self._left(kind, "dt"))
            return self._turned(where, kind)
        if kind.tag == "TrajectoryPosition":
            return self._turned(self._along_trajectory(kind), kind)
        return self._on_lane(kind, self.road_place(position))

    def by_mover(self, position: Element) -> ByMover | None:
        """Return where a position is relative to an entity that may have moved before the position is used; None for a
        fixed position.

        Raises:
            NotExpressed: the position does not turn with the entity.
        """
        kind = next(iter(position), None)
        ref = kind.get("entityRef", "") if kind is not None else ""
        if kind is None or ref not in self.moving or kind.tag not in (*_RELATIVE, "RelativeLanePosition"):
            return None
        if kind.tag in ("RelativeWorldPosition", "RelativeObjectPosition"):
            ahead_m, left_m = number(kind, "dx"), self._left(kind, "dy")
            if kind.tag == "RelativeWorldPosition" and (ahead_m or left_m):
                raise NotExpressed("positions: RelativeWorldPosition (of an entity that moves)")
            return ByMover(ref, ahead_m, left_m)
        base = self._road_place_of(ref)
        roads = self._roads(kind)
        road_rad = roads.on_reference(base.road, roads.within(base.road, base.s), 0.0).heading_rad
        onward = 1 if math.cos(self.initial(ref).heading_rad - road_rad) >= 0 else -1
        if kind.tag == "RelativeRoadPosition":
            return ByMover(ref, onward * number(kind, "ds"), onward * self._left(kind, "dt"))
        along, lanes, offset = number(kind, "ds", 0.0), round(number(kind, "dLane")), self._left(kind, "offset")
        if kind.get("ds") is None and kind.get("dsLane") is not None:
            side = 1 if roads.forward(base.road, base.lane) else -1
            along, lanes, offset = side * number(kind, "dsLane"), side * lanes, side * offset
        beside = self._with_t(roads, RoadPlace(base.road, base.s, lane_beside(base.lane, lanes), offset))
        return ByMover(ref, onward * along, onward * (beside.t - base.t))

    def stay(self, element: Element) -> None:
        """Raise `NotExpressed` if a position in an element depends on an entity that may have moved."""
        for position in positions_of(element):
            self.later(position)

    def later(self, position: Element) -> Pose:
        """Return the pose of a position that is used during the run; `NotExpressed` if it depends on an entity that may
        have moved."""
        if self.by_mover(position) is not None:
            raise NotExpressed("places relative to an entity that has moved by then")
        return self.pose(position)

    def road_place(self, position: Element) -> RoadPlace:
        """Return where on the roads a position is; errors as in `initial`."""
        kind = next(iter(position), None)
        if kind is None:
            raise NotExpressed("empty positions")
        if kind.tag == "LanePosition":
            lane, offset = round(number(kind, "laneId")), self._left(kind, "offset")
            return self._with_t(self._roads(kind), RoadPlace(kind.get("roadId", ""), number(kind, "s"), lane, offset))
        if kind.tag == "RelativeLanePosition":
            return self._further_on(kind)
        if kind.tag == "RoutePosition":
            return self._along_route(kind)
        if kind.tag not in ("WorldPosition", "RoadPosition", "TrajectoryPosition", *_RELATIVE):
            raise NotExpressed(f"positions: {kind.tag}")
        place = self._roads(kind).locate(self.pose(position))
        if place is None:
            raise NotExpressed("positions off the roads where one on a road is asked for")
        return place

    def lane_of(self, entity: str) -> RoadPlace | None:
        """Return where on the roads an entity is at the beginning, or None if that is unknown."""
        try:
            return self._road_place_of(entity)
        except (NotExpressed, SourceError):
            return None

    def _of_entity(self, entity: str, evaluate: Callable[[Element], _Found]) -> _Found:
        if entity not in self.inits:
            raise NotExpressed("entities without a place at the beginning")
        again = self._working.count(entity)
        places = [*self.earlier.get(entity, ()), self.inits[entity]]
        if again >= len(places):
            raise NotExpressed("positions that depend on each other")
        self._working.append(entity)
        try:
            return evaluate(places[-1 - again])
        finally:
            self._working.pop()

    def _road_place_of(self, entity: str) -> RoadPlace:
        return self._of_entity(entity, self.road_place)

    def _roads(self, kind: Element) -> Roads:
        if self.roads is None:
            raise NotExpressed(f"positions: {kind.tag} (the network is not an OpenDRIVE map)")
        return self.roads

    def _left(self, kind: Element, name: str) -> float:
        """Return an attribute as a length (or angle) to the left; in left-handed files it counts to the right."""
        value = number(kind, name, 0.0 if "offset" in name.lower() else None)
        return -value if self.mirrored else value

    def _world(self, kind: Element) -> Pose:
        """Return a world position; without a heading it faces in the road's direction."""
        x, y = number(kind, "x"), self._left(kind, "y")
        if kind.get("h") is not None:
            return Pose(x, y, self._left(kind, "h"))
        return Pose(x, y, self.along(x, y) or 0.0)

    def _on_lane(self, kind: Element, place: RoadPlace) -> Pose:
        """Return a place on a lane; orientations are relative to the direction of the lane's traffic.

        The orientation of a place that lies `ds` m along the road from another is relative to the road, as in esmini.
        """
        roads = self._roads(kind)
        pose = roads.on_lane(place.road, place.lane, place.s, place.offset)
        along_road = kind.tag == "RelativeLanePosition" and kind.get("ds") is not None
        towards = 0.0 if along_road or roads.forward(place.road, place.lane) else math.pi
        return self._turned(Pose(pose.x, pose.y, pose.heading_rad + towards), kind)

    def _beside(self, kind: Element) -> Pose:
        base = self.initial(kind.get("entityRef", ""))
        dx, dy = number(kind, "dx"), self._left(kind, "dy")
        if kind.tag == "RelativeWorldPosition":
            pose = Pose(base.x + dx, base.y + dy, base.heading_rad)
        else:
            pose = base.ahead(dx).beside(dy)
        return self._turned(pose, kind)

    def _further_on(self, kind: Element) -> RoadPlace:
        """Return a place along the road of an entity: `ds` counts in the road's direction, `dsLane` in the direction of
        its lane."""
        roads, base = self._roads(kind), self._road_place_of(kind.get("entityRef", ""))
        lanes, offset = round(number(kind, "dLane")), self._left(kind, "offset")
        ds = number(kind, "ds", 0.0)
        if kind.get("ds") is None and kind.get("dsLane") is not None:
            side = 1 if roads.forward(base.road, base.lane) else -1
            ds, lanes, offset = side * number(kind, "dsLane"), side * lanes, side * offset
        moved, turned = roads.moved(RoadPlace(base.road, roads.within(base.road, base.s), base.lane), ds)
        lane = lane_beside(moved.lane, -lanes if turned else lanes)
        return self._with_t(roads, RoadPlace(moved.road, moved.s, lane, -offset if turned else offset))

    def _along_trajectory(self, kind: Element) -> Pose:
        """Return the place at a length along a trajectory, with its offset to the left."""
        trajectory = self.referred(kind.find("TrajectoryRef"), "Trajectory")
        line = self.line_of(trajectory, self) if trajectory is not None else ()
        if len(line) < 2:
            raise NotExpressed("positions: TrajectoryPosition (no trajectory)")
        left = max(number(kind, "s"), 0.0)
        for k, (a, b) in enumerate(itertools.pairwise(line)):
            step = math.hypot(b.x - a.x, b.y - a.y)
            if step > 0 and (left <= step or k == len(line) - 2):
                towards = Pose(a.x, a.y, math.atan2(b.y - a.y, b.x - a.x))
                return towards.ahead(min(left, step)).beside(number(kind, "t", 0.0) * (-1 if self.mirrored else 1))
            left -= step
        raise NotExpressed("positions: TrajectoryPosition (no trajectory)")

    def _along_route(self, kind: Element) -> RoadPlace:
        """Return the place at a length along a route."""
        route = self.referred(kind.find("RouteRef"), "Route")
        where = kind.find("InRoutePosition")
        inner = next(iter(where), None) if where is not None else None
        if route is None or inner is None or inner.tag not in ("FromLaneCoordinates", "FromRoadCoordinates"):
            raise NotExpressed(f"positions: RoutePosition ({'no route' if inner is None else inner.tag})")
        roads = self._roads(kind)
        points = [self.road_place(position) for position in route.iterfind("Waypoint/Position")]
        if not points:
            raise NotExpressed("positions: RoutePosition (a route without waypoints)")
        road, s = _along(roads, points, number(inner, "pathS"))
        if inner.tag == "FromLaneCoordinates":
            lane, offset = round(number(inner, "laneId")), self._left(inner, "laneOffset")
            return self._with_t(roads, RoadPlace(road, s, lane, offset))
        place = roads.locate(roads.on_reference(road, s, self._left(inner, "t")))
        if place is None:
            raise NotExpressed("positions: RoutePosition (off the road)")
        return place

    @staticmethod
    def _with_t(roads: Roads, place: RoadPlace) -> RoadPlace:
        """Return a place completed by its distance from the road's reference line."""
        s = roads.within(place.road, place.s)
        pose, line = roads.on_lane(place.road, place.lane, s, place.offset), roads.on_reference(place.road, s, 0.0)
        t = -(pose.x - line.x) * math.sin(line.heading_rad) + (pose.y - line.y) * math.cos(line.heading_rad)
        return RoadPlace(place.road, s, place.lane, place.offset, t)

    def _turned(self, pose: Pose, kind: Element) -> Pose:
        """Return a pose with a position's orientation; without an orientation, unchanged."""
        orientation = kind.find("Orientation")
        if orientation is None or orientation.get("h") is None:
            return Pose(pose.x, pose.y, pose.heading_rad)
        h = self._left(orientation, "h")
        absolute = orientation.get("type") or ("absolute" if self.minor <= 2 else "relative")
        return Pose(pose.x, pose.y, h if absolute == "absolute" else pose.heading_rad + h)


_RELATIVE = ("RelativeWorldPosition", "RelativeObjectPosition", "RelativeRoadPosition")


def positions_of(element: Element) -> Iterator[Element]:
    """Yield the positions in an element, in its order."""
    return (e for e in element.iter() if e.tag in ("Position", "PositionStart"))


def lane_beside(lane: int, by: int) -> int:
    """Return the id of the lane `by` lanes to the left (in the road's direction); there is no lane 0."""
    target = lane + by
    return target if target * lane > 0 or by == 0 else target + (1 if by > 0 else -1)


def _along(roads: Roads, points: list[RoadPlace], path_s: float) -> tuple[str, float]:
    """Return the road, and the length along it, at a length along a route through some places."""
    left = max(path_s, 0.0)
    road, s, onward = points[0].road, points[0].s, roads.forward(points[0].road, points[0].lane)
    for first, last in itertools.pairwise(points):
        way = roads.way(RoadPlace(road, s, first.lane), last)
        if not way:
            raise NotExpressed("positions: RoutePosition (there is no way along the route)")
        for k, (name, forward) in enumerate(way):
            begin = s if k == 0 else 0.0 if forward else roads.length(name)
            end = last.s if k == len(way) - 1 else roads.length(name) if forward else 0.0
            if left <= abs(end - begin):
                return name, begin + left if forward else begin - left
            left -= abs(end - begin)
            onward = forward
        road, s = last.road, last.s
    moved, _ = roads.moved(RoadPlace(road, s, points[-1].lane), left if onward else -left)
    return moved.road, moved.s


def point_of(pose: Pose) -> m.Point:
    """Return a place as a point of the language."""
    return m.Point(x=quantity(pose.x, "length"), y=quantity(pose.y, "length"))
