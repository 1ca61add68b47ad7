"""Repairs faults of a net's lines where that is safe (rounds corners of lanes, leads connections smoothly from lane to
lane, cuts lanes that overlap), and closes the lanes and connections with other faults."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from xml.etree.ElementTree import (  # no parsing: that is safe_xml's
    Element,  # the type only; files are parsed by safe_xml
    SubElement,
)

from foresee_dsl.compile.foreign.geometry_faults import (
    FARTHEST_OUTSIDE_M,
    KINK_RAD,
    LONGEST_GAP_M,
    Areas,
    CheckedGeometry,
    GeometryFault,
    beginning,
    ending,
    fault_of_line,
    joined,
    simplified,
    turns,
)
from foresee_dsl.compile.nets.net_reader import FAULT, points_of, topology_of
from foresee_dsl.compile.roads.polyline import (
    XY,
    Points,
    direction,
    distance,
    distance_to,
    interpolate,
    lengths,
    stretch,
    wrap,
)
from foresee_dsl.compile.roads.topology import Movement, Topology

REPAIRED = "foresee.repaired"
"""Key of the `<param>` of a changed lane, or of one with a changed connection; its value states the repaired fault."""


@dataclass(frozen=True)
class Geometry:
    """The faults of a net's lines that were repaired, and the remaining ones, which are closed to all traffic.

    Each fault is a phrase such as `lane 4_0 turns by 163 degrees within 0.9 m at (3.0 m, 4.5 m)`.
    """

    repaired: tuple[str, ...] = ()
    broken: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        """True if there were faults."""
        return bool(self.repaired or self.broken)


def repair_geometry(root: Element, net: Topology | None = None) -> Geometry:
    """Round corners of lanes, lead connections smoothly, and close faulty places that remain; only these places change.

    A lane stays within its old band. A connection stays within its junction's area, and connects the same lanes; if
    there is no room for it, the junction extends into the lanes by up to some metres. Lanes and connections that
    remain faulty get a parameter with the reason; the lanes are closed, and routes do not use the connections.

    `net`: the tree's topology, if the caller has it.
    """
    net = topology_of(root) if net is None else net
    checked = CheckedGeometry.of(net)
    if not checked.faults:
        return Geometry()
    lanes = {lane.get("id", ""): lane for lane in root.iter("lane")}
    lines = _Centrelines(net)
    repaired = [fault for fault in checked.faults if not fault.to and lines.round_corners(fault.lane)]
    if repaired:
        checked = checked.again(_with_lines(net, lanes, lines.write(lanes)))
        lines = _Centrelines(checked.net)
    ways = {movement.ends: movement for movement in net.movements}
    for fault in checked.faults:
        if fault.to and lines.lead(ways[fault.lane, fault.to]):
            repaired.append(fault)
    broken = checked.again(_with_lines(checked.net, lanes, lines.write(lanes))).faults
    for fault in repaired:
        SubElement(lanes[fault.lane], "param", {"key": REPAIRED, "value": fault.where})
    _close(root, lanes, broken)
    return Geometry(tuple(fault.where for fault in repaired), tuple(fault.where for fault in broken))


def _with_lines(net: Topology, elements: Mapping[str, Element], changed: Iterable[str]) -> Topology:
    """Return a net in which the changed lanes have the lines that the tree has now."""
    new = {
        name: replace(
            net.lanes[name],
            shape=points_of(elements[name].attrib["shape"]),
            length_m=float(elements[name].attrib["length"]),
        )
        for name in changed
    }
    edges = {lane.edge for lane in new.values()} & net.edges.keys()
    moved = {
        name: replace(net.edges[name], lanes=tuple(new.get(lane.id, lane) for lane in net.edges[name].lanes))
        for name in edges
    }
    return replace(net, lanes={**net.lanes, **new}, edges={**net.edges, **moved})


def geometry_of(root: Element) -> Geometry:
    """Return the faults that `repair_geometry` has written into a net's tree."""
    values: dict[str, list[str]] = {REPAIRED: [], FAULT: []}
    for param in root.iter("param"):
        if param.get("key") in values:
            values[param.get("key", "")].append(param.get("value", ""))
    return Geometry(tuple(dict.fromkeys(values[REPAIRED])), tuple(values[FAULT]))


def _close(root: Element, lanes: dict[str, Element], broken: Sequence[GeometryFault]) -> None:
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


