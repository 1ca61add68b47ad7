"""Fixed-time signal programs: written for the language's stages, read back from any net."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from foresee_dsl.compile.bundle import Phase, Signal
from foresee_dsl.compile.nets.safe_xml import parse_net
from foresee_dsl.compile.templates import render
from foresee_dsl.errors import CompileError
from foresee_dsl.language.model import Junction, Network, Quantity, Stage

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element  # the type only; files are parsed by defusedxml

AMBER_S = 3.0
"""SUMO's default (netconvert --tls.yellow.time) for 50 km/h; the same in Germany's RiLSA."""
ALL_RED_S = 2.0
"""Ours: a vehicle that enters at the end of amber with 30 km/h has cleared the 15 to 17 m of our junctions."""
PEDESTRIAN_CLEARANCE_S = 5.0
"""Ours (SUMO's default for --tls.crossing-clearance.time too): with the amber and all red that follow, 10 s, enough for
12 m at 1.2 m/s. A stage under 10 s gives half of itself."""

NAMED_STAGES = "foresee.stages"
"""A parameter of programs in foreign nets whose phases are called like the stages that they belong to."""

_VEHICLE_GREEN = "Gg"


@dataclass(frozen=True)
class Link:
    """One movement that a signal controls.

    Attributes:
        index: its place in the state string.
        edge: where a vehicle movement comes from; "" for a crossing.
        crosses: the edges that a crossing lies over; empty for a vehicle movement.
        direction: SUMO's letter: `s` straight, `l` left, `r` right, `t` turn back, `L`/`R` half left and right; "" for
            a crossing.
        foes: indices of the movements that it conflicts with. yields_to: those that it must let pass first.
    """

    index: int
    edge: str
    crosses: tuple[str, ...]
    direction: str
    foes: frozenset[int]
    yields_to: frozenset[int]

    @property
    def is_crossing(self) -> bool:
        """True for pedestrians."""
        return bool(self.crosses)


def program(junction: Junction, links: Sequence[Link], roads_of: Mapping[str, str]) -> Signal:
    """Make the program of a junction from its stages.

    Args:
        junction: its stages name roads.
        links: all movements that the signal controls, by index.
        roads_of: road names by edge id.

    Raises:
        CompileError: no stages, nothing to control, or a stage names a road that does not enter the junction.
    """
    if not links:
        raise CompileError(f"junction {junction.name} has a signal, but there is no movement that it could control")
    if not junction.stages:
        raise CompileError(f"the signal of junction {junction.name} has no stages")
    entering = {roads_of[link.edge] for link in links if not link.is_crossing}
    phases: list[Phase] = []
    for k, stage in enumerate(junction.stages):
        unknown = [road for road in stage.green if road not in entering]
        if unknown:
            raise CompileError(
                f"stage {stage.name} of junction {junction.name} gives green to {unknown[0]}, which does not enter it "
                f"(these do: {', '.join(sorted(entering))})"
            )
        phases += _stage_phases(k, stage, links, roads_of)
    return Signal(junction.name, junction.name, tuple(s.name for s in junction.stages), tuple(phases))


def write_programs(
    programs: Sequence[Signal], out: Path, *, program_id: str = "0", offsets: Mapping[str, float] | None = None
) -> None:
    """Write programs for netconvert or SUMO; a phase's name is its stage's.

    Args:
        programs: one for each signal.
        out: the file.
        program_id: SUMO's name for all of them; "0" is what netconvert calls its own.
        offsets: when a signal's first phase begins, by SUMO's id, s; 0 where it is absent.
    """
    render("signals.tll.xml", out, programs=programs, program_id=program_id, offsets=offsets or {})


def read_signals(net_file: Path, network: Network | None) -> dict[str, Signal]:
    """Read the signals of a net, by junction.

    Args:
        net_file: a SUMO net.
        network: what it was built from; None for a foreign one. Then every phase is a stage of its own, `phase_N`, but
            for programs that we gave it (`programs.give_programs`), and a program that controls several junctions
            appears once for each.

    Raises:
        CompileError: not a net, or not the net of `network`.
    """
    root = parse_net(net_file)
    found = {}
    for junction, tls in sorted(_controlled(root).items()):
        logic = next((e for e in root.iterfind("tlLogic") if e.get("id") == tls), None)
        if logic is None:
            continue  # a foreign net may leave a movement's program out; SUMO then switches it off
        phases = [
            (e.get("name", ""), e.get("state", ""), float(e.get("duration", "0"))) for e in logic.iterfind("phase")
        ]
        names = tuple(dict.fromkeys(name for name, _, _ in phases))
        ours = any(e.get("key") == NAMED_STAGES for e in logic.iterfind("param"))
        if network is None and not ours:
            names = tuple(f"phase_{k}" for k in range(len(phases)))
            phases = [(f"phase_{k}", state, duration) for k, (_, state, duration) in enumerate(phases)]
        found[junction] = Signal(junction, tls, names, _grouped(names, phases))
    if network is not None:
        _check_stages(found, network)
    return found


def read_links(root: Element, junction: str) -> tuple[Link, ...]:
    """Return the movements that a junction's signal controls, by index; none where netconvert gave it no signal."""
    node = next((e for e in root.iterfind("junction") if e.get("id") == junction), None)
    if node is None:
        return ()
    requests = {
        int(e.get("index", "0")): (_bits(e.get("foes")), _bits(e.get("response"))) for e in node.iterfind("request")
    }
    place = _request_of_via(root, node.get("intLanes", "").split())
    crossings = {
        e.get("id", ""): tuple(e.get("crossingEdges", "").split()) for e in root.iterfind("edge[@function='crossing']")
    }
    controlled: list[tuple[int, Element, int]] = []
    for connection in root.iterfind(f"connection[@tl='{junction}']"):
        lane = connection.get("via") or f"{connection.get('to')}_{connection.get('toLane')}"
        controlled.append((int(connection.get("linkIndex", "0")), connection, place[lane]))
    index_of = {request: index for index, _, request in controlled}
    links = []
    for index, connection, request in sorted(controlled, key=lambda c: c[0]):
        over = crossings.get(connection.get("to", ""), ())
        foes, response = ({index_of[r] for r in bits if r in index_of} for bits in requests[request])
        links.append(
            Link(
                index=index,
                edge="" if over else connection.get("from", ""),
                crosses=over,
                direction="" if over else connection.get("dir", ""),
                foes=frozenset(foes),
                yields_to=frozenset(response),
            )
        )
    return tuple(links)


def check_same_links(first: Path, second: Path) -> None:
    """Make sure that two builds number the movements of all signals alike.

    Raises:
        CompileError: they do not, so that a program for the one does not fit the other.
    """
    if _link_table(first) != _link_table(second):
        raise CompileError("netconvert numbered the signals' movements differently when it was given their programs")


def _stage_phases(k: int, stage: Stage, links: Sequence[Link], roads_of: Mapping[str, str]) -> list[Phase]:
    """The phases of one stage: green (split where pedestrians stop earlier), amber, all red."""
    if not isinstance(stage.duration, Quantity):
        raise CompileError(f"a network cannot use the parameter {stage.duration.name}")
    green_s = stage.duration.si
    state = stage_state(frozenset(stage.green), links, roads_of)
    walks = {link.index for link in links if link.is_crossing and state[link.index] == "G"}
    alone = "".join("r" if i in walks else c for i, c in enumerate(state))
    parts = [(state, green_s)]
    if walks:
        clearance = min(PEDESTRIAN_CLEARANCE_S, green_s / 2)
        parts = [(state, green_s - clearance), (alone, clearance)]
    parts.append(("".join("y" if c in _VEHICLE_GREEN else "r" for c in alone), AMBER_S))
    parts.append(("r" * len(state), ALL_RED_S))
    phases, since = [], 0.0
    for text, duration in parts:
        phases.append(Phase(k, text, duration, since))
        since += duration
    return phases


def stage_state(green: frozenset[str], links: Sequence[Link], roads_of: Mapping[str, str]) -> str:
    """Return the state string of a stage's green: `G` go, `g` go but yield, `r` stop.

    Vehicles from the named roads go. Pedestrians go where the road that they cross is not named, and where every
    vehicle that may come across is one that yields to them (it turns).
    """
    moving = {link.index for link in links if not link.is_crossing and roads_of[link.edge] in green}
    by_index = {link.index: link for link in links}
    walking = {
        link.index
        for link in links
        if link.is_crossing
        and not any(roads_of[edge] in green for edge in link.crosses)
        and all(_gives_way(by_index[foe], link) for foe in link.foes & moving)
    }
    going = moving | walking
    letters = []
    for link in links:
        if link.index not in going:
            letters.append("r")
        else:
            letters.append("g" if not link.is_crossing and link.yields_to & going else "G")
    return "".join(letters)


def _gives_way(vehicle: Link, crossing: Link) -> bool:
    return vehicle.direction != "s" and crossing.index in vehicle.yields_to


def _grouped(names: tuple[str, ...], phases: Sequence[tuple[str, str, float]]) -> tuple[Phase, ...]:
    """Give every phase its stage and the time since that stage began."""
    since = dict.fromkeys(names, 0.0)
    result = []
    for name, state, duration in phases:
        result.append(Phase(names.index(name), state, duration, since[name]))
        since[name] += duration
    return tuple(result)


def _check_stages(found: Mapping[str, Signal], network: Network) -> None:
    for junction in network.body:
        if isinstance(junction, Junction) and junction.control == "signals":
            wanted = tuple(stage.name for stage in junction.stages)
            if junction.name not in found or found[junction.name].stages != wanted:
                raise CompileError(f"the net has no signal with the stages of junction {junction.name}")


def _controlled(root: Element) -> dict[str, str]:
    """Signal ids by the junctions that they control."""
    ends = {e.get("id", ""): e.get("to", "") for e in root.iterfind("edge")}
    result: dict[str, str] = {}
    for connection in root.iterfind("connection[@tl]"):
        source = connection.get("from", "")
        # Internal edges are called ":JUNCTION_3", walking areas ":JUNCTION_w0".
        junction = source[1:].rpartition("_")[0] if source.startswith(":") else ends.get(source, "")
        result.setdefault(junction, connection.get("tl", ""))
    return result


def _request_of_via(root: Element, internal_lanes: Sequence[str]) -> dict[str, int]:
    """Place in the junction's right-of-way table, by the first internal lane of a movement (or a crossing's lane).

    The table is in the order of the junction's internal lanes; of a movement that waits in the middle it is the second
    lane that is listed.
    """
    place = {lane: k for k, lane in enumerate(internal_lanes)}
    for connection in root.iterfind("connection"):
        lane = connection.get("via", "")
        if lane in place and connection.get("from", "").startswith(":"):
            place[f"{connection.get('from')}_{connection.get('fromLane')}"] = place[lane]
    return place


def _link_table(net_file: Path) -> list[tuple[str, ...]]:
    keys = ("tl", "linkIndex", "from", "fromLane", "to", "toLane")
    return sorted(tuple(e.get(key, "") for key in keys) for e in parse_net(net_file).iterfind("connection[@tl]"))


def _bits(text: str | None) -> frozenset[int]:
    """Indices of the ones in a right-of-way string; the rightmost is index 0."""
    return frozenset(k for k, c in enumerate(reversed(text or "")) if c == "1")
