"""Joins the ends of lanes to junctions, and finds the ways through them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import count, islice

import numpy as np

from foresee_recordings.maps.dividing import Divided, Group, halves
from foresee_recordings.maps.lanes import Lane, without_repeats
from foresee_recordings.recording import FloatArray, RecordingError

_SHORT_M = 40.0
"""A road of at most this length that begins and ends at one junction lies inside it, m. Ours: turns for vehicles on the
right that cross no lane are that long."""
_LEAST_M = 1.5
"""Roads between others that are shorter lie inside junctions, m. Ours: too short to smooth a kink at their ends; with 4
m, vehicles on INTERACTION's roundabouts could not change lanes where they did."""
_LONGEST_M = 500.0
"""Longest way through a junction, m. Ours: once around a large roundabout."""
_MOST_WAYS = 200
"""Largest number of ways from one lane through a junction. Ours: against maps whose lanes form a lattice."""
_MOST_IN_ALL = 100_000
"""Largest number of ways through junctions. Ours: a map of a town has some thousand."""


@dataclass(frozen=True)
class Road:
    """An edge: its id, its lanes from the right, and the numbers of the junctions at its ends."""

    id: str
    lanes: tuple[Lane, ...]
    start: int
    end: int


@dataclass(frozen=True)
class LaneLink:
    """A way from a lane of a road to a lane of the next: edge and index of both, and the centre line between them.

    `shape` is [N, 2] m; None if the lanes touch. `lanes` are the ids of the lanes between.
    """

    start: tuple[str, int]
    end: tuple[str, int]
    shape: FloatArray | None
    speed_mps: float | None
    lanes: tuple[str, ...]


@dataclass(frozen=True)
class Layout:
    """The roads and junctions of a network.

    Attributes:
        places: position of each junction, m, by its number.
        left_out: what of the map is not used, with counts.
    """

    roads: tuple[Road, ...]
    ways: tuple[LaneLink, ...]
    places: Mapping[int, tuple[float, float]]
    left_out: Mapping[str, int]


class _Joints:
    """The ends of groups and of lanes inside junctions, joined where they meet (union-find)."""

    def __init__(self) -> None:
        self._parent: dict[tuple[str, str], tuple[str, str]] = {}

    def root(self, end: tuple[str, str]) -> tuple[str, str]:
        at = end
        while (up := self._parent.setdefault(at, at)) != at:
            self._parent[at] = at = self._parent[up]
        return at

    def join(self, first: tuple[str, str], other: tuple[str, str]) -> None:
        self._parent[self.root(other)] = self.root(first)


def layout_of(divided: Divided) -> Layout:
    """Return the roads, junctions and ways of a divided map."""
    divided = _without_loops(divided)
    joints = _joints(divided)
    numbers: dict[tuple[str, str], int] = {}
    roads: list[Road] = []
    at_lane: dict[str, tuple[str, int]] = {}
    names: set[str] = set()
    for group in divided.roads:
        ends = [numbers.setdefault(joints.root((group[0], end)), len(numbers)) for end in ("start", "end")]
        road = Road(_edge_id(group[0], names), tuple(_with_rules(divided, id_) for id_ in group), *ends)
        roads.append(road)
        at_lane.update({id_: (road.id, index) for index, id_ in enumerate(group)})
    left_out = Counter(divided.left_out)
    ways = list(islice(_ways(divided, at_lane, left_out), _MOST_IN_ALL + 1))
    if len(ways) > _MOST_IN_ALL:
        raise RecordingError(f"the map has more than {_MOST_IN_ALL:,} ways through junctions: cut out a part")
    used = {id_ for way in ways for id_ in way.lanes}
    unused = {divided.source.get(id_, id_) for id_ in divided.inside - used}
    if unused:
        left_out["lanes inside junctions that no road leads to and from"] += len(unused)
    return Layout(tuple(roads), tuple(ways), _places(roads), left_out)


def _with_rules(divided: Divided, id_: str) -> Lane:
    """Return a lane that has the right of way and the signal of the lane inside the junction that follows it, as maps
    give them either to the lane before the stop line or to the one behind it."""
    lane = divided.lanes[id_]
    onward = [divided.lanes[other] for other in lane.successors if other in divided.inside]
    way = lane.way or next((other.way for other in onward if other.way), "")
    signal = lane.signal or next((other.signal for other in onward if other.signal), "")
    return replace(lane, way=way, signal=signal)


