"""Builds the SUMO network of a map of lanes, with netconvert."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from foresee_dsl.compile.foreign.geometry_faults import NARROWEST_M
from foresee_dsl.compile.foreign.networks import write_net
from foresee_dsl.compile.nets.netconvert import run_netconvert
from foresee_dsl.compile.nets.plain_edges import SPEED_MPS
from foresee_dsl.compile.nets.safe_xml import parse_net
from foresee_dsl.compile.templates import environment
from foresee_dsl.errors import CompileError
from foresee_recordings.maps.conflicts import add_conflicts
from foresee_recordings.maps.dividing import divide
from foresee_recordings.maps.junctions import LaneLink, Layout, Road, layout_of
from foresee_recordings.maps.lanes import Lane, LaneMap
from foresee_recordings.maps.net_geometry import set_lines, simplified
from foresee_recordings.maps.signals import SignalCycle, set_programs
from foresee_recordings.recording import FloatArray, RecordedMap, RecordingError, Track

_MOTOR = ("car", "van", "truck", "bus", "motorcycle")
_FAST_PERCENT = 95.0
"""Share of samples below the speed that a road without a limit allows, percent. Ours: single errors do not count."""
_FAR_M = 1e5
"""Largest coordinate of a map that is not moved, m. Ours: above local maps, below UTM's (1e6 m)."""
_LEAST_WIDTH_M = 0.5
"""Smallest width of a lane, m. Ours: lanes may begin or end with a width of 0."""
_OPTIONS = (  # of netconvert 1.28
    *("--no-internal-links", "false"),  # vehicles follow lanes inside junctions
    *("--offset.disable-normalization", "true"),  # coordinates stay those of the file
    *("--no-turnarounds", "true"),
    *("--precision", "3"),  # millimetres
    *("--no-warnings", "true"),
)
_CYCLE_LANE_M = 0.9
"""Least width of a lane for bicycles, m. Ours: a bicycle is 0.65 m wide."""
_PRIORITIES = {"priority": 3, "": 2, "yield": 1, "stop": 1}
"""SUMO's priority of an edge by the right of way at its end."""
_ALLOW = {"road": "", "bus": "bus", "bicycle": "bicycle", "shoulder": ""}
"""SUMO's classes that may use a lane; "" for all (a shoulder is closed)."""
_STRIP_TYPES = {"road": "", "bus": "bus_lane", "bicycle": "cycle_lane", "shoulder": "shoulder"}
"""The core's types of lanes that are part of the carriageway and not for cars."""
_TEMPLATES = Path(__file__).parent.parent / "templates"


class _Node(NamedTuple):
    id: str
    at: tuple[float, float]
    type: str


class _PlainLane(NamedTuple):
    width: float
    speed: float
    allow: str
    closed: bool
    type: str
    shape: list[tuple[float, float]]


class _PlainEdge(NamedTuple):
    id: str
    start: str
    end: str
    priority: int
    speed: float
    shape: list[tuple[float, float]]
    lanes: list[_PlainLane]


class _PlainConnection(NamedTuple):
    start: tuple[str, int]
    end: tuple[str, int]
    speed: float | None
    shape: list[tuple[float, float]] | None


@dataclass(frozen=True)
class _Frame:
    """The shift of the map to the network, m, and the speed limit of lanes without one, m/s."""

    offset: FloatArray
    speed_mps: float

    def points(self, line: FloatArray) -> list[tuple[float, float]]:
        """Return a line of the map in the network."""
        return [(float(x), float(y)) for x, y in simplified(line + self.offset)]

    def point(self, at: tuple[float, float]) -> tuple[float, float]:
        """Return a point of the map in the network."""
        return at[0] + float(self.offset[0]), at[1] + float(self.offset[1])

    def speed(self, lane: Lane) -> float:
        return self.speed_mps if lane.speed_mps is None else lane.speed_mps


def network_of(
    lane_map: LaneMap,
    speed_mps: float = SPEED_MPS,
    *,
    junctions: bool = True,
    cycles: Mapping[str, SignalCycle] = MappingProxyType({}),
) -> RecordedMap:
    """Return the SUMO network of a map of lanes; equal maps give equal bytes.

    Args:
        speed_mps: speed limit of lanes without one.
        junctions: whether lanes that cross become a junction.
        cycles: colours of the traffic lights, by their ids.

    Raises:
        RecordingError: netconvert refuses the map, or exceeds its limits.
    """
    fitted = {id_: _fitted(lane) for id_, lane in lane_map.lanes.items()}
    layout = layout_of(divide(fitted, junctions=junctions))
    if not layout.roads:
        raise RecordingError("the map has no road for vehicles")
    frame = _Frame(_offset(lane_map.lanes.values()), speed_mps)
    with tempfile.TemporaryDirectory(prefix="foresee-lanes-") as name:
        folder = Path(name)
        files = _write_plain(folder, layout, frame)
        try:
            run_netconvert([*files, *_OPTIONS, "--output-file", "net.net.xml"], folder)
        except CompileError as err:
            raise RecordingError(f"the map of lanes cannot be converted: {err}") from err
        net = parse_net(folder / "net.net.xml")
        add_conflicts(net, set_lines(net, layout, lambda line: line + frame.offset))
        signals = set_programs(net, _cycles_at(layout, cycles))
        write_net(net, folder / "net.net.xml")
        text = (folder / "net.net.xml").read_text(encoding="utf-8")
    x, y = (float(value) for value in frame.offset)
    return RecordedMap(text, ".net.xml", (x, y), tuple(_notes(lane_map, layout, speed_mps, signals)))