_REACHES_M = (1.5, 2.0, 3.0, 4.0, 6.0, 9.0)
"""Distances from a corner at which its rounding may begin, m; the first that leaves no kink is used (ours)."""
_SHORTER_M = (0.0, 0.75, 1.5, 3.0, 5.0)
"""Lengths by which lanes may be shortened to make room for a connection, m; the first that suffices is used (ours;
netconvert 1.28 turns around a corner of two streets within 1.6 m, for which another 0.75 m suffice)."""
_LEAST_LANE_M = 2.0
"""Smallest length of a shortened lane, m (ours)."""
_PULLS = (0.35, 0.5, 0.25, 0.65)
"""Distances of the control points of a Bezier curve from its ends, as shares of the distance of the ends; 0.35 comes
nearest to an arc: a quarter of a circle has 0.39, and smaller turns have less (ours).
"""
_SMOOTH_RAD = math.radians(54)
"""Largest turn within 2 m of a repaired line, rad. It is smaller than a kink by the amount that rounding to 1 cm may
add (ours).
"""
_CURVE_POINTS = 12
_MOST_CORNERS = 50
"""Maximum number of corners that are rounded in a lane (ours: a hairpin road in the Alps has some 30)."""


class _Centrelines:
    """The centrelines of a net's lanes, which can be changed and written into its tree."""

    def __init__(self, net: Topology) -> None:
        self._net = net
        self._shapes = {name: lane.shape for name, lane in net.lanes.items()}
        self._changed: dict[str, float] = {}
        """The changed lanes, with the lengths by which they are shorter, m."""
        self._areas = Areas(net)
        self._from: dict[str, list[Movement]] = {}
        self._into: dict[str, list[Movement]] = {}
        for movement in net.movements:
            self._from.setdefault(movement.from_edge, []).append(movement)
            self._into.setdefault(movement.to_edge, []).append(movement)

    def round_corners(self, lane: str) -> bool:
        """Round the kinks of a lane within its band and return True; if that is impossible, change nothing and return
        False."""
        line = rounded(self._shapes[lane], self._net.lanes[lane].width_m / 2)
        if line is None:
            return False
        self._shapes[lane] = line
        self._changed[lane] = lengths(self._net.lanes[lane].shape)[-1] - lengths(line)[-1]
        return True

    def lead(self, movement: Movement) -> bool:
        """Give a connection a smooth line and return True; if there is none, change nothing and return False."""
        if not movement.via:
            return False
        before, after = (self._shapes[name] for name in movement.ends)
        for shorter_m in _SHORTER_M:
            if shorter_m and not self._has_room(movement, shorter_m):
                return False
            line = self._led(movement, _without_end(before, shorter_m), _without_beginning(after, shorter_m))
            if line is not None:
                if shorter_m:
                    self._shorten(movement, shorter_m)
                self._share(movement, line)
                return True
        return False

    def _led(self, movement: Movement, before: Points, after: Points) -> Points | None:
        """Return a smooth line from the end of one lane to the beginning of another within the junction's area; None if
        there is none."""
        if distance(before[-1], after[0]) < LONGEST_GAP_M / 10:
            return None
        here, there = direction(*ending(before)[-2:]), direction(*beginning(after)[:2])
        for pull in _PULLS:
            line = _bezier(before[-1], here, after[0], there, pull)
            whole = joined([ending(before), line, beginning(after)])
            smooth = fault_of_line(whole, "", kink_rad=_SMOOTH_RAD) is None
            if smooth and max(self._areas.beyond(movement.junction, line)) <= FARTHEST_OUTSIDE_M:
                return line
        return None

    def _has_room(self, movement: Movement, shorter_m: float) -> bool:
        lanes = (*self._driven(movement.from_edge), *self._driven(movement.to_edge))
        return all(lengths(self._shapes[name])[-1] >= shorter_m + _LEAST_LANE_M for name in lanes)

    def _driven(self, edge: str) -> list[str]:
        return [lane.id for lane in self._net.edges[edge].lanes if lane.kinds & {"car", "bicycle"}]

    def _shorten(self, movement: Movement, by_m: float) -> None:
        """Shorten all lanes before and behind a junction; its other connections are extended to meet them."""
        for name in self._driven(movement.from_edge):
            old = self._shapes[name]
            self._put(name, _without_end(old, by_m), by_m)
            for other in self._from[movement.from_edge]:
                if other.from_lane == name and other.via:
                    cut = _without_beginning(old, lengths(old)[-1] - by_m)
                    self._put(other.via[0], joined([cut, self._shapes[other.via[0]]]), -by_m)
        for name in self._driven(movement.to_edge):
            old = self._shapes[name]
            self._put(name, _without_beginning(old, by_m), by_m)
            for other in self._into[movement.to_edge]:
                if other.to_lane == name and other.via:
                    cut = _without_end(old, lengths(old)[-1] - by_m)
                    self._put(other.via[-1], joined([self._shapes[other.via[-1]], cut]), -by_m)

    def _share(self, movement: Movement, line: Points) -> None:
        """Divide a connection's line among its lanes, in proportion to their lengths."""
        marks = lengths(line)
        own = [max(lengths(self._shapes[name])[-1], 0.1) for name in movement.via]
        cuts = [marks[-1] * sum(own[:k]) / sum(own) for k in range(len(own) + 1)]
        for name, (a, b) in zip(movement.via, pairwise(cuts), strict=True):
            piece = stretch(line, a, b)
            self._put(name, piece, lengths(self._shapes[name])[-1] - lengths(piece)[-1])

    def _put(self, lane: str, line: Points, shorter_m: float) -> None:
        self._shapes[lane] = line
        self._changed[lane] = self._changed.get(lane, 0.0) + shorter_m

    def write(self, elements: Mapping[str, Element]) -> tuple[str, ...]:
        """Write the changed lines into the net's lanes, with the heights of the old lines; return these lanes' names.

        `elements`: the lanes of the tree by name.
        """
        for name, shorter_m in self._changed.items():
            lane = elements[name]
            lane.set("shape", _with_heights(self._shapes[name], lane.get("shape", "")))
            length_m = self._net.lanes[name].length_m - shorter_m
            lane.set("length", f"{max(length_m, 0.1):.2f}")  # SUMO 1.28 makes shorter lanes 0.1 m long
        return tuple(self._changed)


