"""Fixed-time signal programs: made from the language's stages, written for SUMO, and read from any net."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.bundle import Phase, Signal
from foresee_dsl.compile.nets.net_reader import topology_of
from foresee_dsl.compile.nets.safe_xml import parse_net
from foresee_dsl.compile.roads.topology import Crossing, Movement, Topology
from foresee_dsl.compile.templates import render
from foresee_dsl.errors import CompileError
from foresee_dsl.language.model import Junction, Network, Quantity, Stage
from foresee_dsl.language.printer import written

AMBER_S = 3.0
"""SUMO's default (netconvert --tls.yellow.time) for 50 km/h; the same in Germany's RiLSA."""
ALL_RED_S = 2.0
"""Ours: a vehicle that enters at the end of amber with 30 km/h has cleared the 15 to 17 m of our junctions."""
PEDESTRIAN_CLEARANCE_S = 5.0
"""Ours (SUMO's default for --tls.crossing-clearance.time too): with the amber and all red that follow, 10 s, enough for
12 m at 1.2 m/s. A stage under 10 s gives half of itself."""

NAMED_STAGES = "foresee.stages"
"""Key of a `param` that marks our programs in foreign nets: the name of a phase there is the name of its stage."""

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
    """Make the program of a junction from its stages, which name roads.

    `links`: all movements that the signal controls, by index. `roads_of`: road names by edge id.
    """
    if not links:
        raise CompileError(f"junction {junction.name} has a signal, but there is no movement that it could control")
    if not junction.stages:
        raise CompileError(f"the signal of junction {junction.name} has no stages")
    approaches = {roads_of[link.edge] for link in links if not link.is_crossing}
    phases: list[Phase] = []
    for k, stage in enumerate(junction.stages):
        unknown = [road for road in stage.green if road not in approaches]
        if unknown:
            raise CompileError(
                f"stage {stage.name} of junction {junction.name} gives green to {unknown[0]}, which does not enter it "
                f"(these do: {', '.join(sorted(approaches))})"
            )
        phases += _stage_phases(k, stage, links, roads_of)
    return Signal(junction.name, junction.name, tuple(s.name for s in junction.stages), tuple(phases))


def write_programs(
    programs: Sequence[Signal], out: Path, *, program_id: str = "0", offsets: Mapping[str, float] | None = None
) -> None:
    """Write programs for netconvert or SUMO; a phase's name is its stage's.

    `program_id`: SUMO's name for all of them; "0" is what netconvert calls its own. `offsets`: when a signal's first
    phase begins, by SUMO's id, s; 0 where it is absent.
    """
    render("signals.tll.xml", out, programs=programs, program_id=program_id, offsets=offsets or {})


def read_signals(net_file: Path, network: Network | None) -> dict[str, Signal]:
    """Read the signals of a net file, as `signals_of` returns them."""
    root = parse_net(net_file)
    return signals_of(root, topology_of(root), network)


def signals_of(root: Element, topology: Topology, network: Network | None) -> dict[str, Signal]:
    """Return the signals of a net by junction, from its tree and the topology of that.

    `network`: what it was built from; None for a foreign one. Then every phase is a stage of its own, `phase_N`, but
    for programs that we gave it (`give_programs`), and a program that controls several junctions appears once for each.
    """
    controlled: dict[str, str] = {}
    for movement in _with_signal(topology):
        controlled.setdefault(movement.junction, movement.tls or "")
    logics = {e.get("id", ""): e for e in reversed(root.findall("tlLogic"))}
    found = {}
    for junction, tls in sorted(controlled.items()):
        logic = logics[tls]
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


def links_of(topology: Topology, junction: str) -> tuple[Link, ...] | None:
    """Return the movements that a junction's signal controls, by index; none where netconvert gave it no signal.

    None where the signal controls another junction too, or the right-of-way matrix has no row for a movement.
    """
    controlled = sorted((one for one in _with_signal(topology) if one.tls == junction), key=lambda one: one.link)
    if any(one.junction != junction or one.index < 0 for one in controlled):
        return None
    node = topology.junctions.get(junction)
    if node is None or not controlled:
        return ()
    return tuple(
        Link(
            index=one.link,
            edge="" if isinstance(one, Crossing) else one.from_edge,
            crosses=one.edges if isinstance(one, Crossing) else (),
            direction="" if isinstance(one, Crossing) else one.direction,
            foes=frozenset(other.link for other in controlled if node.conflicts(one.index, other.index)),
            yields_to=frozenset(other.link for other in controlled if node.yields(one.index, other.index)),
        )
        for one in controlled
    )


def check_same_links(first: Topology, second: Topology) -> None:
    """Make sure that two builds number the movements of all signals alike: a program for one then fits the other."""
    one, other = (sorted((m.tls or "", m.link, m.ends) for m in _with_signal(t)) for t in (first, second))
    if one != other:
        raise CompileError("netconvert numbered the signals' movements differently when it was given their programs")


def _with_signal(topology: Topology) -> list[Movement | Crossing]:
    both: tuple[Movement | Crossing, ...] = (*topology.movements, *topology.crossings.values())
    return [one for one in both if one.tls is not None]


def _stage_phases(k: int, stage: Stage, links: Sequence[Link], roads_of: Mapping[str, str]) -> list[Phase]:
    """The phases of one stage: green (split where pedestrians stop earlier), amber, all red."""
    if not isinstance(stage.duration, Quantity):
        raise CompileError(f"a network cannot use the parameter in `{written(stage.duration)}`")
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
    begins = accumulate((duration for _, duration in parts), initial=0.0)
    return [Phase(k, text, duration, since) for (text, duration), since in zip(parts, begins, strict=False)]


def stage_state(green: frozenset[str], links: Sequence[Link], roads_of: Mapping[str, str]) -> str:
    """Return the state string of a stage's green: `G` go, `g` go but yield, `r` stop.

    Vehicles from the named roads go. Pedestrians go where the road that they cross is not named, and where every
    vehicle that may come across is one that yields to them (it turns).
    """
    moving = {link.index: link for link in links if not link.is_crossing and roads_of[link.edge] in green}
    walking = {
        link.index
        for link in links
        if link.is_crossing
        and not any(roads_of[edge] in green for edge in link.crosses)
        and all(
            moving[foe].direction != "s" and link.index in moving[foe].yields_to for foe in link.foes & moving.keys()
        )
    }
    going = moving.keys() | walking

    def letter(link: Link) -> str:
        if link.index not in going:
            return "r"
        return "g" if not link.is_crossing and link.yields_to & going else "G"

    return "".join(map(letter, links))


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
