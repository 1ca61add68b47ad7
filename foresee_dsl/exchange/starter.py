"""Writes a first scenario on an imported network: a drive over a junction with a signal, with traffic around it."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from foresee_dsl.compile.foreign.geometry_repair import Geometry, geometry_of
from foresee_dsl.compile.foreign.networks import Tell, foreign_net, in_silence, notes_of
from foresee_dsl.compile.nets.cache import read_net_once
from foresee_dsl.compile.nets.safe_xml import parse_net
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.compile.roads.topology import Lane, Movement, Topology
from foresee_dsl.exchange.bridges import Bridge, Heights, bridges
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.language import model as m

SHORTEST_M, LONGEST_M = 150.0, 400.0
"""Shortest and longest length of the ego's route, m: from a whole approach and exit up to a drive of about a minute
(ours)."""
CLEAR_M = 10.0
"""Free road behind the ego's front at the start, and after its goal, m (ours: two car lengths)."""
_SMALL_MAPS = ((SHORTEST_M, CLEAR_M, CLEAR_M), (40.0, CLEAR_M, CLEAR_M), (5.0, 6.0, 6.0), (3.0, 5.0, 1.0))
"""The least length of the route, and the free road behind the start and after the goal, m; the first row that fits the
map is used (ours; the smallest maps are a road of 10 m, on which a car of 5 m stands and moves)."""
APPROACH_M = 120.0
"""Largest length that is driven on the first and on the last edge, m (ours: a signal is visible from this distance)."""
_ROOMY_M = 40.0
"""If at least this length of road is ahead, a first edge is a street to start in, not a piece of a roundabout, m
(ours).
"""
_SLOW_STREET_MPS = 20 / 3.6
"""If the speed limit of a street is lower than this, the street is a yard or the limit is an error of the map, m/s
(ours; an edition of CARLA's Town03 has a limit of 1.39 m/s).
"""
_MOST_WAYS = 10_000
"""Maximum number of routes that are compared (ours: those of a district; more would take seconds)."""
_MOST_EDGES = 30
_VEHICLES, _WALKERS = 10, 6
_ROUND_M = 120.0
_WAITING_S = 60.0
"""Time allowed per signal, s: the longest red if a third of netconvert's default cycle of 90 s is green (ours)."""
_SLOW = 0.5
"""Share of the speed limits that a drive through traffic reaches at least (ours)."""

_LONGEST_ID = 200
_ID = re.compile(rf'[^"\n\r\\]{{1,{_LONGEST_ID}}}')
"""Matches the ids that the language can express, the same as `language.model.values.Id`."""


@dataclass(frozen=True)
class Drive:
    """A drive of the ego.

    Attributes:
        edges: its route.
        start_m: its start on the first edge, m.
        goal_m: its goal on the last edge, m.
        length_m: length from start to goal, without the parts inside junctions, m.
        signals: the junctions with a signal on it.
        turns: number of movements that are not straight on.
        free_s: duration at the speed limits, s.
        slowest_mps: the lowest of these limits, m/s.
    """

    edges: tuple[str, ...]
    start_m: float
    goal_m: float
    length_m: float
    signals: tuple[str, ...]
    turns: int
    free_s: float
    slowest_mps: float


@dataclass(frozen=True)
class Ground:
    """A map in the form that the search for a route needs; it is read once for several searches.

    Attributes:
        file: the map's name, for messages. roads: its network. signals: the junctions whose signal has a program.
        bridges: places where its roads go over others. geometry: faults of its lines. notes: notes on its conversion.
    """

    file: str
    roads: RoadNetwork
    signals: frozenset[str]
    bridges: tuple[Bridge, ...]
    geometry: Geometry
    notes: tuple[str, ...]

    @classmethod
    def of(cls, map_file: Path, tell: Tell = in_silence) -> Ground:
        """Read a `.net.xml` or `.xodr`; `ExchangeError` if cars cannot drive on it, or ids cannot be expressed.

        `tell` is called with each step that takes long.
        """
        net = foreign_net(map_file, tell)
        tell("reading the network")
        parts, signals = read_net_once(net, None)
        roads = RoadNetwork.of(parts)
        check_network(roads, map_file.name)
        root = parse_net(net)
        heights = Heights.in_tree(root)
        return cls(map_file.name, roads, frozenset(signals), bridges(roads, heights), geometry_of(root), notes_of(net))


