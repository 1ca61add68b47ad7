"""Positions of OpenSCENARIO as points of the map, and where each entity is at the beginning."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.foreign.opendrive_geometry import Pose, RoadMap
from foresee_dsl.exchange.naming import number
from foresee_dsl.exchange.outcome import NotExpressed


@dataclass
class Places:
    """Evaluates positions.

    Attributes:
        roads: the map; None for a network that is no OpenDRIVE map.
        inits: the `<Position>` elements of entities at the beginning, by their names.
    """

    roads: RoadMap | None
    inits: Mapping[str, Element]
    _working: list[str] = field(default_factory=list)

    def initial(self, entity: str) -> Pose:
        """Return the pose of an entity's reference point at the beginning; `NotExpressed` where it has none that we
        know."""
        if entity not in self.inits:
            raise NotExpressed("entities without a place at the beginning")
        if entity in self._working:
            raise NotExpressed("positions that depend on each other")
        self._working.append(entity)
        try:
            return self.pose(self.inits[entity])
        finally:
            self._working.pop()

    def pose(self, position: Element) -> Pose:
        """Return the pose that a `<Position>` (or `<TargetPosition>` and the like) means; errors as of `initial`."""
        kind = next(iter(position), None)
        if kind is None:
            raise NotExpressed("empty positions")
        if kind.tag == "WorldPosition":
            return Pose(number(kind, "x"), number(kind, "y"), number(kind, "h", 0.0))
        if kind.tag in ("LanePosition", "RoadPosition"):
            return self._on_road(kind)
        if kind.tag in ("RelativeWorldPosition", "RelativeObjectPosition"):
            return self._beside(kind)
        if kind.tag in ("RelativeLanePosition", "RelativeRoadPosition"):
            return self._further_on(kind)
        raise NotExpressed(f"positions: {kind.tag}")

    def _on_road(self, kind: Element, ds: float = 0.0, lanes: int = 0, dt: float = 0.0) -> Pose:
        """Return a lane or road position, moved along and across."""
        if self.roads is None:
            raise NotExpressed(f"positions: {kind.tag} (the network is no OpenDRIVE map)")
        road, s = kind.get("roadId", ""), number(kind, "s") + ds
        back = False
        if kind.tag == "RoadPosition":
            pose = self.roads.at(road, s, number(kind, "t") + dt)
        else:
            lane = round(number(kind, "laneId"))
            back = lane > 0
            pose = self.roads.lane(road, _lane(lane, lanes), s, number(kind, "offset", 0.0) + dt)
        orientation = kind.find("Orientation")
        if orientation is None:  # nothing stated: the way that traffic goes there
            return Pose(pose.x, pose.y, pose.heading_rad + (math.pi if back else 0.0))
        return _turned(pose, orientation)

    def _beside(self, kind: Element) -> Pose:
        base = self.initial(kind.get("entityRef", ""))
        dx, dy = number(kind, "dx"), number(kind, "dy")
        orientation = kind.find("Orientation")
        if kind.tag == "RelativeWorldPosition":
            pose = Pose(base.x + dx, base.y + dy, base.heading_rad)
        else:
            pose = base.ahead(dx).beside(dy)
        return pose if orientation is None else _turned(pose, orientation)

    def _further_on(self, kind: Element) -> Pose:
        """Return a place along the road of an entity whose own place is given on a road."""
        entity = kind.get("entityRef", "")
        position = self.inits.get(entity)
        base = None if position is None else next(iter(position), None)
        if base is None or base.tag not in ("LanePosition", "RoadPosition"):
            raise NotExpressed(f"positions: {kind.tag} of an entity that is not placed on a road")
        forward = -1.0 if base.tag == "LanePosition" and number(base, "laneId") > 0 else 1.0
        if kind.tag == "RelativeRoadPosition":
            return self._on_road(base, number(kind, "ds"), 0, number(kind, "dt"))
        offset = number(kind, "offset", 0.0)
        return self._on_road(base, forward * number(kind, "ds", 0.0), round(number(kind, "dLane")), offset)


def _lane(lane: int, by: int) -> int:
    """Return the id of the lane `by` lanes to the left (in the road's direction); 0 is no lane."""
    found = lane + by
    return found if found * lane > 0 or by == 0 else found + (1 if by > 0 else -1)


def _turned(pose: Pose, orientation: Element) -> Pose:
    h = number(orientation, "h", 0.0)
    absolute = orientation.get("type", "absolute") == "absolute"
    return Pose(pose.x, pose.y, h if absolute else pose.heading_rad + h)
