"""The roads around a mission, for drivers that plan on a map: lanes with their borders and connections, stop lines,
pedestrian crossings and junctions.

`Mission.road_map` builds it when a driver first reads it. Coordinates and units are those of `drivers.protocol`.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType

import numpy as np

from foresee_dsl.compile.nets.netconvert import run_netconvert
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import distinct
from foresee_dsl.compile.roads.topology import Lane, LaneKind, Movement
from foresee_dsl.errors import DriverError
from foresee_dsl.files import read_outside_text
from foresee_dsl.kernels.arrays import FloatArray, read_only

MITRE_MOST = 2.0
"""Largest factor by which a border's point is moved outwards at a corner of the centreline, so that the border stays at
half the lane's width beside both segments. Ours: exact up to corners of 120 degrees."""


@dataclass(frozen=True, eq=False)
class MapLane:
    """A lane, also one inside a junction.

    Attributes:
        centre, left, right: [N, 2] centreline and borders in driving direction, m, with the same N; corresponding
            points lie beside each other. N is the number of the net file's points, so it differs between lanes.
        speed_limit_mps: speed limit, m/s. width_m: width, m.
        users: the kinds of traffic to which the lane is open: car (all motor vehicles), bicycle, pedestrian, bus. It is
            empty for parking strips and for lanes that are closed because the map is broken.
        successors, predecessors: ids of the lanes after and before it, those inside junctions included.
        left_neighbour, right_neighbour: ids of the adjacent lanes of the same direction that are open to cars; None
            without one.
        junction: id of the junction in which the lane lies; None outside junctions.
        turn: straight, left, right or back; None outside junctions.
        signal: key in `Observation.signals` of the signal that controls the movement through the junction; None outside
            junctions, and without a signal.
    """

    id: str
    centre: FloatArray
    left: FloatArray
    right: FloatArray
    speed_limit_mps: float
    width_m: float
    users: frozenset[LaneKind]
    successors: tuple[str, ...] = ()
    predecessors: tuple[str, ...] = ()
    left_neighbour: str | None = None
    right_neighbour: str | None = None
    junction: str | None = None
    turn: str | None = None
    signal: str | None = None


@dataclass(frozen=True, eq=False)
class StopLine:
    """The line at the end of a lane before a junction at which vehicles wait.

    Attributes:
        lane: id of the lane. points: [2, 2] its left and right end, m.
        signal: key of the signal for the mission's movement, or else for the lane's first movement; None without a
            signal.
    """

    lane: str
    points: FloatArray
    signal: str | None


@dataclass(frozen=True, eq=False)
class MapCrossing:
    """A pedestrian crossing: its outline, [K, 2] m, and its junction."""

    id: str
    outline: FloatArray
    junction: str


@dataclass(frozen=True, eq=False)
class RoadMap:
    """The whole road network of a mission.

    Attributes:
        lanes: all lanes by id, those inside junctions included.
        stop_lines: the ends of all car lanes that lead into a junction.
        crossings: the pedestrian crossings.
        route: ids of the lanes along the mission, those inside junctions included, in driving order; where the mission
            changes lanes, two neighbours follow each other.
        junctions: outline of each junction, [K, 2] m, by id.
        net_file: SUMO's network, from which `opendrive` converts.
    """

    lanes: Mapping[str, MapLane]
    stop_lines: tuple[StopLine, ...]
    crossings: tuple[MapCrossing, ...]
    route: tuple[str, ...]
    junctions: Mapping[str, FloatArray]
    net_file: Path | None = field(default=None, repr=False)

    def as_document(self) -> dict[str, object]:
        """Return the map as a JSON document, with the fields of its records; positions are rounded to millimetres."""
        return _document(self, "net_file")

    def opendrive(self) -> str:
        """Return the network as OpenDRIVE, in the coordinates of the observations; netconvert writes it.

        A network that was imported from OpenDRIVE is converted back from SUMO's network too, because the original may
        have other coordinates.

        Raises:
            DriverError: the map was made without a net file. CompileError: netconvert fails.
        """
        if self.net_file is None:
            raise DriverError("this road map has no net file, so it cannot be written as OpenDRIVE")
        with tempfile.TemporaryDirectory() as folder:
            run_netconvert(
                ["--sumo-net-file", str(self.net_file.resolve()), "--opendrive-output", "map.xodr"], Path(folder)
            )
            return read_outside_text(Path(folder) / "map.xodr")


def build_road_map(network: RoadNetwork, route: Sequence[str], net_file: Path) -> RoadMap:
    """Return the road map of a mission.

    Args:
        network: the road network. route: ids of the lanes along the mission, in driving order.
        net_file: SUMO's network.
    """
    lanes, crossings, junctions = _parts(network)
    on_route = frozenset(route)
    stop_lines = tuple(_stop_lines(network, lanes, on_route))
    return RoadMap(lanes, stop_lines, crossings, tuple(dict.fromkeys(route)), junctions, net_file)


@lru_cache(maxsize=4)  # missions of a campaign share few networks; a town's map takes about 1 MB
def _parts(
    network: RoadNetwork,
) -> tuple[Mapping[str, MapLane], tuple[MapCrossing, ...], Mapping[str, FloatArray]]:
    """Return lanes, crossings and outlines of junctions, which do not depend on the mission."""
    after, before = _connections(network)
    lanes = {
        lane.id: _map_lane(network, lane, tuple(after.get(lane.id, {})), tuple(before.get(lane.id, {})))
        for lane in network.lanes.values()
        if lane.edge not in network.walking_areas and lane.edge not in network.crossings
    }
    crossings = tuple(
        MapCrossing(crossing.id, _outline(crossing.lane), crossing.junction) for crossing in network.crossings.values()
    )
    outlines = {
        name: read_only(np.array(junction.polygon)) for name, junction in network.junctions.items() if junction.polygon
    }
    return MappingProxyType(lanes), crossings, MappingProxyType(outlines)


