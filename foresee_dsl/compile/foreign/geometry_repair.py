"""Repairs what is wrong with the lines of a net where that is safe, and closes what stays wrong."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement  # no parsing: that is safe_xml's

from foresee_dsl.compile.foreign.geometry_faults import (
    FARTHEST_OUTSIDE_M,
    KINK_RAD,
    Areas,
    Fault,
    beginning,
    ending,
    fault_of_line,
    faults_of,
    joined,
    simplified,
    turns,
)
from foresee_dsl.compile.nets.net_reader import FAULT, topology_of
from foresee_dsl.compile.nets.safe_xml import parse_net
from foresee_dsl.compile.roads.polyline import XY, Points, direction, distance, distance_to, interpolate, lengths
from foresee_dsl.compile.roads.topology import Movement, Topology

REPAIRED = "foresee.repaired"
"""The key of the `<param>` of a lane that was changed; its value says what was wrong."""
_REACHES_M = (1.5, 2.0, 3.0, 4.0, 6.0, 9.0)
"""How far from a corner its rounding begins: the first that gives a line without a kink is taken (ours)."""
_PULLS = (0.35, 0.5, 0.25, 0.65)
"""Where the inner points of a Bezier curve lie, as a share of the distance of its ends; 0.35 is nearest to an arc over
a quarter of a circle (0.39), and flatter for smaller turns (ours)."""
_CURVE_POINTS = 12
_MOST_CORNERS = 50
"""Corners that are rounded in one lane (ours: a hairpin road of the Alps has some 30)."""


@dataclass(frozen=True)
class Geometry:
    """What was repaired in a net's lines, and what stays wrong and is closed to all traffic: a phrase for each place,
    such as `lane 4_0 turns by 163 degrees within 0.9 m at (3.0 m, 4.5 m)`."""

    repaired: tuple[str, ...] = ()
    broken: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        """Whether anything was wrong."""
        return bool(self.repaired or self.broken)


def repair_geometry(root: Element) -> Geometry:
    """Round corners of lanes, lead connections smoothly, and close what stays broken; the tree changes only there.

    A lane stays within its old band, and keeps its ends. A connection stays within its junction's area, and leads from
    lane to lane as before. Lanes and connections that stay broken get a parameter that says why; the lanes are closed,
    and no route leads over the connections.
    """
    lanes = {lane.get("id", ""): lane for lane in root.iter("lane")}
    repaired: list[str] = []
    net = topology_of(root)
    faults = faults_of(net)
    if not faults:
        return Geometry()
    for fault in faults:
        if not fault.to and fault.kind == "kink":
            line = rounded(net.lanes[fault.lane].shape, net.lanes[fault.lane].width_m / 2)
            if line is not None:
                _put(lanes[fault.lane], line, fault)
                repaired.append(fault.where)
    if repaired:
        net = topology_of(root)
        faults = faults_of(net)
    areas = Areas(net)
    ways = {movement.ends: movement for movement in net.movements}
    for fault in faults:
        if fault.to:
            movement = ways[fault.lane, fault.to]
            line = led(net, movement, areas)
            if line is not None:
                for name, piece in zip(movement.via, _shared(net, movement, line), strict=True):
                    _put(lanes[name], piece, fault)
                repaired.append(fault.where)
    broken = faults_of(topology_of(root))
    _close(root, lanes, broken)
    return Geometry(tuple(repaired), tuple(fault.where for fault in broken))


def geometry_of(net_file: Path) -> Geometry:
    """Return what `repair_geometry` has written into a net."""
    found: dict[str, list[str]] = {REPAIRED: [], FAULT: []}
    for param in parse_net(net_file).iter("param"):
        if param.get("key") in found:
            found[param.get("key", "")].append(param.get("value", ""))
    return Geometry(tuple(dict.fromkeys(found[REPAIRED])), tuple(found[FAULT]))


def rounded(shape: Points, aside_m: float) -> Points | None:
    """Return a line with its kinks rounded, nowhere farther than a distance from where it was; None where that cannot
    be."""
    line = simplified(shape)
    for _ in range(_MOST_CORNERS):
        k = next((k for k, (angle, _) in enumerate(turns(line)) if abs(angle) > KINK_RAD), None)
        if k is None:
            return line if fault_of_line(line, "") is None else None
        found = next((one for one in _roundings(line, k + 1) if _is_near(one, shape, aside_m)), None)
        if found is None:
            return None
        line = found
    return None


def _roundings(line: Points, corner: int) -> Iterator[Points]:
    """Lines with a smooth curve in the place of a corner and what is near it, without a kink at that place."""
    marks = lengths(line)
    over_m = turns(line)[corner - 1][1]
    for reach in _REACHES_M:
        begin, end = max(marks[corner] - reach, 0.0), min(marks[corner] + over_m + reach, marks[-1])
        before, after = _cut(line, marks, 0.0, begin), _cut(line, marks, end, marks[-1])
        for pull in _PULLS:
            here = direction(*before[-2:]) if len(before) > 1 else None
            there = direction(*after[:2]) if len(after) > 1 else None
            curve = bezier(before[-1], here, after[0], there, pull)
            new = (*before[:-1], *curve, *after[1:])
            at = len(before)
            angles = turns(simplified(new[max(at - 3, 0) : at + len(curve) + 2]))
            if all(abs(angle) <= KINK_RAD for angle, _ in angles):
                yield new


def _is_near(line: Points, old: Points, aside_m: float) -> bool:
    return all(distance_to(x, y, old) <= aside_m for x, y in line)


def led(net: Topology, movement: Movement, areas: Areas) -> Points | None:
    """Return a smooth line for a connection, from the end of a lane to the beginning of another, within the junction's
    area; None where there is none."""
    before, after = (net.lanes[name].shape for name in movement.ends)
    if not movement.via or distance(before[-1], after[0]) < 0.1:
        return None
    here, there = direction(*ending(before)[-2:]), direction(*beginning(after)[:2])
    for pull in _PULLS:
        line = bezier(before[-1], here, after[0], there, pull)
        smooth = fault_of_line(joined([ending(before), line, beginning(after)]), "") is None
        if smooth and max(areas.beyond(movement.junction, line)) <= FARTHEST_OUTSIDE_M:
            return line
    return None


def bezier(start: XY, here: float | None, end: XY, there: float | None, pull: float) -> Points:
    """Return a cubic Bezier curve between two points, which leaves and arrives in two directions (None: straight)."""
    reach = pull * distance(start, end)
    here, there = (direction(start, end) if way is None else way for way in (here, there))
    one = start[0] + reach * math.cos(here), start[1] + reach * math.sin(here)
    two = end[0] - reach * math.cos(there), end[1] - reach * math.sin(there)
    points = []
    for k in range(_CURVE_POINTS + 1):
        t = k / _CURVE_POINTS
        a, b, c, d = (1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3
        points.append((a * start[0] + b * one[0] + c * two[0] + d * end[0],
                       a * start[1] + b * one[1] + c * two[1] + d * end[1]))  # fmt: skip
    return tuple(points)


def _shared(net: Topology, movement: Movement, line: Points) -> list[Points]:
    """A connection's line, shared by its lanes in proportion to their lengths."""
    marks = lengths(line)
    own = [max(lengths(net.lanes[name].shape)[-1], 0.1) for name in movement.via]
    cuts = [marks[-1] * sum(own[:k]) / sum(own) for k in range(len(own) + 1)]
    return [_cut(line, marks, a, b) for a, b in pairwise(cuts)]


