"""Divides a map of lanes into those of roads and those inside junctions, which cross others."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely

from foresee_recordings.maps.lanes import Lane
from foresee_recordings.recording import RecordingError

_ENDS_M = 1.0
"""Lines that meet within this distance of an end of one of them do not cross, m. Ours: lanes that join or separate meet
at their ends, and maps are drawn to some decimetres."""
_ROOM_M = 8.0
"""Length of a lane that stays inside the junction before its first and behind its last crossing, m. Ours: half of a
crossing lane's width and a vehicle's length."""
_LEAST_PART_M = 25.0
"""Shortest part of a crossing lane that becomes a road of its own, m. Ours: shorter ones end at the stop line."""
_STUB_M = 6.0
"""Length of the road that leads into a junction at the map's border, m. Ours: a vehicle's length."""
_STEP_M = 5.0
"""Farthest that the ends of adjacent lanes may lie apart in the driving direction, m. Ours: lanes of one edge begin and
end together in SUMO."""

_APART_M = 5.0
"""Farthest distance from the end of a lane to the beginning of the next, m. Ours: a wide lane's width; the maps of
OSC_Overtake and DEU_Muc-3 have relations over 45 m and back."""

_LEAST_M = 0.05
"""Least length of a lane, m. Ours: SUMO's lanes are at least 0.1 m long."""
_MOST_CROSSINGS, _AT_ONCE = 100_000, 100
"""Largest number of pairs of lanes that cross, and the number of lanes that are searched at once. Ours: a map of a town
has some thousand pairs; a lattice of lanes in a file of 100 MB would have 1e8."""

Group = tuple[str, ...]
"""Ids of adjacent lanes in one direction, from the right."""


@dataclass(frozen=True)
class Divided:
    """A map that is divided: its lanes by id, the groups of those on roads, and those inside junctions.

    Attributes:
        crossings: pairs of lanes inside junctions that cross each other.
        source: for each lane the id of the map's lane of which it is a part.
        left_out: what of the map is not used, with counts.
    """

    lanes: Mapping[str, Lane]
    roads: tuple[Group, ...]
    inside: frozenset[str]
    crossings: tuple[tuple[str, str], ...]
    source: Mapping[str, str]
    left_out: Mapping[str, int]


def divide(lanes: Mapping[str, Lane], *, junctions: bool = True) -> Divided:
    """Divide a map. Lanes that cross others are cut before the first and behind the last crossing.

    Args:
        junctions: whether lanes that cross lie inside junctions.
    """
    left_out: Counter[str] = Counter()
    lanes = _linked(lanes, left_out)
    crossings = list(_crossings(lanes)) if junctions else []
    shares: dict[str, list[float]] = {}
    for pair, at in crossings:
        for id_, share in zip(pair, at, strict=True):
            shares.setdefault(id_, []).append(share)
    parts: dict[str, list[str]] = {}
    cut: dict[str, Lane] = {}
    roads: list[Group] = []
    inside: set[str] = set()
    for group in _groups(lanes):
        crossed = [share for id_ in group for share in shares.get(id_, ())]
        marks = _cuts([lanes[id_] for id_ in group], crossed) if crossed else [0.0, 1.0]
        for id_ in group:
            pieces = _pieces(lanes[id_], marks)
            parts[id_] = list(pieces)
            cut |= pieces
        for k, (begin, end) in enumerate(pairwise(marks)):
            members = tuple(parts[id_][k] for id_ in group)
            if any(begin <= share <= end for share in crossed):
                inside.update(members)
            else:
                roads.append(members)
    inner = {id_: next((name for name in names if name in inside), "") for id_, names in parts.items()}
    return Divided(
        lanes=_relinked(lanes, parts, cut),
        roads=tuple(roads),
        inside=frozenset(inside),
        crossings=tuple((inner[first], inner[other]) for (first, other), _ in crossings),
        source={name: id_ for id_, names in parts.items() for name in names},
        left_out=left_out,
    )


def _linked(lanes: Mapping[str, Lane], left_out: Counter[str]) -> dict[str, Lane]:
    """Return lanes whose relations name existing lanes only, and are the same from both sides."""
    short = {id_ for id_, lane in lanes.items() if lane.length_m < _LEAST_M}
    if short:
        left_out["lanes without a length"] += len(short)
        lanes = {id_: lane for id_, lane in lanes.items() if id_ not in short}
    onward: dict[str, dict[str, None]] = {id_: {} for id_ in lanes}
    for id_, lane in lanes.items():
        onward[id_].update(dict.fromkeys(other for other in lane.successors if other in lanes))
        for other in lane.predecessors:
            if other in lanes:
                onward[other][id_] = None
    before: dict[str, list[str]] = {id_: [] for id_ in lanes}
    for id_, others in onward.items():
        for other in list(others):
            if np.hypot(*(lanes[other].centre[0] - lanes[id_].centre[-1])) > _APART_M:
                left_out["relations of lanes to lanes that begin elsewhere"] += 1
                del others[other]
            else:
                before[other].append(id_)
    return {
        id_: replace(lane, predecessors=tuple(before[id_]), successors=tuple(onward[id_]))
        for id_, lane in lanes.items()
    }


def halves(lanes: Mapping[str, Lane], group: Group) -> tuple[dict[str, Lane], Group, Group]:
    """Return lanes with a group of them cut in its middle, and the two new groups."""
    parts = {id_: [id_] for id_ in lanes}
    cut = dict(lanes)
    for id_ in group:
        pieces = _pieces(lanes[id_], [0.0, 0.5, 1.0])
        parts[id_] = list(pieces)
        cut |= pieces
    first, second = (tuple(parts[id_][k] for id_ in group) for k in (0, 1))
    return _relinked(lanes, parts, cut), first, second


