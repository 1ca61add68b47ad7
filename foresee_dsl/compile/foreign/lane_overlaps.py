"""Mends nets whose lanes overlap: where the next lane begins before the last one ends, vehicles would turn back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from foresee_dsl.compile.roads.polyline import XY, distance, wrap

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_LEAST_M = 0.1
"""Lanes that overlap by less are a slip of rounding (ours; netconvert rounds to 1 cm)."""
_BACK_RAD = math.radians(100)
"""Who turns by more from one lane to the next turns back (ours: a corner of a town is 90 degrees)."""
_STUB_M = 0.2
"""How long a lane stays that lies within the overlap altogether (ours: SUMO's shortest lanes in CARLA's towns have
0.13 m)."""


def mend_overlaps(root: Element) -> int:
    """Cut lanes that begin before the lane that leads to them ends, so that nobody turns back between the two.

    Third-party editions of CARLA's Town03 have such a place: two stubs of 0.2 m inside one roundabout, joined in the
    wrong order, with 7.6 m backwards between them. The lane behind it gives way, as far as need be the junction's
    lanes after it.

    Args:
        root: of a SUMO net; changed in place.

    Returns:
        How many pairs of lanes were mended.
    """
    lanes = {lane.get("id", ""): lane for lane in root.iter("lane")}
    ways = _ways(root)
    mended = 0
    for (before, after), via in sorted(ways.items()):
        if len(via) != 1 or not {before, after, *via} <= lanes.keys():
            continue
        begin, joint, end = (_shape(lanes[name]) for name in (before, via[0], after))
        if min(len(begin), len(joint), len(end)) < 2 or not _turns_back(begin, joint, end):
            continue
        overlap_m = distance(joint[0], joint[-1])
        onward = [inner for (lane, _), inner in ways.items() if lane == after]
        if _cut([after, *(onward[0] if onward else ())], lanes, overlap_m + _STUB_M):
            for inner in onward[1:]:
                _cut([after, *inner], lanes, 0.0)
            _put(lanes[via[0]], (begin[-1], _shape(lanes[after])[0]))
            mended += 1
    return mended


def _ways(root: Element) -> dict[tuple[str, str], tuple[str, ...]]:
    """The lanes inside a junction on the way from one lane to another."""
    found: dict[tuple[str, str], tuple[str, ...]] = {}
    connections = list(root.iterfind("connection"))
    inner = {_from(c): c.get("via", "") for c in connections if c.get("from", "").startswith(":") and c.get("via")}
    for connection in connections:
        if connection.get("from", ":").startswith(":") or connection.get("to", ":").startswith(":"):
            continue
        via, step = [], connection.get("via", "")
        while step and step not in via:
            via.append(step)
            step = inner.get(step, "")
        found[_from(connection), f"{connection.get('to')}_{connection.get('toLane')}"] = tuple(via)
    return found


def _from(connection: Element) -> str:
    return f"{connection.get('from')}_{connection.get('fromLane')}"


def _turns_back(begin: Sequence[XY], joint: Sequence[XY], end: Sequence[XY]) -> bool:
    back = _angle(joint[0], joint[-1])
    return (
        distance(joint[0], joint[-1]) > _LEAST_M
        and abs(wrap(back - _angle(*begin[-2:]))) > _BACK_RAD
        and abs(wrap(back - _angle(*end[:2]))) > _BACK_RAD
    )


def _cut(names: Sequence[str], lanes: dict[str, Element], from_m: float) -> bool:
    """Let a chain of lanes begin so far behind its beginning; those before that become stubs.

    Returns:
        Whether there is enough of it; nothing is changed where there is not.
    """
    shapes = [_shape(lanes[name]) for name in names]
    chain = [shapes[0][0], *(point for shape in shapes for point in shape[1:])]
    ends: list[float] = []
    for shape in shapes:
        ends.append((ends[-1] if ends else 0.0) + _length(shape))
    if ends[-1] < from_m + _STUB_M * (len(names) + 1):
        return False
    at = from_m
    for name, end in zip(names, ends, strict=True):
        until = max(end, at + _STUB_M)
        _put(lanes[name], _between(chain, at, until))
        at = until
    return True


def _between(points: Sequence[XY], from_m: float, to_m: float) -> tuple[XY, ...]:
    """The stretch of a line between two lengths along it."""
    at, inner = 0.0, []
    for a, b in pairwise(points):
        at += distance(a, b)
        if from_m + 1e-6 < at < to_m - 1e-6:
            inner.append(b)
    return (_point(points, from_m), *inner, _point(points, to_m))


def _point(points: Sequence[XY], at_m: float) -> XY:
    for a, b in pairwise(points):
        step = distance(a, b)
        if at_m <= step and step > 0:
            return a[0] + (b[0] - a[0]) * at_m / step, a[1] + (b[1] - a[1]) * at_m / step
        at_m -= step
    return points[-1]


def _put(lane: Element, shape: Sequence[XY]) -> None:
    lane.set("shape", " ".join(f"{x:.2f},{y:.2f}" for x, y in shape))
    lane.set("length", f"{max(_length(shape), 0.1):.2f}")  # SUMO knows no lane shorter than that


def _shape(lane: Element) -> tuple[XY, ...]:
    pairs = (pair.split(",") for pair in lane.get("shape", "").split())
    return tuple((float(pair[0]), float(pair[1])) for pair in pairs)


def _length(shape: Sequence[XY]) -> float:
    return sum(distance(a, b) for a, b in pairwise(shape))


def _angle(a: XY, b: XY) -> float:
    return math.atan2(b[1] - a[1], b[0] - a[0])
