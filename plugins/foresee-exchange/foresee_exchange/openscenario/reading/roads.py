"""Roads of an OpenDRIVE map: positions along them and across their links, and the road at a point."""

from __future__ import annotations

import heapq
import itertools
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

import numpy as np
import shapely

from foresee_dsl.compile.foreign.opendrive_geometry import OpenDriveRoads, Pose, number
from foresee_dsl.compile.nets.safe_xml import parse_xml
from foresee_dsl.compile.roads.polyline import lengths
from foresee_dsl.errors import CompileError
from foresee_exchange.openscenario.losses import SourceError

_STEP_M = 2.0
"""Sampling distance of reference lines for the search of a point's road, m (ours: within 0.03 m of arcs of 20 m radius;
the foot of the perpendicular is computed exactly afterwards)."""
_WIDEST_M = 30.0
"""Largest distance of a point from its road's reference line, m (ours: motorways of ten lanes)."""
_BEYOND_M = 5.0
"""A place up to this far beyond its road's end counts as at the end, m (ours: as players do; files round lengths)."""


@dataclass(frozen=True)
class RoadPlace:
    """A place along a road: `lane` and the `offset` from its middle, m; `t`, m, counts from the reference line."""

    road: str
    s: float
    lane: int
    offset: float = 0.0
    t: float = 0.0


class _Step(NamedTuple):
    """A road behind the end of another: whether it begins there, and its lanes, keyed by the lanes that lead to
    them."""

    road: str
    begins: bool
    lanes: dict[int, int]


