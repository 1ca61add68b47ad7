"""From a CARLA route to what a case row says: edges, lengths along the route, kerbs, the junction that is meant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.geometry import RoadNetwork
from foresee_dsl.compile.polyline import wrap
from foresee_dsl.compile.routeline import Passage, RouteLine
from foresee_dsl.compile.starts import Starts
from foresee_dsl.exchange.carla_files import CarlaRoute, Pose, Trigger
from foresee_dsl.exchange.places_on_net import NEAR_M, Way, length_to, through_of, way_between
from foresee_dsl.language.model import AlongRoute, EdgeRoute, Ego, Quantity, StartAt

TRIGGER_NEAR_M, TRIGGER_FAR_M = 2.0, 5.0
"""A trigger belongs to a route that comes within 2 m of it (CARLA's leaderboard, with 10 degrees); where none does,
within 5 m, which finds one for each of Town10HD's routes (measured)."""
_BACK_RAD = math.radians(100)
"""No road turns so much within a metre (ours: the tightest corner of CARLA's towns has a radius of 4 m)."""
_SAME_WAY_RAD = math.radians(60)
_BESIDE_M = 0.05
"""A start that is hardly beside the middle of its lane is on it (ours: no place of Town10HD is farther off)."""
MISSED_M = 0.5
"""A start that is farther from CARLA's is worth a note (ours: roundings come to 1 cm)."""
_LOOK_M, _LOOK_STEP_M = 25.0, 0.25
"""How far to look for a kerb, and in what steps (ours: six lanes and a median)."""


@dataclass(frozen=True, eq=False)
class Journey:
    """A route of CARLA on a network.

    Attributes:
        named: the edges to write; the shortest ways between them make up the route.
        begin_m: from the route's beginning to the ego's front. beside_m: to the left of the lane that is meant first.
        finish_m: from there to the goal, along the line.
        start_off_m: how far CARLA's start is from where the ego is put.
        line: what the ego follows. s: where it starts on it.
        trigger_m: from the ego's start to the trigger's place. trigger: it, or None where none belongs to the route.
    """

    route: CarlaRoute
    way: Way
    named: tuple[str, ...]
    begin_m: float
    beside_m: float
    finish_m: float
    start_off_m: float
    line: RouteLine
    s: float
    trigger_m: float
    trigger: Trigger | None

    @property
    def goal_s(self) -> float:
        """The goal along the line."""
        return self.s + self.finish_m


def journey_of(
    network: RoadNetwork, route: CarlaRoute, triggers: Sequence[Trigger], spec: ModelSpec, *, in_order: bool
) -> Journey:
    """Return how a route is written, and where its trigger is.

    Args:
        network: the town.
        route: of CARLA.
        triggers: of its family and town.
        spec: the ego's model.
        in_order: whether the k-th trigger belongs to the k-th route.

    Raises:
        RouteError: its places are not on the map, not connected, or the start cannot be said.
    """
    way = way_between(network, route.start, route.end)
    first = network.line(way.edges)
    begin, beside = _said_on(first, route.start)
    beside = 0.0 if abs(beside) < _BESIDE_M else round(beside, 2)
    at = AlongRoute(
        actor="ego",
        at=Quantity.of(begin, "length", 2),
        offset=Quantity.of(beside, "length", 2) if beside else None,
    )
    ego = Ego(model=spec.name, body=(EdgeRoute(edges=way.edges), StartAt(place=at)))
    placed = Starts(network, {"ego": ego}, {"ego": spec}).on_route("ego")
    goal_s = min(length_to(placed.line, route.end, placed.s), placed.line.end_s)
    finish = math.floor((goal_s - placed.s) * 100) / 100  # a rounding must not put it behind the end
    drive = _Drive(placed.line, placed.s, placed.s + finish)
    trigger = _trigger_of(route, triggers, drive, in_order=in_order)
    return Journey(
        route=route,
        way=way,
        named=through_of(network, way.edges),
        begin_m=round(begin, 2),
        beside_m=beside,
        finish_m=finish,
        start_off_m=math.hypot(placed.x - route.start.x, placed.y - route.start.y),
        line=placed.line,
        s=placed.s,
        trigger_m=0.0 if trigger is None else drive.s_of(trigger.pose) - placed.s,
        trigger=trigger,
    )


def _said_on(line: RouteLine, place: Pose) -> tuple[float, float]:
    """Return the length along a line and the offset at which the line has a place.

    The nearest point of a line is not quite it in a bend: offsets turn with the line, segment by segment.
    """
    s = length_to(line, place, 0.0)
    beside = line.project(place.x, place.y, s)[1]
    for _ in range(5):  # each round leaves about a tenth of the error
        x, y, heading = line.at(s, beside)
        dx, dy = place.x - x, place.y - y
        s = min(max(s + dx * math.cos(heading) + dy * math.sin(heading), 0.0), line.length_m)
        beside += dy * math.cos(heading) - dx * math.sin(heading)
    return s, beside


def is_well_placed(journey: Journey) -> bool:
    """Say whether the ego starts where CARLA puts it, as far as the map has it, and has a way to go."""
    return journey.start_off_m <= NEAR_M and journey.finish_m > 1.0


def turns_back(journey: Journey) -> bool:
    """Say whether the way turns back on itself from one point to the next: lanes of the net that overlap wrongly."""
    marks, angles = journey.line.marks, journey.line.angles
    return any(
        journey.s <= at <= journey.goal_s and abs(wrap(b - a)) > _BACK_RAD
        for at, a, b in zip(marks[1:], angles, angles[1:], strict=False)
    )


def passages_of(network: RoadNetwork, journey: Journey) -> list[Passage]:
    """Return the junctions that the trigger may stand for: those behind it that the ego comes to, in order.

    Places where two roads merely join are no junctions here. Where none is behind the trigger, all on the way count.
    """
    found = []
    for passage in journey.line.passages:
        arms = {movement.from_edge for movement in network.movements_at(passage.junction) if "car" in movement.kinds}
        if journey.s + 1.0 < passage.entry_s < journey.goal_s and len(arms) > 2:
            found.append(passage)
    behind = [one for one in found if one.exit_s > journey.s + journey.trigger_m - TRIGGER_FAR_M]
    return behind or found


def kerbs(network: RoadNetwork, line: RouteLine, s: float) -> tuple[float, float]:
    """Return offsets (m, left positive) from a line to just beyond the road's edge, on the right and on the left."""
    return _edge(network, line, s, -1), _edge(network, line, s, 1)


def _edge(network: RoadNetwork, line: RouteLine, s: float, side: int) -> float:
    import shapely

    steps = [side * _LOOK_STEP_M * k for k in range(4, int(_LOOK_M / _LOOK_STEP_M) + 1)]
    places = [line.at(s, offset)[:2] for offset in steps]
    on_road = shapely.contains_xy(network.drivable, [x for x, _ in places], [y for _, y in places])
    beyond = next((offset for offset, road in zip(steps, on_road, strict=True) if not road), steps[-1])
    return beyond + side * 0.75  # a step beyond the kerb


def _trigger_of(route: CarlaRoute, triggers: Sequence[Trigger], drive: _Drive, *, in_order: bool) -> Trigger | None:
    """The trigger of a route: the one of its place in the file, if it lies on the way; else the first that does."""
    away = [(drive.off(trigger.pose), trigger.order, trigger) for trigger in triggers]
    if in_order:
        own = [one for one in away if one[1] == route.order and one[0] <= TRIGGER_FAR_M]
        if own:
            return own[0][2]
    for within in (TRIGGER_NEAR_M, TRIGGER_FAR_M):
        near = [one for one in away if one[0] <= within]
        if near:
            return min(near, key=lambda one: (round(drive.s_of(one[2].pose), 1), one[0], one[1]))[2]
    return None


@dataclass(frozen=True)
class _Drive:
    """The part of a line that the ego drives."""

    line: RouteLine
    start_s: float
    goal_s: float

    def s_of(self, pose: Pose) -> float:
        """Where on it a place is nearest."""
        return min(length_to(self.line, pose, max(self.start_s - TRIGGER_FAR_M, 0.0)), self.goal_s)

    def off(self, pose: Pose) -> float:
        """How far a place is from it; infinite for one of another direction."""
        x, y, heading = self.line.at(self.s_of(pose))
        if abs(wrap(heading - pose.heading_rad)) > _SAME_WAY_RAD:
            return math.inf
        return math.hypot(x - pose.x, y - pose.y)
