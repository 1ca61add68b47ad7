"""Repairs nets with overlapping lanes: if a lane begins before the previous lane ends, vehicles would have to
reverse."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.nets.net_reader import points_of, topology_of
from foresee_dsl.compile.roads.polyline import XY, Points, direction, distance, interpolate, lengths, wrap

_LEAST_M = 0.1
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
        begin, joint, end = (_shape(lanes[name]) for name in (before, via[0], after))
        if min(len(begin), len(joint), len(end)) < 2 or not _turns_back(begin, joint, end):
            continue
        overlap_m = distance(joint[0], joint[-1])
        onward = [inner for (lane, _), inner in ways.items() if lane == after]
        if _cut([after, *(onward[0] if onward else ())], lanes, overlap_m + _STUB_M):
            for inner in onward[1:]:
                _cut([after, *inner], lanes, 0.0)
            _put(lanes[via[0]], (begin[-1], _shape(lanes[after])[0]))
            repaired += 1
    return repaired


def _turns_back(begin: Sequence[XY], joint: Sequence[XY], end: Sequence[XY]) -> bool:
    back = direction(joint[0], joint[-1])
    return (
        distance(joint[0], joint[-1]) > _LEAST_M
        and abs(wrap(back - direction(*begin[-2:]))) > _BACK_RAD
        and abs(wrap(back - direction(*end[:2]))) > _BACK_RAD
    )


def _cut(names: Sequence[str], lanes: dict[str, Element], from_m: float) -> bool:
    """Remove a length from the beginning of a chain of lanes, in which lanes within that length become stubs; return
    True.

    If the chain is too short, change nothing and return False.
    """
    shapes = [_shape(lanes[name]) for name in names]
    chain = [shapes[0][0], *(point for shape in shapes for point in shape[1:])]
    ends = list(accumulate(lengths(shape)[-1] for shape in shapes))
    if ends[-1] < from_m + _STUB_M * (len(names) + 1):
        return False
    at = from_m
    for name, end in zip(names, ends, strict=True):
        until = max(end, at + _STUB_M)
        _put(lanes[name], _between(chain, at, until))
        at = until
    return True


def _between(points: Sequence[XY], from_m: float, to_m: float) -> Points:
    """Return the stretch of a line between two positions along it."""
    marks, (xs, ys) = lengths(points), zip(*points, strict=True)
    first, last = ((interpolate(at, marks, xs), interpolate(at, marks, ys)) for at in (from_m, to_m))
    inner = (point for point, at in zip(points, marks, strict=True) if from_m + 1e-6 < at < to_m - 1e-6)
    return (first, *inner, last)


def _put(lane: Element, shape: Sequence[XY]) -> None:
    lane.set("shape", " ".join(f"{x:.2f},{y:.2f}" for x, y in shape))
    lane.set("length", f"{max(lengths(shape)[-1], 0.1):.2f}")  # SUMO 1.28 makes shorter lanes 0.1 m long


def _shape(lane: Element) -> Points:
    return points_of(lane.get("shape", ""))
