"""Reads lanelet2 maps (OSM XML): the lanes for vehicles, with speed limits, right of way and traffic lights.

The format: Poggenhans et al., "Lanelet2: A high-definition map framework for the future of automated driving", ITSC
2018, and the pages "Lanelets, Areas and Tagging" of its repository.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

import numpy as np

from foresee_dsl.compile.nets.safe_xml import children_of
from foresee_recordings.maps.lanes import Lane, LaneMap, LaneType, RightOfWay
from foresee_recordings.maps.utm import utm, zone_of
from foresee_recordings.recording import FloatArray, RecordingError

_WHAT = "a lanelet2 map"
_TYPES: Mapping[str, LaneType] = {
    "": "road",
    "road": "road",
    "highway": "road",
    "play_street": "road",
    "bus_lane": "bus",
    "bicycle_lane": "bicycle",
    "emergency_lane": "shoulder",
}
"""Our type for each subtype of lanelets that vehicles use; maps of the older format liblanelet have no subtypes."""
_LOCAL_DEGREES = 1.0
"""Maps whose latitudes and longitudes are all below this have their own origin at (0, 0), as those of INTERACTION and
highD. Ours: there is only sea around that place."""
_STOP_SIGNS = ("usR1-1", "de206")
_UNITS = {"mph": 0.44704, "kmh": 1 / 3.6, "km/h": 1 / 3.6, "": 1 / 3.6, "m/s": 1.0, "mps": 1.0}
_SPEED = re.compile(r"(?:^|de274-|\s)(\d+(?:\.\d+)?)\s*(mph|km/?h|m/s|mps|)$")
"""A speed limit: `15mph`, `80kmh`, `50` (km/h), or the German sign `de274-60`."""
_REVERSED = "_back"


@dataclass(frozen=True)
class _Lanelet:
    """A lanelet of the file: the ids of its nodes on both sides, in the driving direction, and its tags."""

    id: str
    left: tuple[str, ...]
    right: tuple[str, ...]
    tags: Mapping[str, str]
    rules: tuple[str, ...]


@dataclass(frozen=True)
class _Rule:
    """A regulatory element: its tags, and the ids of its members by role."""

    tags: Mapping[str, str]
    members: Mapping[str, tuple[str, ...]]


class _File:
    """The nodes, ways and relations of an OSM file."""

    def __init__(self, path: Path) -> None:
        self.places: dict[str, tuple[float, float]] = {}
        self.ways: dict[str, tuple[str, ...]] = {}
        self.tags: dict[str, Mapping[str, str]] = {}
        self.relations: list[Element] = []
        self._local: dict[str, tuple[float, float]] = {}
        for element in children_of(path, "osm", _WHAT, RecordingError):
            id_ = element.get("id", "")
            try:
                if element.tag == "node":
                    self._take_node(id_, element)
                elif element.tag == "way":
                    self.ways[id_] = tuple(nd.get("ref", "") for nd in element.iterfind("nd"))
                    self.tags[id_] = _tags(element)
                elif element.tag == "relation":
                    self.relations.append(element)
            except ValueError as err:
                raise RecordingError(f"{path}: <{element.tag} id={id_!r}>: {err}") from err

    @property
    def in_utm(self) -> bool:
        """Whether the positions are those of UTM: not local, and not measured from the place at (0, 0) degrees."""
        degrees = (abs(value) for place in self.places.values() for value in place)
        return len(self._local) < len(self.places) and max(degrees, default=0.0) >= _LOCAL_DEGREES

    def points(self) -> dict[str, tuple[float, float]]:
        """Return the positions of the nodes, m: the local ones if all nodes have them, otherwise projected ones."""
        if len(self._local) == len(self.places):
            return self._local
        if not self.in_utm:
            zone = zone_of(0.0)
            x, y = utm(0.0, 0.0, zone)
            places = {id_: utm(*place, zone) for id_, place in self.places.items()}
            return {id_: (east - x, north - y) for id_, (east, north) in places.items()}
        latitude, longitude = next(iter(self.places.values()))
        zone = zone_of(longitude)
        return {id_: utm(*place, zone, southern=latitude < 0) for id_, place in self.places.items()}

    def _take_node(self, id_: str, element: Element) -> None:
        place = float(element.get("lat", "nan")), float(element.get("lon", "nan"))
        tags = _tags(element)
        if "local_x" in tags and "local_y" in tags:
            local = float(tags["local_x"]), float(tags["local_y"])
            if all(abs(value) < _LARGEST_M for value in local):
                self._local[id_] = local
        elif not (abs(place[0]) <= 85 and abs(place[1]) <= 180):
            raise ValueError("it has no latitude and longitude")
        self.places[id_] = place


_LARGEST_M = 1e8
"""Largest coordinate, m. Ours: as for networks, above UTM's northings (1e7 m)."""