def check_network(network: Topology, where: str) -> None:
    """Raise unless cars can drive on a network and the language can express its ids; `where` names its file.

    Raises:
        ExchangeError: no lane is for cars, or the id of an edge or junction contains a double quote, a backslash or a
            line break, or is longer than 200 letters.
    """
    if not any(edge.for_kind("car") for edge in network.edges.values()):
        raise ExchangeError(f"{where} has no lanes for cars, so the ego cannot drive on it")
    for name in (*network.edges, *network.junctions):
        if not _ID.fullmatch(name):
            quoted = f"'{name[:40]}...' ({len(name)} letters)" if len(name) > _LONGEST_ID else repr(name)
            raise ExchangeError(
                f"{where} has an edge or junction {quoted}, which the language cannot express: ids have at most "
                f"{_LONGEST_ID} letters, and no double quotes, backslashes or line breaks; rename it there"
            )


def starter(
    ground: Ground, *, name: str, network: str, doc: str, without: Collection[str] = ()
) -> tuple[m.Scenario, Drive]:
    """Return a scenario that runs on a map, and the route of its ego.

    Args:
        network: the file as the scenario names it. without: edges to avoid.

    Raises:
        ExchangeError: no route for a car is long enough.
    """
    roads = ground.roads
    over = frozenset(edge for bridge in ground.bridges for edge in bridge.edges)
    way = best_way(roads, ground.signals, over, without)
    if way is None:
        raise ExchangeError(f"{ground.file} has no route of {_SMALL_MAPS[-1][0]:.0f} m for a car: {_why(roads)}")
    body: list[m.ScenarioItem] = [
        m.Doc(text=doc),
        m.Tags(names=("starter",)),
        m.UseNetwork(path=network),
        _ego(roads, way),
        *_traffic(roads),
        m.Expect(mode="never", condition=m.Predicate(what="collision", actor="ego")),
        m.Expect(mode="eventually", condition=m.Predicate(what="arrived", actor="ego")),
        m.End(after=m.Quantity.of(_end_s(way), "time", 0)),
    ]
    return m.Scenario(name=name, body=tuple(body)), way


def _why(roads: RoadNetwork) -> str:
    if roads.faults:
        return f"it has faults at {len(roads.faults)} places, such as: {roads.faults[0]}"
    return "a larger map is needed"


def best_way(
    roads: RoadNetwork, signals: frozenset[str], bridged: frozenset[str] = frozenset(), without: Collection[str] = ()
) -> Drive | None:
    """Return the route for the ego: over a signal if there is one, from a street, with a turn, of medium length.

    It avoids edges that go over or under others (`bridged`) if possible. The same network gives the same route.
    """
    for room_m in _SMALL_MAPS:
        streets = _Streets.of(roads, signals, room_m, without)
        way = _best_of(roads, streets, bridged)
        if way is not None:
            return way
    return None


def _best_of(roads: RoadNetwork, streets: _Streets, bridged: frozenset[str]) -> Drive | None:
    middle = (SHORTEST_M + LONGEST_M) / 2
    best: tuple[tuple[float, ...], Drive] | None = None
    for way in itertools.islice(streets.ways(), _MOST_WAYS):
        ahead_m = streets.length_m(way.edges[0]) - way.start_m
        rank = (
            any(edge in bridged for edge in way.edges),
            way.slowest_mps < _SLOW_STREET_MPS,
            -min(len(way.signals), 1),
            -min(ahead_m, _ROOMY_M),
            -min(way.turns, 1),
            len(way.signals),
            abs(way.length_m - middle),
        )
        if (best is None or rank < best[0]) and _leads(roads, way.edges):
            best = rank, way
    return best[1] if best is not None else None


