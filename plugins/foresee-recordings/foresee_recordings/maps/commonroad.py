"""The lanelets of a CommonRoad scenario as a map of lanes."""

from __future__ import annotations

from collections import Counter
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

import numpy as np

from foresee_recordings.maps.lanes import Lane, LaneMap, LaneType, RightOfWay
from foresee_recordings.recording import FloatArray

_SPEED_SIGNS = frozenset({"274", "R2-1"})
"""Speed limits in CommonRoad's catalogues of signs (DEU, ZAM and others: 274; USA: R2-1). The value is in m/s."""
_WAYS: dict[str, RightOfWay] = {"206": "stop", "R1-1": "stop", "205": "yield", "R1-2": "yield"}
_PRIORITY_SIGNS = frozenset({"301", "306"})
_NOT_FOR_VEHICLES = {"sidewalk": "sidewalks", "crosswalk": "crosswalks", "border": "borders"}
_TYPES: dict[str, LaneType] = {"shoulder": "shoulder", "busLane": "bus", "bicycleLane": "bicycle"}


class Lanelets:
    """The elements of a scenario that describe its roads, collected while the file is read."""

    def __init__(self) -> None:
        self._lanelets: list[_Lanelet] = []
        self._speeds: dict[str, float] = {}
        self._ways: dict[str, RightOfWay] = {}
        self._left_out: Counter[str] = Counter()

    def take(self, element: Element) -> None:
        """Take a `<lanelet>` or a `<trafficSign>`; other elements are ignored.

        Raises:
            ValueError: a border has fewer than two points, or a number is not a number.
        """
        if element.tag == "lanelet":
            self._lanelets.append(_Lanelet(element))
        elif element.tag == "trafficSign":
            self._take_sign(element)

    def lane_map(self) -> LaneMap:
        """Return the lanes for vehicles."""
        lanes = {}
        for lanelet in self._lanelets:
            other = next((name for type_, name in _NOT_FOR_VEHICLES.items() if type_ in lanelet.types), None)
            if other is None and lanelet.users and lanelet.users <= {"pedestrian"}:
                other = "lanes for pedestrians"
            if other is not None:
                self._left_out[other] += 1
                continue
            lanes[lanelet.id] = lanelet.lane(self._speeds, self._ways)
        return LaneMap(lanes, dict(self._left_out))

    def stop_lines(self) -> dict[str, tuple[float, float]]:
        """Return the middle of the stop line of each traffic light, m, by the light's id."""
        return {light: lanelet.stop_line for lanelet in reversed(self._lanelets) for light in lanelet.lights}

    def _take_sign(self, element: Element) -> None:
        id_ = element.get("id", "")
        for part in element.iterfind("trafficSignElement"):
            sign = (part.findtext("trafficSignID") or "").strip()
            if sign in _SPEED_SIGNS:
                speed = float(part.findtext("additionalValue") or "nan")
                if 0.0 < speed < 1e3:
                    self._speeds[id_] = speed
            elif sign in _WAYS:
                self._ways[id_] = _WAYS[sign]
            elif sign in _PRIORITY_SIGNS:
                self._ways[id_] = "priority"
            else:
                self._left_out[f"traffic signs {sign}"] += 1


class _Lanelet:
    """The parts of a `<lanelet>`."""

    def __init__(self, element: Element) -> None:
        self.id = element.get("id", "")
        self.left, self.right = (_border(element, tag) for tag in ("leftBound", "rightBound"))
        self.predecessors, self.successors = (_refs(element, tag) for tag in ("predecessor", "successor"))
        self.neighbours = [_same_direction(element, tag) for tag in ("adjacentLeft", "adjacentRight")]
        self.types = _words(element, "laneletType")
        self.users = _words(element, "userOneWay") | _words(element, "userBidirectional")
        self.signs, self.lights = _refs(element, "trafficSignRef"), _refs(element, "trafficLightRef")
        self.speed = float(element.findtext("speedLimit") or "nan")  # version 2018b
        line = [_point(child) for child in element.iterfind("stopLine/point")]
        ends = np.array(line) if len(line) == 2 else np.array([self.left[-1], self.right[-1]])
        x, y = ends.mean(axis=0)
        self.stop_line = float(x), float(y)

    def lane(self, speeds: dict[str, float], ways: dict[str, RightOfWay]) -> Lane:
        limits = [speeds[sign] for sign in self.signs if sign in speeds]
        if 0.0 < self.speed < 1e3:
            limits.append(self.speed)
        type_: LaneType = next((own for name, own in _TYPES.items() if name in self.types), "road")
        if self.users and self.users <= {"bicycle", "pedestrian"}:
            type_ = "bicycle"
        return Lane(
            id=self.id,
            left=self.left,
            right=self.right,
            predecessors=self.predecessors,
            successors=self.successors,
            left_neighbour=self.neighbours[0],
            right_neighbour=self.neighbours[1],
            speed_mps=min(limits, default=None),
            type=type_,
            way=next((ways[sign] for sign in self.signs if sign in ways), ""),
            signal=next(iter(self.lights), ""),
        )


def _border(element: Element, tag: str) -> FloatArray:
    points = np.array([_point(child) for child in element.iterfind(f"{tag}/point")], dtype=np.float64)
    if len(points) < 2:
        raise ValueError(f"its <{tag}> has fewer than two points")
    if not (np.abs(points) < _LARGEST_M).all():
        raise ValueError(f"its <{tag}> has a point that is not finite or far too large")
    return points


_LARGEST_M = 1e8
"""Largest coordinate, m. Ours: as for networks, above UTM's northings (1e7 m)."""


def _point(element: Element) -> tuple[float, float]:
    x, y = element.findtext("x"), element.findtext("y")
    if x is None or y is None:
        raise ValueError(f"a <{element.tag}> has no <x> or no <y>")
    return float(x), float(y)


def _refs(element: Element, tag: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(child.get("ref", "") for child in element.iterfind(tag)))


def _same_direction(element: Element, tag: str) -> str:
    child = element.find(tag)
    return "" if child is None or child.get("drivingDir") != "same" else child.get("ref", "")


def _words(element: Element, tag: str) -> set[str]:
    return {(child.text or "").strip() for child in element.iterfind(tag)}