def _edge_id(lane: str, names: set[str]) -> str:
    """Return the id of the edge whose rightmost lane has an id of the map, and add it to the names of the others."""
    name = "e" + "".join(character if character.isascii() and character.isalnum() else "_" for character in lane)
    free = next(id_ for k in count() if (id_ := f"{name}_{k + 1}" if k else name) not in names)
    names.add(free)
    return free


def _joints(divided: Divided) -> _Joints:
    joints = _Joints()
    first_of = {id_: group[0] for group in divided.roads for id_ in group}
    for id_, lane in divided.lanes.items():
        own = first_of.get(id_, id_)
        for other in lane.successors:
            joints.join((own, "end"), (first_of.get(other, other), "start"))
    for id_ in divided.inside:
        joints.join((id_, "start"), (id_, "end"))
    for first, other in divided.crossings:
        joints.join((first, "start"), (other, "start"))
    return joints


def _without_loops(divided: Divided) -> Divided:
    """Return a map in which no road begins and ends at one junction: short ones move inside, long ones are cut."""
    divided = _without_short_roads(divided)
    joints = _joints(divided)
    roads: list[Group] = []
    inside = set(divided.inside)
    source = dict(divided.source)
    for group in divided.roads:
        if joints.root((group[0], "start")) != joints.root((group[0], "end")):
            roads.append(group)
            continue
        own = [divided.lanes[id_] for id_ in group]
        passed = all(lane.predecessors and lane.successors for lane in own)
        if passed and max(lane.length_m for lane in own) <= _SHORT_M:
            inside.update(group)
            continue
        lanes, first, second = halves(divided.lanes, group)
        divided = replace(divided, lanes=lanes)
        source.update({name: source[id_] for parts in (first, second) for name, id_ in zip(parts, group, strict=True)})
        roads += [first, second]
    return replace(divided, roads=tuple(roads), inside=frozenset(inside), source=source)


def _without_short_roads(divided: Divided) -> Divided:
    """Return a map whose shortest roads lie inside junctions."""
    short = {
        group
        for group in divided.roads
        if all(
            lane.predecessors and lane.successors and lane.length_m < _LEAST_M
            for lane in (divided.lanes[id_] for id_ in group)
        )
    }
    roads = tuple(group for group in divided.roads if group not in short)
    return replace(divided, roads=roads, inside=divided.inside.union(*short)) if roads else divided


def _ways(divided: Divided, at_lane: Mapping[str, tuple[str, int]], left_out: Counter[str]) -> Iterator[LaneLink]:
    """Yield all ways from a road's lane to the next road's lane; of several with the same ends, the shortest."""
    lanes = divided.lanes
    for id_, start in at_lane.items():
        best: dict[tuple[str, int], tuple[float, tuple[str, ...]]] = {}
        for path in _paths(lanes, id_, at_lane, left_out):
            length_m = sum(lanes[step].length_m for step in path[:-1])
            end = at_lane[path[-1]]
            if end not in best or length_m < best[end][0]:
                best[end] = length_m, path[:-1]
        for end, (_, path) in best.items():
            limits = [limit for step in path if (limit := lanes[step].speed_mps) is not None]
            shape = without_repeats(np.concatenate([lanes[step].centre for step in path])) if path else None
            yield LaneLink(start, end, shape, min(limits, default=None), path)


def _paths(
    lanes: Mapping[str, Lane], id_: str, at_lane: Mapping[str, tuple[str, int]], left_out: Counter[str]
) -> Iterator[tuple[str, ...]]:
    """Yield the paths from a road's lane through lanes inside junctions to a road's lane, which ends each path."""
    complete = 0
    waiting: list[tuple[tuple[str, ...], float]] = [((other,), 0.0) for other in reversed(lanes[id_].successors)]
    while waiting:
        path, length_m = waiting.pop()
        if path[-1] in at_lane:
            complete += 1
            yield path
            continue
        length_m += lanes[path[-1]].length_m
        if length_m > _LONGEST_M or complete >= _MOST_WAYS or len(waiting) > _MOST_WAYS:
            left_out["ways through junctions, too long or too many"] += 1
            continue
        onward = reversed(lanes[path[-1]].successors)
        waiting += [((*path, other), length_m) for other in onward if other not in path]


def _places(roads: list[Road]) -> dict[int, tuple[float, float]]:
    """Return the middle of the ends of the roads at each junction."""
    ends: dict[int, list[FloatArray]] = {}
    for road in roads:
        for lane in road.lanes:
            ends.setdefault(road.start, []).append(lane.centre[0])
            ends.setdefault(road.end, []).append(lane.centre[-1])
    middles = {number: np.mean(points, axis=0) for number, points in ends.items()}
    return {number: (float(x), float(y)) for number, (x, y) in middles.items()}