_Links = dict[str, dict[str, None]]
"""Ids of lanes that are connected to a lane, without repetitions and in order."""


def _connections(network: RoadNetwork) -> tuple[_Links, _Links]:
    """Return the successors and the predecessors of each lane."""
    after: _Links = {}
    before: _Links = {}
    for movement in network.movements:
        if not movement.kinds:  # closed, because the map is broken there
            continue
        chain = (movement.from_lane, *movement.via, movement.to_lane)
        for first, second in pairwise(chain):
            after.setdefault(first, {})[second] = None
            before.setdefault(second, {})[first] = None
    return after, before


def _map_lane(network: RoadNetwork, lane: Lane, successors: tuple[str, ...], predecessors: tuple[str, ...]) -> MapLane:
    centre = read_only(np.array(distinct(lane.shape)))
    through = network.movements_through(lane.id)
    movement = through[0] if through else None
    left, right = (_neighbour(network, lane, side) for side in (1, -1))
    return MapLane(
        id=lane.id,
        centre=centre,
        left=read_only(_beside(centre, lane.width_m / 2)),
        right=read_only(_beside(centre, -lane.width_m / 2)),
        speed_limit_mps=lane.speed_mps,
        width_m=lane.width_m,
        users=lane.kinds,
        successors=successors,
        predecessors=predecessors,
        left_neighbour=left,
        right_neighbour=right,
        junction=movement.junction if movement is not None else None,
        turn=movement.turn if movement is not None else None,
        signal=_signal(movement),
    )


def _signal(movement: Movement | None) -> str | None:
    """Return the key of a movement's signal, as `route_line.Passage.signal` writes it."""
    if movement is None or movement.tls is None or movement.link < 0:
        return None
    return f"{movement.tls}:{movement.link}"


def _neighbour(network: RoadNetwork, lane: Lane, left: int) -> str | None:
    """Return the id of the car lane beside a lane, to its left (1) or right (-1)."""
    other = network.lane_beside(lane, left)
    return other.id if other is not None and "car" in other.kinds else None


def _stop_lines(network: RoadNetwork, lanes: Mapping[str, MapLane], route: frozenset[str]) -> list[StopLine]:
    ways: dict[str, list[Movement]] = {}
    for movement in network.movements:
        if "car" in movement.kinds and movement.junction not in network.joints:
            ways.setdefault(movement.from_lane, []).append(movement)
    stop_lines = []
    for name, movements in ways.items():
        own = next((m for m in movements if name in route and not route.isdisjoint((*m.via, m.to_lane))), movements[0])
        lane = lanes[name]
        stop_lines.append(StopLine(name, read_only(np.array([lane.left[-1], lane.right[-1]])), _signal(own)))
    return stop_lines


def _outline(lane: Lane) -> FloatArray:
    """Return the outline of a lane, [K, 2] m."""
    centre = np.array(distinct(lane.shape))
    return read_only(np.concatenate([_beside(centre, lane.width_m / 2), _beside(centre, -lane.width_m / 2)[::-1]]))


def _beside(centre: FloatArray, left_m: float) -> FloatArray:
    """Return a line parallel to a line of [N, 2] points, `left_m` to its left, with a point beside each point."""
    steps = np.diff(centre, axis=0)
    along = steps / np.hypot(steps[:, 0], steps[:, 1])[:, None]
    mean = np.concatenate([along[:1], along[:-1] + along[1:], along[-1:]])
    length = np.hypot(mean[:, 0], mean[:, 1])
    mean /= np.maximum(length, 1e-9)[:, None]
    # At a corner the mean direction makes a smaller angle with both segments than they with each other.
    cosine = np.concatenate([[1.0], np.maximum(length[1:-1] / 2, 1 / MITRE_MOST), [1.0]])
    normal = np.column_stack([-mean[:, 1], mean[:, 0]]) / cosine[:, None]
    return np.asarray(centre + left_m * normal, dtype=np.float64)


def _document(record: MapLane | StopLine | MapCrossing | RoadMap, *left_out: str) -> dict[str, object]:
    """Return the fields of a record as JSON, without those that are left out."""
    return {f.name: _plain(getattr(record, f.name)) for f in fields(record) if f.name not in left_out}


def _plain(value: object) -> object:  # noqa: PLR0911  one return a kind
    match value:
        case np.ndarray():
            return np.round(value, 3).tolist()
        case frozenset():
            return sorted(value)
        case tuple():
            return [_plain(part) for part in value]
        case Mapping():
            return {name: _plain(part) for name, part in value.items()}
        case MapLane():
            return {**_document(value, "id"), "speed_limit_mps": round(value.speed_limit_mps, 3)}
        case StopLine() | MapCrossing():
            return _document(value)
        case _:
            return value


def lanes_along(pieces: Sequence[tuple[float, str]], from_s: float, until_s: float) -> tuple[str, ...]:
    """Return the ids of the lanes of a route line between two positions along it, m; `pieces` as in `RouteLine`."""
    ends = [begin for begin, _ in pieces[1:]] + [math.inf]
    return tuple(lane for (begin, lane), end in zip(pieces, ends, strict=True) if end > from_s and begin <= until_s)
