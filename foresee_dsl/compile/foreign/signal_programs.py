"""Makes fixed-time signal programs for foreign networks: our own for maps without programs, fixed times for actuated
ones."""

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
"""Duration of a stage's green, s. Ours: as long as the shorter stages of the bundled town; a vehicle at 30 km/h that is
160 m away still reaches it."""
_FIXED = ("static", "rail_signal", "rail_crossing")
"""SUMO's types of programs that do not react to road traffic."""
OPPOSITE_RAD = math.radians(135)
"""Two approaches whose directions differ by at least this share a stage, rad (ours: they are within 45 degrees of
opposite).
"""
_COMPASS = ("n", "ne", "e", "se", "s", "sw", "w", "nw")
_ORDER = ("n", "s", "e", "w", "ne", "sw", "nw", "se")
"""Order of directions in a stage's name: `ns_go`, `ew_go`."""


def give_programs(root: Element) -> int:
    """Replace the programs that netconvert 1.28 invents for a map without programs; return the number of replaced ones.

    Each junction with its own signal gets a stage for each pair of opposite approaches, and for each approach without
    an opposite: 20 s of green, then amber and all red as in our own networks. Vehicles that turn left yield to oncoming
    traffic; pedestrians walk if only turning vehicles, which yield to them, cross their way. The name of a stage is the
    direction from which its traffic comes: `ns_go`, `e_go`. Signals of several junctions keep their programs, and so do
    signals that would get only one stage.
    """
    replaced = 0
    topology = topology_of(root)
    headings = _last_headings(topology)
    for logic in root.iterfind("tlLogic"):
        signal = _program(topology, logic.get("id", ""), headings)
        states = {len(phase.get("state", "")) for phase in logic.iterfind("phase")}
        if signal is None or states != {len(signal.phases[0].state)}:  # the signal controls more than this junction
            continue
        for child in list(logic):
            logic.remove(child)
        for phase in signal.phases:
            name = signal.stages[phase.stage]
            SubElement(logic, "phase", {"duration": number(phase.duration_s), "state": phase.state, "name": name})
        SubElement(logic, "param", {"key": NAMED_STAGES, "value": "named"})
        logic.set("type", "static")
        replaced += 1
    return replaced


@dataclass(frozen=True)
class SignalFixes:
    """What `fix_times` changed: the number of programs that reacted to traffic, and the number of second and further
    programs of signals that it removed.
    """

    reacting: int
    others: int

    def __bool__(self) -> bool:
        """True if there were changes."""
        return bool(self.reacting or self.others)


def fix_times(root: Element) -> SignalFixes:
    """Give each signal for road traffic a single program of fixed times with its own stages.

    There are two reasons: SUMO 1.28 cannot load the state of an actuated program, so a run could not start from a
    clip's state; and our simulator switches the phases in their order.
    """
    last: dict[str, Element] = {}
    reacting = others = 0
    for logic in root.findall("tlLogic"):
        if logic.get("id", "") in last:  # SUMO 1.28 starts with the last of several programs
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
    return SignalFixes(reacting, others)


def stages_of(headings: Mapping[str, float]) -> list[tuple[str, tuple[str, ...]]]:
    """Return the stages (name and approaches) from the headings of the approaches (rad, counter-clockwise from east).

    Each approach shares a stage with the most nearly opposite approach, if that is within 45 degrees of opposite.
    """
    left = sorted(headings)
    stages: list[tuple[str, tuple[str, ...]]] = []
    pairs = sorted((-abs(wrap(headings[a] - headings[b])), a, b) for a, b in combinations(left, 2))
    for apart, first, second in pairs:
        if -apart >= OPPOSITE_RAD and first in left and second in left:
            axis = headings[first] + wrap(headings[second] + math.pi - headings[first]) / 2
            stages.append((_named(axis, axis + math.pi), (first, second)))
            left = [edge for edge in left if edge not in (first, second)]
    stages += [(_named(headings[edge]), (edge,)) for edge in left]
    return _numbered(sorted(stages))


def _program(topology: Topology, tls: str, headings: Mapping[str, float]) -> Signal | None:
    """Return our program for a signal; None if its movements are not exactly those of one junction."""
    links = links_of(topology, tls) or ()
    approaches = {link.edge: headings[link.edge] for link in links if link.edge in headings}
    if not approaches or [link.index for link in links] != list(range(len(links))):
        return None
    edges = sorted({*approaches, *(edge for link in links for edge in link.crosses)})
    road_of = {edge: f"road_{k}" for k, edge in enumerate(edges)}  # ids of a foreign net may not be valid names
    stages = tuple(
        Stage(name=name, duration=Quantity.of(GREEN_S, "time", 0), green=tuple(road_of[edge] for edge in green))
        for name, green in stages_of(approaches)
    )
    if len(stages) < 2:  # the signal protects a crossing on an open road, for which netconvert's program has a phase
        return None
    zero = Quantity.of(0.0, "length", 0)
    return program(Junction(name="foreign", at=Point(x=zero, y=zero), stages=stages), links, road_of)


def _last_headings(topology: Topology) -> dict[str, float]:
    """Return the direction of each edge at its end, rad, from the last two points of its first lane."""
    ends = {edge.id: edge.lanes[0].shape[-2:] for edge in topology.edges.values() if edge.lanes}
    return {edge: math.atan2(y1 - y0, x1 - x0) for edge, ((x0, y0), (x1, y1)) in ends.items()}


def _named(*headings: float) -> str:
    """Return the name of a stage from the headings of its traffic; northbound traffic comes from `s`."""
    clockwise_from_north = (math.pi / 2 - (heading + math.pi) for heading in headings)
    points = {_COMPASS[round(angle / (math.pi / 4)) % len(_COMPASS)] for angle in clockwise_from_north}
    words = sorted(points, key=_ORDER.index)
    return f"{('' if all(len(word) == 1 for word in words) else '_').join(words)}_go"


def _numbered(stages: Sequence[tuple[str, tuple[str, ...]]]) -> list[tuple[str, tuple[str, ...]]]:
    """Return stages with numbers in equal names: `e_go`, `e_2_go`."""
    seen: Counter[str] = Counter()
    numbered = []
    for name, edges in stages:
        seen[name] += 1
        numbered.append((name if seen[name] == 1 else f"{name.removesuffix('_go')}_{seen[name]}_go", edges))
    return numbered