class Roads:
    """An OpenDRIVE map."""

    def __init__(self, path: Path) -> None:
        """Read a map."""
        root = parse_xml(path, "OpenDRIVE", "an OpenDRIVE map")
        self._map = OpenDriveRoads(root)
        self._roads = {road.get("id", ""): road for road in root.iterfind("road")}
        self._junctions = {junction.get("id", ""): junction for junction in root.iterfind("junction")}

    def within(self, road: str, s: float) -> float:
        """Return a length along a road, clipped to its ends if slightly beyond them; `SourceError` if farther off."""
        if road not in self._roads:
            raise SourceError(f"the map has no road {road}")
        length = self.length(road)
        if not -_BEYOND_M <= s <= length + _BEYOND_M:
            raise SourceError(f"the map's road {road} is {length:.1f} m long, so it has no place at {s:g} m")
        return min(max(s, 0.0), length)

    def length(self, road: str) -> float:
        """Return a road's length, m."""
        return number(self._roads[road], "length", 0.0)

    def on_reference(self, road: str, s: float, t: float) -> Pose:
        """Return the pose `t` to the left of a road's reference line, in the road's direction."""
        return self._map.at(road, self.within(road, s), t)

    def on_lane(self, road: str, lane: int, s: float, offset: float) -> Pose:
        """Return the pose on a lane, in the road's direction; lane 0 is the reference line itself."""
        s = self.within(road, s)
        if lane == 0:
            return self._map.at(road, s, offset)
        try:
            return self._map.lane(road, lane, s, offset)
        except CompileError as err:
            raise SourceError(str(err)) from err

    def forward(self, road: str, lane: int) -> bool:
        """Return whether a lane's traffic drives in the road's direction, in right-hand or left-hand traffic."""
        left_hand = self._roads[road].get("rule", "RHT") == "LHT" if road in self._roads else False
        return (lane <= 0) != left_hand

    def moved(self, place: RoadPlace, ds: float) -> tuple[RoadPlace, bool]:
        """Return a place moved along its road, in the road's direction, across the following roads.

        The second value tells whether the last road runs the other way, so that left and right are exchanged.
        """
        road, s, onward, turned = place.road, place.s, ds >= 0, False
        left = abs(ds)
        for _ in range(1000):
            room = self.length(road) - s if onward else s
            if left <= room + 1e-6:
                break
            step = next(iter(self._followers(road, onward=onward)), None)
            if step is None:
                raise SourceError(f"a place {ds:g} m along road {place.road} from {place.s:g} m lies beyond its end")
            left -= room
            turned ^= step.begins != onward
            road, onward = step.road, step.begins
            s = 0.0 if onward else self.length(road)
        s += left if onward else -left
        lane = -place.lane if turned else place.lane
        return RoadPlace(road, s, lane, -place.offset if turned else place.offset), turned

    def locate(self, pose: Pose) -> RoadPlace | None:
        """Return the place of a point on its road; of overlapping roads, the one whose direction fits the heading."""
        point = shapely.Point(pose.x, pose.y)
        best: tuple[float, RoadPlace] | None = None
        for k in self._tree.query(point.buffer(_WIDEST_M)):
            road, line, starts = self._lines[int(k)]
            s = float(np.interp(line.project(point), starts[1], starts[0]))
            for _ in range(3):  # the line is a polygon, so move the nearest point to the exact curve
                at = self._map.at(road, s, 0.0)
                ahead = (pose.x - at.x) * math.cos(at.heading_rad) + (pose.y - at.y) * math.sin(at.heading_rad)
                s = min(max(s + ahead, 0.0), self.length(road))
            at = self._map.at(road, s, 0.0)
            ahead = (pose.x - at.x) * math.cos(at.heading_rad) + (pose.y - at.y) * math.sin(at.heading_rad)
            t = -(pose.x - at.x) * math.sin(at.heading_rad) + (pose.y - at.y) * math.cos(at.heading_rad)
            lane, offset, outside = self._lane_at(road, s, t)
            towards = at.heading_rad + (0.0 if self.forward(road, lane) else math.pi)
            off = 0.0 if math.isnan(pose.heading_rad) else abs(math.remainder(pose.heading_rad - towards, math.pi))
            badness = abs(ahead) + outside + off
            if best is None or badness < best[0] - 1e-6:
                best = badness, RoadPlace(road, s, lane, offset, t)
        return best[1] if best is not None and best[0] < _WIDEST_M else None

    def way(self, first: RoadPlace, last: RoadPlace) -> list[tuple[str, bool]]:
        """Return the roads of the shortest way between two places, each with whether it is driven in its direction;
        empty if there is none."""
        counter = itertools.count()
        begin = self.forward(first.road, first.lane)
        heap: list[tuple[float, int, str, bool, tuple[tuple[str, bool], ...]]] = []
        # Lanes are used against their direction only if necessary.
        for onward, penalty in ((begin, 0.0), (not begin, 1e4)):
            heapq.heappush(heap, (penalty, next(counter), first.road, onward, ((first.road, onward),)))
        done: set[tuple[str, bool]] = set()
        while heap:
            cost, _, road, onward, way = heapq.heappop(heap)
            if road == last.road and (len(way) > 1 or (last.s >= first.s) == onward):
                return list(way)
            if (road, onward) in done:
                continue
            done.add((road, onward))
            for step in self._followers(road, onward=onward):
                on = step.road, step.begins
                heapq.heappush(heap, (cost + self.length(step.road), next(counter), *on, (*way, on)))
        return []

    def lane_sections(self, road: str) -> list[tuple[float, float, Element]]:
        """Return the lane sections of a road with their beginnings and ends along it, m."""
        sections = self._roads[road].findall("lanes/laneSection")
        begins = [number(section, "s", 0.0) for section in sections]
        return list(zip(begins, [*begins[1:], self.length(road)], sections, strict=True))

    def lane_behind(self, road: str, lane: int, *, onward: bool) -> tuple[str, int, bool] | None:
        """Return the road and the lane that follow a lane's end in a direction (the straightest of several), and
        whether that road begins there."""
        for step in self._followers(road, onward=onward):
            if to := step.lanes.get(lane, 0):
                return step.road, to, step.begins
        return None

    def _followers(self, road: str, *, onward: bool) -> list[_Step]:
        """Return the roads behind an end of a road, the straightest first."""
        link = self._roads[road].find(f"link/{'successor' if onward else 'predecessor'}")
        if link is None:
            return []
        to = link.get("elementId", "")
        if link.get("elementType") != "junction":
            lanes = self._linked_lanes(road, onward=onward)
            return [_Step(to, link.get("contactPoint") == "start", lanes)] if to in self._roads else []
        junction = self._junctions.get(to)
        connections = junction.iterfind("connection") if junction is not None else ()
        steps = [step for connection in connections if (step := self._over(connection, road, to, onward=onward))]
        return sorted((step for step in steps if step.road in self._roads), key=self._turn)

    def _over(self, connection: Element, road: str, junction: str, *, onward: bool) -> _Step | None:
        """Return the road to which a junction's connection leads from the end of a road; None if it begins elsewhere.

        A direct junction has no roads inside: its connection joins two roads and is listed once for both directions.
        """
        links = connection.iterfind("laneLink")
        pairs = [(round(number(link, "from", 0.0)), round(number(link, "to", 0.0))) for link in links]
        begins = connection.get("contactPoint") == "start"
        incoming, linked = connection.get("incomingRoad", ""), connection.get("linkedRoad", "")
        if incoming == road:
            return _Step(connection.get("connectingRoad", linked), begins, dict(pairs))
        if linked != road or begins == onward or incoming not in self._roads:
            return None
        link = self._roads[incoming].find("link/predecessor")
        from_its_begin = link is not None and (link.get("elementType"), link.get("elementId")) == ("junction", junction)
        return _Step(incoming, from_its_begin, {to: lane for lane, to in pairs})

    def _linked_lanes(self, road: str, *, onward: bool) -> dict[int, int]:
        """Return the lanes behind the end of a road, keyed by the road's lanes that lead to them."""
        sections = self.lane_sections(road)
        if not sections:
            return {}
        section = sections[-1 if onward else 0][2]
        lanes = [round(number(lane, "id", 0.0)) for lane in section.iterfind("*/lane")]
        return {lane: to for lane in lanes if (to := linked_lane(section, lane, onward=onward))}

    def _turn(self, step: _Step) -> float:
        begin, end = self._map.at(step.road, 0.0, 0.0), self._map.at(step.road, self.length(step.road), 0.0)
        return abs(math.remainder(end.heading_rad - begin.heading_rad, math.tau))

    def _lane_at(self, road: str, s: float, t: float) -> tuple[int, float, float]:
        """Return the lane at `t`, the offset from its middle, and the distance to the nearest lane if outside all,
        m."""
        best: tuple[float, int, float] | None = None
        for lane in self._lanes(road, s):
            try:
                middle = self._map.lane(road, lane, s)
            except CompileError:
                continue
            at = self._map.at(road, s, 0.0)
            centre = -(middle.x - at.x) * math.sin(at.heading_rad) + (middle.y - at.y) * math.cos(at.heading_rad)
            off = t - centre
            if best is None or abs(off) < best[0]:
                best = abs(off), lane, off
        if best is None:
            return (-1 if t <= 0 else 1), 0.0, abs(t)
        return best[1], best[2], max(best[0] - 2.0, 0.0)

    def _lanes(self, road: str, s: float) -> list[int]:
        """Return the ids of the lanes for vehicles at a length along a road."""
        sections = self.lane_sections(road)
        if not sections:
            return []
        section = ([section for begin, _, section in sections if begin <= s + 1e-6] or [sections[0][2]])[-1]
        lanes = [*section.iterfind("left/lane"), *section.iterfind("right/lane")]
        return [round(number(lane, "id")) for lane in lanes if lane.get("type") not in ("none", "border", "curb")]

    @cached_property
    def _lines(self) -> list[tuple[str, shapely.LineString, tuple[list[float], tuple[float, ...]]]]:
        """Return all reference lines as polygons, each with its sample positions on the curve and along the polygon."""
        lines = []
        for road in self._roads:
            length = self.length(road)
            at = [float(s) for s in np.linspace(0.0, length, max(math.ceil(length / _STEP_M), 1) + 1)]
            try:
                points = [(pose.x, pose.y) for pose in (self._map.at(road, s, 0.0) for s in at)]
            except CompileError:
                continue
            along = lengths(points)
            if along[-1] > 0:
                lines.append((road, shapely.LineString(points), (at, along)))
        return lines

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree([line for _, line, _ in self._lines])


def linked_lane(section: Element, lane: int, *, onward: bool) -> int:
    """Return the id of the lane that follows a lane of a section; 0 for none."""
    for element in section.iterfind("left/lane" if lane > 0 else "right/lane"):
        if round(number(element, "id", 0.0)) == lane:
            link = element.find(f"link/{'successor' if onward else 'predecessor'}")
            return round(number(link, "id", 0.0)) if link is not None else 0
    return 0