def read_lanelet2(path: Path) -> LaneMap:
    """Return the lanes for vehicles of a lanelet2 map.

    Raises:
        RecordingError: the file is not such a map, is damaged, or exceeds a limit.
    """
    file = _File(path)
    left_out: Counter[str] = Counter()
    rules = {relation.get("id", ""): _Rule(_tags(relation), _members(relation)) for relation in file.relations}
    lanelets = [lanelet for relation in file.relations if (lanelet := _lanelet(file, relation, left_out))]
    if not lanelets:
        raise RecordingError(f"{path} is not {_WHAT}: it has no relation of the type lanelet")
    used = [lanelet for lanelet in lanelets if _type(lanelet, left_out) is not None]
    points = file.points()
    oriented = [_oriented(lanelet, points) for lanelet in used]
    backward = [_turned(lanelet) for lanelet in oriented if lanelet.tags.get("one_way") in ("no", "false")]
    notes = []
    if backward:
        notes.append(f"{len(backward)} lanes for both directions became two lanes each, one over the other")
    lanes = _linked([*oriented, *backward], points, rules, _ways_of(rules, file.tags))
    return LaneMap({lane.id: lane for lane in lanes}, dict(left_out), tuple(notes), file.in_utm)


def _lanelet(file: _File, relation: Element, left_out: Counter[str]) -> _Lanelet | None:
    tags, members = _tags(relation), _members(relation)
    if tags.get("type") != "lanelet":
        return None
    sides = [_chain([file.ways.get(way, ()) for way in members.get(side, ())]) for side in ("left", "right")]
    nodes = [tuple(node for node in side if node in file.places) for side in sides]
    if any(len(side) < 2 for side in nodes):
        left_out["lanelets without two borders"] += 1
        return None
    return _Lanelet(relation.get("id", ""), nodes[0], nodes[1], tags, members.get("regulatory_element", ()))