@dataclass(frozen=True)
class _Streets:
    """The edges for cars in the form that the search needs: the rightmost lane, and the movements by their target edge.

    `room_m` holds the least length of the route, and the free road behind the start and after the goal, m.
    """

    roads: RoadNetwork
    lanes: dict[str, Lane]
    signals: frozenset[str]
    room_m: tuple[float, float, float]
    _onward: dict[str, dict[str, Movement]] = field(default_factory=dict)

    @classmethod
    def of(
        cls, roads: RoadNetwork, signals: frozenset[str], room_m: tuple[float, float, float], without: Collection[str]
    ) -> _Streets:
        lanes = {
            edge.id: edge.drivable[0]
            for edge in roads.edges.values()
            if edge.for_kind("car") and edge.id not in without
        }
        return cls(roads, lanes, signals, room_m)

    def length_m(self, edge: str) -> float:
        """Return an edge's length, m."""
        return self.lanes[edge].line.length_m

    def onward(self, edge: str) -> dict[str, Movement]:
        """Return the movements from an edge, by target edge; computed on demand, as a search visits few edges."""
        if edge not in self._onward:
            self._onward[edge] = {
                m.to_edge: m for m in self.roads.movements_from(edge) if m.turn != "back" and m.to_edge in self.lanes
            }
        return self._onward[edge]

    def ways(self) -> Iterator[Drive]:
        """Yield routes of suitable length from every edge, none with an edge twice."""
        for start in sorted(self.lanes):
            open_ways: list[tuple[tuple[str, ...], float]] = [((start,), 0.0)]
            while open_ways:
                edges, after_first_m = open_ways.pop()
                way = self.way(edges)
                if way is not None and self.room_m[0] <= way.length_m <= LONGEST_M:
                    yield way
                if len(edges) < _MOST_EDGES and after_first_m < LONGEST_M:
                    after = (edge for edge in sorted(self.onward(edges[-1])) if edge not in edges)
                    open_ways += [((*edges, edge), after_first_m + self.length_m(edge)) for edge in after]

    def way(self, edges: tuple[str, ...]) -> Drive | None:
        """Return the drive over edges, with the shortest parts of the first and last edge; None if these are too
        short."""
        first_m, last_m = self.length_m(edges[0]), self.length_m(edges[-1])
        _, behind_m, beyond_m = self.room_m
        if min(first_m, last_m) < behind_m + beyond_m:
            return None
        if len(edges) == 1:
            start_m, goal_m = behind_m, min(last_m - beyond_m, LONGEST_M)
            length_m = goal_m - start_m
        else:
            start_m, goal_m = max(behind_m, first_m - APPROACH_M), min(last_m - beyond_m, APPROACH_M)
            length_m = first_m - start_m + goal_m + sum(self.length_m(edge) for edge in edges[1:-1])
        movements = [self.onward(a)[b] for a, b in itertools.pairwise(edges)]
        return Drive(
            edges=edges,
            start_m=math.floor(start_m),
            goal_m=math.floor(goal_m),
            length_m=length_m,
            signals=tuple(m.junction for m in movements if m.tls is not None and m.junction in self.signals),
            turns=sum(m.turn != "straight" for m in movements),
            free_s=sum(self.length_m(e) / max(self.lanes[e].speed_mps, 1.0) for e in edges),
            slowest_mps=min(self.lanes[e].speed_mps for e in edges),
        )


def _leads(roads: RoadNetwork, edges: Sequence[str]) -> bool:
    """Return whether lanes connect all edges (edges may touch without a lane from one to the next)."""
    try:
        roads.line(tuple(edges))
    except RouteError:
        return False
    return True


def _end_s(way: Drive) -> float:
    """Return a time limit that suffices to arrive, in s, a multiple of 10."""
    return math.ceil((way.free_s / _SLOW + _WAITING_S * (len(way.signals) + 0.5)) / 10) * 10


def _ego(roads: RoadNetwork, way: Drive) -> m.Ego:
    limit = roads.edges[way.edges[0]].drivable[0].speed_mps
    return m.Ego(
        model="car.sedan",
        body=(
            m.EdgeRoute(edges=way.edges),
            m.StartAt(place=m.AlongEdge(edge=way.edges[0], at=m.Quantity.of(way.start_m, "length", 0))),
            m.StartSpeed(speed=m.Quantity.of(min(limit / 2, 8.0), "speed", 1)),
            m.GoalAt(place=m.AlongEdge(edge=way.edges[-1], at=m.Quantity.of(way.goal_m, "length", 0))),
        ),
    )


def _traffic(roads: RoadNetwork) -> list[m.Traffic]:
    vehicles = ["car.compact", "car.suv", "van.delivery", "motorcycle.street"]
    if any("bicycle" in lane.kinds for lane in roads.lanes.values()):
        vehicles.append("bicycle.city")
    groups = [_around("others", _VEHICLES, vehicles, 1)]
    if any(lane.kinds == {"pedestrian"} and not lane.internal for lane in roads.lanes.values()):
        groups.append(_around("walkers", _WALKERS, ["pedestrian.adult", "pedestrian.elderly"], 2))
    return groups


def _around(name: str, count: int, models: Sequence[str], seed: int) -> m.Traffic:
    return m.Traffic(
        name=name,
        count=m.Quantity.of(count, "count", 0),
        models=tuple(models),
        within=m.Quantity.of(_ROUND_M, "length", 0),
        seed=m.Quantity.of(seed, "count", 0),
    )
