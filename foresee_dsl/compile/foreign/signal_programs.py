"""Fixed-time signal programs for foreign networks: ours where there are none, fixed times where programs are
actuated."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from xml.etree.ElementTree import Element, SubElement  # no parsing: that is safe_xml's

from foresee_dsl.compile.bundle import Signal
from foresee_dsl.compile.nets.net_reader import topology_of
from foresee_dsl.compile.nets.signals import NAMED_STAGES, links_of, program
from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.compile.roads.topology import Topology
from foresee_dsl.compile.templates import number
from foresee_dsl.language.model import Junction, Point, Quantity, Stage

GREEN_S = 20.0
"""Ours: as long as the shorter stages of the bundled town; a vehicle at 30 km/h that is 160 m away still gets it."""
_FIXED = ("static", "rail_signal", "rail_crossing")
"""SUMO's types of programs that do not react to road traffic."""
OPPOSITE_RAD = math.radians(135)
"""Approaches whose directions differ by this much or more share a stage (ours: within 45 degrees of opposite)."""
_COMPASS = ("n", "ne", "e", "se", "s", "sw", "w", "nw")
_ORDER = ("n", "s", "e", "w", "ne", "sw", "nw", "se")
"""The order of directions in a stage's name: `ns_go`, `ew_go`."""


def give_programs(root: Element) -> int:
    """Replace the programs that netconvert 1.28 invents for a map without programs, and return how many were replaced.

    Each junction with a signal of its own gets a stage for each pair of opposite approaches, and one for each approach
    that has no opposite: 20 s of green, then amber and all red as in our own networks. Vehicles that turn left yield to
    oncoming traffic; pedestrians walk where only turning vehicles, which yield to them, cross their way. A stage is
    named after the direction that its traffic comes from: `ns_go`, `e_go`. Joint signals of several junctions keep
    their programs, and so do those that would get only one stage.
    """
    replaced = 0
    topology = topology_of(root)
    headings = _last_headings(topology)
    for logic in root.iterfind("tlLogic"):
        made = _program(topology, logic.get("id", ""), headings)
        states = {len(phase.get("state", "")) for phase in logic.iterfind("phase")}
        if made is None or states != {len(made.phases[0].state)}:  # it controls more than this junction
            continue
        for child in list(logic):
            logic.remove(child)
        for phase in made.phases:
            shown = {"duration": number(phase.duration_s), "state": phase.state, "name": made.stages[phase.stage]}
            SubElement(logic, "phase", shown)
        SubElement(logic, "param", {"key": NAMED_STAGES, "value": "named"})
        logic.set("type", "static")
        replaced += 1
    return replaced


@dataclass(frozen=True)
class Fixed:
    """What `fix_times` changed: programs that reacted to traffic, and further programs of a signal, left out."""

    reacting: int
    others: int

    def __bool__(self) -> bool:
        """Whether anything was changed."""
        return bool(self.reacting or self.others)


def fix_times(root: Element) -> Fixed:
    """Give every signal for road traffic one program of fixed times, with the stages that it has.

    SUMO 1.28 refuses to load the state of an actuated program, so a run could not start from a clip's state; and the
    simulator switches through the phases in their order.
    """
    last: dict[str, Element] = {}
    reacting = others = 0
    for logic in root.findall("tlLogic"):
        if logic.get("id", "") in last:  # of several programs SUMO 1.28 starts with the last
            root.remove(last[logic.get("id", "")])
            others += 1
        last[logic.get("id", "")] = logic
    for logic in last.values():
        if logic.get("type", "static") in _FIXED:
            continue
        logic.set("type", "static")
        for phase in logic.iterfind("phase"):
            phase.set("duration", phase.get("duration") or phase.get("minDur") or f"{GREEN_S:g}")
            for name in ("minDur", "maxDur", "next"):
                phase.attrib.pop(name, None)
        reacting += 1
    return Fixed(reacting, others)


def stages_of(headings: Mapping[str, float]) -> list[tuple[str, tuple[str, ...]]]:
    """Return stages (name and approaches), from the headings (rad, counter-clockwise from east) of the approaches.

    Each approach joins the one that comes nearest to being its opposite, if that is within 45 degrees of it.
    """
    left = sorted(headings)
    found: list[tuple[str, tuple[str, ...]]] = []
    pairs = sorted((-abs(wrap(headings[a] - headings[b])), a, b) for a, b in combinations(left, 2))
    for apart, one, other in pairs:
        if -apart >= OPPOSITE_RAD and one in left and other in left:
            axis = headings[one] + wrap(headings[other] + math.pi - headings[one]) / 2
            found.append((_named(axis, axis + math.pi), (one, other)))
            left = [edge for edge in left if edge not in (one, other)]
    found += [(_named(headings[edge]), (edge,)) for edge in left]
    return _numbered(sorted(found))


def _program(topology: Topology, tls: str, headings: Mapping[str, float]) -> Signal | None:
    """Our program for a signal; None where its movements are not those of one junction."""
    links = links_of(topology, tls) or ()
    approaches = {link.edge: headings[link.edge] for link in links if link.edge in headings}
    if not approaches or [link.index for link in links] != list(range(len(links))):
        return None
    edges = sorted({*approaches, *(edge for link in links for edge in link.crosses)})
    road_of = {edge: f"road_{k}" for k, edge in enumerate(edges)}  # ids of a foreign net need not be names
    stages = tuple(
        Stage(name=name, duration=Quantity.of(GREEN_S, "time", 0), green=tuple(road_of[edge] for edge in green))
        for name, green in stages_of(approaches)
    )
    if len(stages) < 2:  # it protects a crossing on an open road; netconvert's program has a phase for that
        return None
    zero = Quantity.of(0.0, "length", 0)
    return program(Junction(name="foreign", at=Point(x=zero, y=zero), stages=stages), links, road_of)


def _last_headings(topology: Topology) -> dict[str, float]:
    """The direction (rad) in which each edge comes to its end, from the last two points of its first lane."""
    ends = {edge.id: edge.lanes[0].shape[-2:] for edge in topology.edges.values() if edge.lanes}
    return {edge: math.atan2(y1 - y0, x1 - x0) for edge, ((x0, y0), (x1, y1)) in ends.items()}


def _named(*headings: float) -> str:
    """Name a stage after the compass points that its traffic comes from: northbound traffic comes from `s`."""
    clockwise_from_north = (math.pi / 2 - (heading + math.pi) for heading in headings)
    points = {_COMPASS[round(angle / (math.pi / 4)) % len(_COMPASS)] for angle in clockwise_from_north}
    words = sorted(points, key=_ORDER.index)
    return f"{('' if all(len(word) == 1 for word in words) else '_').join(words)}_go"


def _numbered(stages: Sequence[tuple[str, tuple[str, ...]]]) -> list[tuple[str, tuple[str, ...]]]:
    """Number stages of the same name: `e_go`, `e_2_go`."""
    seen: Counter[str] = Counter()
    numbered = []
    for name, edges in stages:
        seen[name] += 1
        numbered.append((name if seen[name] == 1 else f"{name.removesuffix('_go')}_{seen[name]}_go", edges))
    return numbered