def _cut(points: Sequence[XY], marks: Sequence[float], from_m: float, to_m: float) -> Points:
    """The stretch of a line between two lengths along it; a point where they are one."""
    xs, ys = zip(*points, strict=True)
    first, last = ((interpolate(at, marks, xs), interpolate(at, marks, ys)) for at in (from_m, to_m))
    if to_m - from_m < 1e-6:
        return (first,)
    inner = (point for point, at in zip(points, marks, strict=True) if from_m + 1e-6 < at < to_m - 1e-6)
    return (first, *inner, last)


def _put(lane: Element, line: Points, fault: Fault) -> None:
    """Give a lane another line, with heights from those of the old one."""
    old = [tuple(map(float, point.split(","))) for point in lane.get("shape", "").split()]
    marks = lengths(line)
    texts = [f"{x:.2f},{y:.2f}" for x, y in line]
    if any(len(point) > 2 for point in old):
        along = lengths([(x, y) for x, y, *_ in old])
        heights = [point[2] if len(point) > 2 else 0.0 for point in old]
        at = (mark / max(marks[-1], 0.01) * along[-1] for mark in marks)
        texts = [f"{text},{interpolate(s, along, heights):.2f}" for text, s in zip(texts, at, strict=True)]
    lane.set("shape", " ".join(texts))
    lane.set("length", f"{max(marks[-1], 0.1):.2f}")  # SUMO 1.28 makes shorter lanes 0.1 m long
    SubElement(lane, "param", {"key": REPAIRED, "value": fault.where})


def _close(root: Element, lanes: dict[str, Element], broken: Sequence[Fault]) -> None:
    connections = {
        (f"{c.get('from')}_{c.get('fromLane')}", f"{c.get('to')}_{c.get('toLane')}"): c
        for c in root.iterfind("connection")
    }
    for fault in broken:
        place = connections[fault.lane, fault.to] if fault.to else lanes[fault.lane]
        SubElement(place, "param", {"key": FAULT, "value": fault.where})
        if not fault.to:
            place.attrib.pop("allow", None)
            place.set("disallow", "all")