def _groups(lanes: Mapping[str, Lane]) -> Iterator[Group]:
    """Yield the groups of adjacent lanes that begin and end together."""
    left_of = {}
    for id_, lane in lanes.items():
        other = lane.left_neighbour
        if other in lanes and lanes[other].right_neighbour in ("", id_) and _beside(lane, lanes[other]):
            left_of[id_] = other
    rightmost = [id_ for id_ in lanes if id_ not in left_of.values()]
    done: set[str] = set()
    for id_ in (*rightmost, *lanes):  # a circle of neighbours, a fault of the map, has no rightmost lane
        group = []
        at: str | None = id_
        while at is not None and at not in done:
            group.append(at)
            done.add(at)
            at = left_of.get(at)
        if group:
            yield tuple(group)


def _beside(lane: Lane, other: Lane) -> bool:
    """Return whether two adjacent lanes begin and end together."""
    for k, before in ((0, 1), (-1, -2)):
        ahead = lane.centre[before] - lane.centre[k] if k == 0 else lane.centre[k] - lane.centre[before]
        apart = other.centre[k] - lane.centre[k]
        if abs(apart @ ahead) / max(float(np.hypot(*ahead)), 1e-9) > _STEP_M:
            return False
    return True


def _crossings(lanes: Mapping[str, Lane]) -> Iterator[tuple[tuple[str, str], tuple[float, float]]]:
    """Yield pairs of lanes that cross, with the shares of their lengths at which they do."""
    ids = [id_ for id_, lane in lanes.items() if lane.type != "shoulder"]
    if not ids:
        return
    lines = [shapely.LineString(lanes[id_].centre) for id_ in ids]
    for first, other in _pairs(lines):
        if _meet(lanes[ids[first]], lanes[ids[other]]):
            continue
        line, other_line = lines[first], lines[other]
        for point in shapely.get_parts(shapely.intersection(line, other_line)):
            if point.geom_type != "Point":  # the lines run together
                continue
            s, other_s = line.project(point), other_line.project(point)
            if _ENDS_M < s < line.length - _ENDS_M and _ENDS_M < other_s < other_line.length - _ENDS_M:
                yield (ids[first], ids[other]), (s / line.length, other_s / other_line.length)


def _pairs(lines: Sequence[shapely.LineString]) -> list[tuple[int, int]]:
    """Return the indices of lines that cross, the smaller one first.

    Raises:
        RecordingError: there are more than any real map has.
    """
    tree = shapely.STRtree(lines)
    pairs: list[tuple[int, int]] = []
    for begin in range(0, len(lines), _AT_ONCE):
        crossing = tree.query(lines[begin : begin + _AT_ONCE], predicate="crosses").T.tolist()
        pairs += [(begin + first, other) for first, other in crossing if begin + first < other]
        if len(pairs) > _MOST_CROSSINGS:
            raise RecordingError(f"the map has more than {_MOST_CROSSINGS:,} pairs of lanes that cross: cut out a part")
    return pairs


def _meet(lane: Lane, other: Lane) -> bool:
    """Return whether two lanes follow each other, begin at one lane or end at one lane."""
    return (
        other.id in (*lane.successors, *lane.predecessors)
        or not set(lane.successors).isdisjoint(other.successors)
        or not set(lane.predecessors).isdisjoint(other.predecessors)
    )


def _cuts(group: list[Lane], crossed: list[float]) -> list[float]:
    """Return the shares at which a crossing group is cut, with 0 and 1."""
    length_m = min(lane.length_m for lane in group)
    marks = [0.0]
    free_m = min(crossed) * length_m - _ROOM_M
    if free_m >= _LEAST_PART_M:
        marks.append(free_m / length_m)
    elif any(not lane.predecessors for lane in group):
        marks.append(min(_STUB_M / length_m, min(crossed) / 2))
    free_m = (1.0 - max(crossed)) * length_m - _ROOM_M
    if free_m >= _LEAST_PART_M:
        marks.append(1.0 - free_m / length_m)
    elif any(not lane.successors for lane in group):
        marks.append(max(1.0 - _STUB_M / length_m, (1.0 + max(crossed)) / 2))
    return [*marks, 1.0]


def _pieces(lane: Lane, marks: list[float]) -> dict[str, Lane]:
    """Return a lane's pieces between shares of its length, by their ids; the lane itself if it is not cut."""
    if len(marks) == 2:
        return {lane.id: lane}
    pieces = {}
    for k, (begin, end) in enumerate(pairwise(marks)):
        left, right = lane.part(begin, end)
        pieces[f"{lane.id}.{k}"] = replace(lane, id=f"{lane.id}.{k}", left=left, right=right)
    return pieces


def _relinked(lanes: Mapping[str, Lane], parts: Mapping[str, list[str]], cut: Mapping[str, Lane]) -> dict[str, Lane]:
    """Return cut lanes with the relations of the lanes of which they are parts."""
    result = {}
    for id_, names in parts.items():
        for k, name in enumerate(names):
            last, first = k == len(names) - 1, k == 0
            onward = tuple(parts[o][0] for o in lanes[id_].successors) if last else (names[k + 1],)
            before = tuple(parts[o][-1] for o in lanes[id_].predecessors) if first else (names[k - 1],)
            lane = cut[name]
            result[name] = replace(
                lane,
                successors=onward,
                predecessors=before,
                signal=lane.signal if first else "",  # the crossing that cuts the lane lies ahead of its first part
                way=lane.way if first else "",
            )
    return result
