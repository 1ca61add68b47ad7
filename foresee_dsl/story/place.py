"""Finds the place in the road layout where a run ended: on a crossing, in which kind of junction, or on the road
between.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, distance_to, inside, wrap
from foresee_dsl.compile.roads.topology import Crossing, Movement
from foresee_dsl.story.facts import Facts
from foresee_dsl.story.wording import quoted

NEAR_JUNCTION_M = 20.0
"""An ego within this distance of a junction is before or behind it; farther away it is between junctions, m. Ours:
three cars and a crossing."""
BESIDE_CROSSING_M = 1.0
"""A point up to this far beside a crossing's stripes is on the crossing, m. Ours: people cut its corners."""
ROUNDABOUT_M = 60.0
"""A ring of one-way edges whose junctions are within this distance of their middle, m, is a roundabout; a larger ring
is a block of one-way streets. Ours: the largest urban roundabouts have an outer radius of about 50 m."""
_CONTROLS = {
    "traffic_light": "signalised",
    "traffic_light_right_on_red": "signalised",
    "traffic_light_unregulated": "signalised",
    "right_before_left": "right-before-left",
    "allway_stop": "all-way stop",
}
"""SUMO's types of junctions in words. At a junction of any other type, roads with priority meet roads without it."""
_ARMS = {3: "three-arm junction", 4: "crossroads"}
BENDS_RAD = math.radians(20)
"""Two roads whose directions differ by less than this where they meet, rad, are one straight road. Ours."""


@dataclass(frozen=True)
class StoryPlace:
    """A place in the road layout.

    Attributes:
        kind: `crossing`, `junction` or `road`.
        name: words that are the same for all places with an equal layout.
        junction: id of the junction at or near it, "" if there is none.
        text: words for a sentence, with a preposition unless it is a crossing.
    """

    kind: str
    name: str
    junction: str = ""
    text: str = ""


def place_of(facts: Facts, at: XY, frame: int) -> StoryPlace:
    """Return the place of a point, seen in the ego's direction of travel at a frame.

    Only pedestrians, and cyclists that follow a path instead of lanes, can be on a crossing. For a cyclist the name of
    the place is that of the junction, so that a ride a metre beside the crossing is the same story.
    """
    other = facts.info(facts.opponent) if facts.opponent else None
    on_foot = other is not None and (other.kind == "pedestrian" or (other.kind == "bicycle" and bool(other.path)))
    network, layout = facts.network, _layout(facts.network)
    for crossing in network.crossings.values() if on_foot else ():
        if distance_to(*at, crossing.lane.shape) <= crossing.lane.width_m / 2 + BESIDE_CROSSING_M:
            where = "behind" if _behind(facts, crossing, frame) else "before"
            kind, equal = kind_of(network, crossing.junction), control_of(network, crossing.junction)
            name = f"the {equal}" if other and other.kind == "bicycle" else f"the crossing {where} the {equal}"
            text = "the crossing" if kind == "crossing" else f"the crossing {where} the {kind}"
            return StoryPlace("crossing", text if kind == "crossing" else name, crossing.junction, text)
    for junction in network.junctions.values():
        if len(junction.polygon) < 3 or layout.arms[junction.id] < 3:
            continue
        reach_m = max(math.hypot(x - junction.x, y - junction.y) for x, y in junction.polygon)
        if math.hypot(junction.x - at[0], junction.y - at[1]) < reach_m and inside(at, junction.polygon):
            return _in_junction(network, junction.id)
    return _on_road(facts, frame)


def _in_junction(network: RoadNetwork, junction: str) -> StoryPlace:
    name = kind_of(network, junction)
    text = f"{'in' if name == 'roundabout' else 'at'} the {name}"
    return StoryPlace("junction", f"the {control_of(network, junction)}", junction, text)


def _on_road(facts: Facts, frame: int) -> StoryPlace:
    """Return a place before, behind or between junctions. All such places have the same name, the road."""
    network, layout, lane_id = facts.network, _layout(facts.network), facts.nearest_lane(0, frame)
    through = network.movements_through(lane_id) if lane_id else ()
    if through and layout.arms[through[0].junction] > 2:
        return _in_junction(network, through[0].junction)
    lane = network.lanes.get(lane_id)
    if lane is None or lane.edge not in network.edges:
        return StoryPlace("road", "the road")
    edge = network.edges[lane.edge]
    along = lane.line.project(*facts.xy(0, frame))[0]
    for junction, away, where in ((edge.end, lane.line.length_m - along, "before"), (edge.start, along, "behind")):
        if layout.arms[junction] > 2 and away <= NEAR_JUNCTION_M:
            return StoryPlace("road", "the road", junction, f"{where} the {kind_of(network, junction)}")
    return StoryPlace("road", "the road", "", "on the road between junctions")


def movement_near(facts: Facts, actor: int, frame: int, place: StoryPlace) -> Movement | None:
    """Return an actor's movement through the junction of a place; None without one.

    It is the current movement, one that ended within 200 frames, or the next one on the actor's route.
    """
    for start, end, movement in facts.passages(actor):
        if movement.junction == place.junction and start <= frame:
            return movement if frame - end <= 200 else None
    if not place.junction:
        return None
    placed = facts.placed(actor)
    passage = placed.line.passage(place.junction) if placed and placed.line else None
    return passage.movement if passage else None