def _with_heights(line: Points, old: str) -> str:
    """Return the text of a shape, with heights if the old shape has them."""
    points = [tuple(map(float, point.split(","))) for point in old.split()]
    texts = [f"{x:.2f},{y:.2f}" for x, y in line]
    if all(len(point) < 3 for point in points):
        return " ".join(texts)
    marks, along = lengths(line), lengths([(x, y) for x, y, *_ in points])
    heights = [point[2] if len(point) > 2 else 0.0 for point in points]
    at = (mark / max(marks[-1], 0.01) * along[-1] for mark in marks)
    return " ".join(f"{text},{interpolate(s, along, heights):.2f}" for text, s in zip(texts, at, strict=True))


def _without_end(line: Points, by_m: float) -> Points:
    return stretch(line, 0.0, lengths(line)[-1] - by_m) if by_m else line


def _without_beginning(line: Points, by_m: float) -> Points:
    return stretch(line, by_m, lengths(line)[-1]) if by_m else line


def rounded(shape: Points, aside_m: float) -> Points | None:
    """Return a line with its kinks rounded that stays within `aside_m` of the old line; None if that is impossible."""
    line = simplified(shape)
    for _ in range(_MOST_CORNERS):
        k = next((k for k, (angle, _) in enumerate(turns(line)) if abs(angle) > KINK_RAD), None)
        if k is None:
            return line if fault_of_line(line, "") is None else None
        roundings = (candidate for candidate in _roundings(line, k + 1) if _is_near(candidate, shape, aside_m))
        rounding = next(roundings, None)
        if rounding is None:
            return None
        line = simplified(rounding)
    return None


def _roundings(line: Points, corner: int) -> Iterator[Points]:
    """Yield lines in which a smooth curve replaces a corner and its surroundings, with fewer sharp corners."""
    marks = lengths(line)
    over_m = turns(line)[corner - 1][1]
    for reach in _REACHES_M:
        begin, end = max(marks[corner] - reach, 0.0), min(marks[corner] + over_m + reach, marks[-1])
        before, after = stretch(line, 0.0, begin), stretch(line, end, marks[-1])
        for pull in _PULLS:
            here = direction(*before[-2:]) if len(before) > 1 else None
            there = direction(*after[:2]) if len(after) > 1 else None
            curve = _bezier(before[-1], here, after[0], there, pull)
            new = (*before[:-1], *curve, *after[1:])
            if _sharp(new) < _sharp(line):
                yield new


def _sharp(line: Points) -> int:
    """Return the number of sharp corners of a line when it is rounded to 1 cm."""
    written = simplified([(round(x, 2), round(y, 2)) for x, y in line])
    return sum(abs(angle) > _SMOOTH_RAD for angle, _ in turns(written))