def usual_speed(tracks: Iterable[Track]) -> float:
    """Return a speed limit for lanes without one, m/s: the usual urban one, or that of faster recorded vehicles."""
    speeds = [track.states[:, 3] for track in tracks if track.kind in _MOTOR]
    if not speeds:
        return SPEED_MPS
    fast = float(np.percentile(np.concatenate(speeds), _FAST_PERCENT))
    return max(SPEED_MPS, math.ceil(fast * 3.6 / 10) * 10 / 3.6)


def _offset(lanes: Iterable[Lane]) -> FloatArray:
    """Return the shift that brings a map that is far from the origin there, in whole metres."""
    points = np.concatenate([lane.centre for lane in lanes])
    if np.abs(points).max() < _FAR_M:
        return np.zeros(2)
    offset: FloatArray = -np.floor(points.min(axis=0))
    return offset


def _write_plain(folder: Path, layout: Layout, frame: _Frame) -> list[str]:
    """Write netconvert's input files; return the options that name them."""
    from_edges = {way.start[0] for way in layout.ways}
    contents: dict[str, dict[str, object]] = {
        "nodes.nod.xml": {"nodes": _nodes(layout, frame)},
        "edges.edg.xml": {"edges": [_edge(road, frame) for road in layout.roads]},
        "connections.con.xml": {
            "connections": [_connection(way, frame) for way in layout.ways],
            "dead_ends": [road.id for road in layout.roads if road.id not in from_edges],
        },
    }
    jinja = environment(str(_TEMPLATES))
    for name, values in contents.items():
        text = jinja.get_template(f"{name}.j2").render(**values)
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    options = ("--node-files", "--edge-files", "--connection-files")
    return [word for option, name in zip(options, contents, strict=True) for word in (option, name)]


def _nodes(layout: Layout, frame: _Frame) -> list[_Node]:
    types = _node_types(layout.roads)
    return [_Node(f"j{number}", frame.point(at), types.get(number, "priority")) for number, at in layout.places.items()]


def _node_types(roads: Iterable[Road]) -> Mapping[int, str]:
    """Return SUMO's types of the junctions that roads lead to, by what stands at their lanes' ends."""
    ends: dict[int, list[Lane]] = {}
    for road in roads:
        ends.setdefault(road.end, []).extend(road.lanes)
    return {number: _node_type(lanes) for number, lanes in ends.items()}


def _node_type(lanes: list[Lane]) -> str:
    if any(lane.signal for lane in lanes):
        return "traffic_light"
    if all(lane.way == "stop" for lane in lanes):
        return "allway_stop"
    return "priority_stop" if any(lane.way == "stop" for lane in lanes) else "priority"


def _edge(road: Road, frame: _Frame) -> _PlainEdge:
    lanes = [
        _PlainLane(
            width=max(lane.width_m, _LEAST_WIDTH_M),
            speed=frame.speed(lane),
            allow=_ALLOW[lane.type],
            closed=_closed(lane),
            type="shoulder" if _closed(lane) else _STRIP_TYPES[lane.type],
            shape=frame.points(lane.centre),
        )
        for lane in road.lanes
    ]
    middle = road.lanes[len(road.lanes) // 2].centre
    priority = min(_PRIORITIES[lane.way] for lane in road.lanes)
    speed = max(lane.speed for lane in lanes)
    return _PlainEdge(road.id, f"j{road.start}", f"j{road.end}", priority, speed, frame.points(middle), lanes)


def _fitted(lane: Lane) -> Lane:
    """Return a lane with a type that its width allows."""
    if lane.type != "road" or lane.width_m >= NARROWEST_M:
        return lane
    return replace(lane, type="bicycle" if lane.width_m >= _CYCLE_LANE_M else "shoulder")


def _closed(lane: Lane) -> bool:
    """Return whether no vehicle may use a lane, which is then a part of the carriageway only."""
    return lane.type == "shoulder" or (lane.type == "road" and lane.width_m < NARROWEST_M)


def _connection(way: LaneLink, frame: _Frame) -> _PlainConnection:
    shape = None if way.shape is None or len(way.shape) < 2 else frame.points(way.shape)
    return _PlainConnection(way.start, way.end, way.speed_mps if shape else None, shape)


def _cycles_at(layout: Layout, cycles: Mapping[str, SignalCycle]) -> dict[tuple[str, int], SignalCycle]:
    """Return the cycles by the edge and the index of the lanes at whose ends they stand."""
    return {
        (road.id, index): cycles[lane.signal]
        for road in layout.roads
        for index, lane in enumerate(road.lanes)
        if lane.signal in cycles
    }


def _notes(lane_map: LaneMap, layout: Layout, speed_mps: float, signals: int) -> Iterable[str]:
    yield from lane_map.notes
    for left_out in (lane_map.left_out, layout.left_out):
        for what, count in left_out.items():
            yield f"left out of the map: {count} {what}"
    if signals:
        yield f"{signals} signals repeat the recorded cycles; second 0 of a run is second 0 of the recording"
    controlled = {road.end for road in layout.roads if any(lane.signal for lane in road.lanes)}
    if len(controlled) > signals:
        yield f"{len(controlled) - signals} signals have no recorded cycle: their programs are netconvert's"
    narrow = sum(_fitted(lane) is not lane for lane in lane_map.lanes.values())
    if narrow:
        yield (
            f"{narrow} lanes are narrower than {NARROWEST_M:g} m: they are for bicycles only, or closed if they are "
            f"narrower than {_CYCLE_LANE_M:g} m"
        )
    without = sum(lane.speed_mps is None for lane in lane_map.lanes.values())
    if without:
        kmh = math.ceil(speed_mps * 3.6)
        yield f"{without} of {len(lane_map.lanes)} lanes have no speed limit: {kmh} km/h is assumed for them"