def _chain(ways: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    """Return the nodes of ways that follow each other, each in either direction and in any order."""
    rest = [way for way in ways if way]
    if not rest:
        return ()
    chain = rest.pop(0)
    while rest:
        for k, way in enumerate(rest):
            joined = _joined(chain, way)
            if joined:
                chain = joined
                del rest[k]
                break
        else:
            return chain  # the other ways are not connected with it
    return chain


def _joined(chain: tuple[str, ...], way: tuple[str, ...]) -> tuple[str, ...]:
    for piece in (way, way[::-1]):
        if piece[0] == chain[-1]:
            return chain + piece[1:]
        if piece[-1] == chain[0]:
            return piece[:-1] + chain
    return ()


def _type(lanelet: _Lanelet, left_out: Counter[str]) -> LaneType | None:
    """Return the type of a lane; None, and counted, for a lanelet that vehicles do not use."""
    subtype = lanelet.tags.get("subtype", "")
    own = _TYPES.get(subtype)
    if own is None:
        left_out[f"lanelets of the subtype {subtype}"] += 1
    return own


def _oriented(lanelet: _Lanelet, points: Mapping[str, tuple[float, float]]) -> _Lanelet:
    """Return a lanelet whose borders run in one direction, the left one on the left of the right one."""
    left, right = _line(lanelet.left, points), _line(lanelet.right, points)
    along = np.hypot(*(left[0] - right[0])) + np.hypot(*(left[-1] - right[-1]))
    against = np.hypot(*(left[0] - right[-1])) + np.hypot(*(left[-1] - right[0]))
    nodes = lanelet.right
    if against < along:
        nodes, right = nodes[::-1], right[::-1]
    outline = np.concatenate([left, right[::-1]])
    x, y = outline.T - outline.mean(axis=0)[:, None]
    if (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() > 0:  # counter-clockwise: the left border is on the right
        return replace(lanelet, left=lanelet.left[::-1], right=nodes[::-1])
    return replace(lanelet, right=nodes)


def _turned(lanelet: _Lanelet) -> _Lanelet:
    """Return the other direction of a lanelet."""
    return replace(lanelet, id=lanelet.id + _REVERSED, left=lanelet.right[::-1], right=lanelet.left[::-1])


def _linked(
    lanelets: Sequence[_Lanelet],
    points: Mapping[str, tuple[float, float]],
    rules: Mapping[str, _Rule],
    ways: Mapping[str, RightOfWay],
) -> Iterator[Lane]:
    """Yield lanes with their relations: a lane follows another if it begins with the nodes at which that ends."""
    limits = _limits(rules)
    lights = {id_ for id_, rule in rules.items() if rule.tags.get("subtype") == "traffic_light"}
    begins: dict[tuple[str, str], list[str]] = {}
    of_right: dict[tuple[str, ...], str] = {}
    of_left: dict[tuple[str, ...], str] = {}
    for lanelet in lanelets:
        begins.setdefault((lanelet.left[0], lanelet.right[0]), []).append(lanelet.id)
        of_right.setdefault(lanelet.right, lanelet.id)
        of_left.setdefault(lanelet.left, lanelet.id)
    for lanelet in lanelets:
        own = lanelet.id.removesuffix(_REVERSED)
        onward = begins.get((lanelet.left[-1], lanelet.right[-1]), ())
        own_limits = [limits[rule] for rule in lanelet.rules if rule in limits]
        speed = _speed(lanelet.tags.get("speed_limit", "")) or min(own_limits, default=None)
        yield Lane(
            id=lanelet.id,
            left=_line(lanelet.left, points),
            right=_line(lanelet.right, points),
            successors=tuple(other for other in onward if other.removesuffix(_REVERSED) != own),
            left_neighbour=of_right.get(lanelet.left, ""),
            right_neighbour=of_left.get(lanelet.right, ""),
            speed_mps=speed,
            type=_TYPES[lanelet.tags.get("subtype", "")],
            way=ways.get(lanelet.id, ""),
            signal=next((rule for rule in lanelet.rules if rule in lights), ""),
        )


def _ways_of(rules: Mapping[str, _Rule], tags: Mapping[str, Mapping[str, str]]) -> dict[str, RightOfWay]:
    """Return the right of way of lanelets by their ids."""
    ways: dict[str, RightOfWay] = {}
    for rule in rules.values():
        subtype = rule.tags.get("subtype")
        if rule.tags.get("type") != "regulatory_element" or subtype not in ("right_of_way", "all_way_stop"):
            continue
        signs = {tags.get(sign, {}).get("subtype", "") for sign in rule.members.get("refers", ())}
        stops = subtype == "all_way_stop" or not signs.isdisjoint(_STOP_SIGNS)
        ways |= dict.fromkeys(rule.members.get("right_of_way", ()), "priority")
        ways |= dict.fromkeys(rule.members.get("yield", ()), "stop" if stops else "yield")
    return ways


def _limits(rules: Mapping[str, _Rule]) -> dict[str, float]:
    """Return the speed limits of regulatory elements, m/s, by their ids."""
    limits = {}
    for id_, rule in rules.items():
        speed = _speed(rule.tags.get("sign_type", ""))
        if rule.tags.get("subtype") == "speed_limit" and speed is not None:
            limits[id_] = speed
    return limits


def _speed(text: str) -> float | None:
    match = _SPEED.search(text.strip())
    speed = float(match[1]) * _UNITS[match[2]] if match else math.nan
    return speed if 0.0 < speed < 1e3 else None


def _line(nodes: Sequence[str], points: Mapping[str, tuple[float, float]]) -> FloatArray:
    return np.array([points[node] for node in nodes], dtype=np.float64)


def _tags(element: Element) -> dict[str, str]:
    return {tag.get("k", ""): tag.get("v", "") for tag in element.iterfind("tag")}


def _members(relation: Element) -> dict[str, tuple[str, ...]]:
    members: dict[str, tuple[str, ...]] = {}
    for member in relation.iterfind("member"):
        role = member.get("role", "")
        members[role] = (*members.get(role, ()), member.get("ref", ""))
    return members