def _is_near(line: Points, old: Points, aside_m: float) -> bool:
    return all(distance_to(x, y, old) <= aside_m for x, y in line)


def _bezier(start: XY, here: float | None, end: XY, there: float | None, pull: float) -> Points:
    """Return a cubic Bezier curve between two points with directions at its ends, rad (None: straight)."""
    reach = pull * distance(start, end)
    here, there = (direction(start, end) if way is None else way for way in (here, there))
    control_1 = start[0] + reach * math.cos(here), start[1] + reach * math.sin(here)
    control_2 = end[0] - reach * math.cos(there), end[1] - reach * math.sin(there)
    points = []
    for k in range(_CURVE_POINTS + 1):
        t = k / _CURVE_POINTS
        a, b, c, d = (1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3
        points.append((a * start[0] + b * control_1[0] + c * control_2[0] + d * end[0],
                       a * start[1] + b * control_1[1] + c * control_2[1] + d * end[1]))  # fmt: skip
    return tuple(points)


# ---- overlapping lanes ----------------------------------------------------------------------------------------------


_LEAST_OVERLAP_M = 0.1
"""Length below which an overlap is attributed to rounding, m (ours; netconvert rounds to 1 cm)."""
_BACK_RAD = math.radians(100)
"""A turn from one lane to the next by more than this is a reversal, rad (ours: a usual street corner has 90 degrees).
"""
_STUB_M = 0.2
"""Length to which a lane wholly within the overlap is cut, m (ours: SUMO's shortest lanes in CARLA's towns have
0.13 m)."""


def repair_overlaps(root: Element) -> int:
    """Cut lanes that begin before the previous lane ends, so that no vehicle reverses between the two; return the
    number of repaired pairs of lanes.

    Third-party editions of CARLA's Town03 have such a place: two stubs of 0.2 m inside a roundabout, joined in the
    wrong order, with 7.6 m backwards between them; netconvert 1.28 keeps them. The later lane is cut, and the internal
    lanes after it if it is too short.
    """
    lanes = {lane.get("id", ""): lane for lane in root.iter("lane")}
    ways = {movement.ends: movement.via for movement in topology_of(root).movements}
    repaired = 0
    for (before, after), via in sorted(ways.items()):
        if len(via) != 1 or not {before, after, *via} <= lanes.keys():
            continue
        begin, joint, end = (_points(lanes[name]) for name in (before, via[0], after))
        if min(len(begin), len(joint), len(end)) < 2 or not _turns_back(begin, joint, end):
            continue
        overlap_m = distance(joint[0], joint[-1])
        onward = [inner for (lane, _), inner in ways.items() if lane == after]
        if _shorten_chain([after, *(onward[0] if onward else ())], lanes, overlap_m + _STUB_M):
            for inner in onward[1:]:
                _shorten_chain([after, *inner], lanes, 0.0)
            _write(lanes[via[0]], (begin[-1], _points(lanes[after])[0]))
            repaired += 1
    return repaired


def _turns_back(begin: Sequence[XY], joint: Sequence[XY], end: Sequence[XY]) -> bool:
    back = direction(joint[0], joint[-1])
    return (
        distance(joint[0], joint[-1]) > _LEAST_OVERLAP_M
        and abs(wrap(back - direction(*begin[-2:]))) > _BACK_RAD
        and abs(wrap(back - direction(*end[:2]))) > _BACK_RAD
    )


def _shorten_chain(names: Sequence[str], lanes: dict[str, Element], from_m: float) -> bool:
    """Remove a length from the beginning of a chain of lanes, in which lanes within that length become stubs; return
    True.

    If the chain is too short, change nothing and return False.
    """
    shapes = [_points(lanes[name]) for name in names]
    chain = [shapes[0][0], *(point for shape in shapes for point in shape[1:])]
    ends = list(accumulate(lengths(shape)[-1] for shape in shapes))
    if ends[-1] < from_m + _STUB_M * (len(names) + 1):
        return False
    at = from_m
    for name, end in zip(names, ends, strict=True):
        until = max(end, at + _STUB_M)
        _write(lanes[name], stretch(chain, at, until))
        at = until
    return True


def _write(lane: Element, shape: Sequence[XY]) -> None:
    lane.set("shape", " ".join(f"{x:.2f},{y:.2f}" for x, y in shape))
    lane.set("length", f"{max(lengths(shape)[-1], 0.1):.2f}")  # SUMO 1.28 makes shorter lanes 0.1 m long


def _points(lane: Element) -> Points:
    return points_of(lane.get("shape", ""))