def _behind(facts: Facts, crossing: Crossing, frame: int) -> bool:
    """Return whether the ego reaches a crossing when it leaves the junction, not when it enters it.

    Inside the junction, that holds unless the crossing lies only over the road from which the ego comes. Before the
    junction, it holds if the ego's road starts at the junction.
    """
    through = [p for p in facts.passages(0) if p[2].junction == crossing.junction and p[0] <= frame]
    if through:
        movement = through[-1][2]
        return movement.to_edge in crossing.edges or movement.from_edge not in crossing.edges
    lane = facts.network.lanes.get(facts.lane(0, frame))
    edge = facts.network.edges.get(lane.edge) if lane is not None else None
    return edge is not None and edge.start == crossing.junction


def kind_of(network: RoadNetwork, junction: str) -> str:
    """Return the kind of a junction in words: `signalised crossroads`, `roundabout`."""
    layout = _layout(network)
    if junction in layout.rings:
        return "roundabout"
    arms = layout.arms[junction]
    if arms < 2:
        return "end of the road"
    if arms == 2:
        crossed = any(crossing.junction == junction for crossing in network.crossings.values())
        return "bend" if _bends(network, junction) else "crossing" if crossed else "joint of the road"
    control = _CONTROLS.get(network.junctions[junction].type, "priority")
    return f"{control} {_ARMS.get(arms, f'junction of {arms} arms')}"


def entries(facts: Facts, actor: int) -> Iterator[tuple[int, str]]:
    """Yield where an actor enters junctions: the frame, and in words the junction, the turn and the signal's colour.

    A roundabout is entered once, from a road outside it. Bends, ends of roads, and crossings without a signal are not
    junctions here.
    """
    network, rings = facts.network, _layout(facts.network).rings
    for start, _, movement in facts.passages(actor):
        where, colour = kind_of(network, movement.junction), facts.colour(movement, max(0, start - 1))
        ring, before = rings.get(movement.junction), network.edges[movement.from_edge].start
        inside = ring is not None and rings.get(before) == ring
        if start == 0 or inside or where in ("bend", "end of the road", "joint of the road"):
            continue
        if where == "crossing" and not colour:
            continue
        turn = "straight on" if movement.turn == "straight" else f"turning {movement.turn}"
        parts = ("" if ring is not None else turn, f"on {colour}" if colour else "")
        yield start, ", ".join((f"the {where} {quoted(movement.junction)}", *filter(None, parts)))


def _bends(network: RoadNetwork, junction: str) -> bool:
    """Return whether a road turns at a junction of two arms."""
    edges = [edge for edge in network.edges.values() if edge.drivable]
    ends = [edge for edge in edges if edge.end == junction]
    starts = [edge for edge in edges if edge.start == junction]
    turns = (
        abs(wrap(after.drivable[0].line.angles[0] - before.drivable[0].line.angles[-1]))
        for before in ends
        for after in starts
        if after.end != before.start
    )
    return any(turn > BENDS_RAD for turn in turns)


def control_of(network: RoadNetwork, junction: str) -> str:
    """Return the kind of a junction without its number of arms, which equal stories ignore: `signalised junction`."""
    if junction in _layout(network).rings:
        return "roundabout"
    return f"{_CONTROLS.get(network.junctions[junction].type, 'priority')} junction"


@dataclass(frozen=True)
class _Layout:
    """Number of roads at each junction, and the roundabout that each junction belongs to; computed once per network."""

    arms: Mapping[str, int]
    rings: Mapping[str, int]


@lru_cache(maxsize=8)
def _layout(network: RoadNetwork) -> _Layout:
    beside: dict[str, set[str]] = {name: set() for name in network.junctions}
    for edge in network.edges.values():
        beside.setdefault(edge.start, set()).add(edge.end)
        beside.setdefault(edge.end, set()).add(edge.start)
    return _Layout({name: len(others) for name, others in beside.items()}, _rings(network))


def _rings(network: RoadNetwork) -> Mapping[str, int]:
    """Return the junctions of roundabouts, small rings of one-way edges, each with the number of its roundabout."""
    import networkx as nx  # imported here, because the import is slow and few runs need a story

    pairs = {(edge.start, edge.end) for edge in network.edges.values() if edge.for_kind("car")}
    graph: nx.DiGraph[str] = nx.DiGraph()
    graph.add_edges_from((a, b) for a, b in pairs if (b, a) not in pairs)
    junctions: dict[str, int] = {}
    for number, ring in enumerate(nx.strongly_connected_components(graph)):
        places = [network.junctions[name] for name in ring if name in network.junctions]
        if len(places) > 2:
            x, y = sum(j.x for j in places) / len(places), sum(j.y for j in places) / len(places)
            if max(math.hypot(j.x - x, j.y - y) for j in places) <= ROUNDABOUT_M:
                junctions |= dict.fromkeys(ring, number)
    return junctions
