"""Fixed-time signal programs: builds them from the language's stages, writes them for SUMO, reads them from any net."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.bundle import Phase, Signal
from foresee_dsl.compile.roads.topology import Crossing, Movement, Topology
from foresee_dsl.compile.templates import render
from foresee_dsl.errors import CompileError
from foresee_dsl.language.model import Junction, Network, Quantity, Stage
from foresee_dsl.language.printer import written

AMBER_S = 3.0
"""Duration of amber, s: SUMO's default (netconvert --tls.yellow.time) for 50 km/h; the same as in Germany's RiLSA."""
ALL_RED_S = 2.0
"""Duration of the all-red phase, s. Ours: a vehicle that enters at the end of amber at 30 km/h has then crossed a
junction of 15 to 17 m."""
PEDESTRIAN_CLEARANCE_S = 5.0
"""Time before the end of green in which pedestrians already have red, s (at most half of the stage). Ours, and SUMO's
default for --tls.crossing-clearance.time: together with amber and all-red, pedestrians have 10 s to leave the road,
enough for 12 m at 1.2 m/s.
"""

NAMED_STAGES = "foresee.stages"
"""Key of the `param` that marks our programs in foreign nets; the names of their phases are the names of stages."""

_VEHICLE_GREEN = "Gg"


@dataclass(frozen=True)
class Link:
    """A movement that a signal controls.

    Attributes:
        index: its index in the state string.
        edge: the edge from which vehicles come; "" for a crossing.
        crosses: the edges that a crossing crosses; empty for a vehicle movement.
        direction: SUMO's letter: `s` straight, `l` left, `r` right, `t` turn back, `L`/`R` half left and right; "" for
            a crossing.
        foes: indices of the conflicting movements.
        yields_to: indices of the movements that have priority over it.
    """

    index: int
    edge: str
    crosses: tuple[str, ...]
    direction: str
    foes: frozenset[int]
    yields_to: frozenset[int]

    @property
    def is_crossing(self) -> bool:
        """True for a movement of pedestrians."""
        return bool(self.crosses)


def program(junction: Junction, links: Sequence[Link], roads_of: Mapping[str, str]) -> Signal:
    """Return the program of a junction, built from its stages, which name roads.

    `links` holds all movements that the signal controls, ordered by index; `roads_of` holds the names of the roads by
    edge id.
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
    """Write programs for netconvert or SUMO; the name of a phase is the name of its stage.

    Args:
        program_id: SUMO's id of all programs; netconvert's own have "0".
        offsets: beginning of the first phase, s, by SUMO's id of the signal; 0 for a signal that is absent.
    """
    render("signals.tll.xml", out, programs=programs, program_id=program_id, offsets=offsets or {})


def signals_of(root: Element, topology: Topology, network: Network | None) -> dict[str, Signal]:
    """Return the signals of a net by junction, from its tree and its topology.

    `network`: the network from which the net was built; None for a foreign net. In a foreign net, each phase is a stage
    `phase_N`, except in programs of `give_programs`, and a program for several junctions appears once for each of them.
    """
    controlled: dict[str, str] = {}
    for movement in _with_signal(topology):
        controlled.setdefault(movement.junction, movement.tls or "")
    logics = {e.get("id", ""): e for e in reversed(root.findall("tlLogic"))}
    signals = {}
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
        signals[junction] = Signal(junction, tls, names, _grouped(names, phases))
    if network is not None:
        _check_stages(signals, network)
    return signals


def links_of(topology: Topology, junction: str) -> tuple[Link, ...] | None:
    """Return the movements that a junction's signal controls, ordered by index; empty if the junction has no signal.

    It is None if the signal also controls another junction, or the right-of-way matrix has no row for a movement.
    """
    controlled = sorted((item for item in _with_signal(topology) if item.tls == junction), key=lambda item: item.link)
    if any(item.junction != junction or item.index < 0 for item in controlled):
        return None
    node = topology.junctions.get(junction)
    if node is None or not controlled:
        return ()
    return tuple(
        Link(
            index=item.link,
            edge="" if isinstance(item, Crossing) else item.from_edge,
            crosses=item.edges if isinstance(item, Crossing) else (),
            direction="" if isinstance(item, Crossing) else item.direction,
            foes=frozenset(other.link for other in controlled if node.conflicts(item.index, other.index)),
            yields_to=frozenset(other.link for other in controlled if node.yields(item.index, other.index)),
        )
        for item in controlled
    )


def check_same_links(first: Topology, second: Topology) -> None:
    """Check that two builds of a net number the movements of all signals equally, so that programs fit both.

    Raises:
        CompileError: they do not.
    """
    first_links, second_links = (
        sorted((m.tls or "", m.link, m.ends) for m in _with_signal(t)) for t in (first, second)
    )
    if first_links != second_links:
        raise CompileError("netconvert numbered the signals' movements differently when it was given their programs")


def _with_signal(topology: Topology) -> list[Movement | Crossing]:
    both: tuple[Movement | Crossing, ...] = (*topology.movements, *topology.crossings.values())
    return [item for item in both if item.tls is not None]


def _stage_phases(k: int, stage: Stage, links: Sequence[Link], roads_of: Mapping[str, str]) -> list[Phase]:
    """Return the phases of a stage: green (two phases if pedestrians stop earlier), amber, all red."""
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

    Vehicles from the named roads go. Pedestrians go if the road that they cross is not named, and if all vehicles that
    could cross their way are turning and yield to them.
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
    """Return the phases with their stages, each with the time from the beginning of the stage to that of the phase."""
    since = dict.fromkeys(names, 0.0)
    result = []
    for name, state, duration in phases:
        result.append(Phase(names.index(name), state, duration, since[name]))
        since[name] += duration
    return tuple(result)


def _check_stages(signals: Mapping[str, Signal], network: Network) -> None:
    for junction in network.body:
        if isinstance(junction, Junction) and junction.control == "signals":
            wanted = tuple(stage.name for stage in junction.stages)
            if junction.name not in signals or signals[junction.name].stages != wanted:
                raise CompileError(f"the net has no signal with the stages of junction {junction.name}")
