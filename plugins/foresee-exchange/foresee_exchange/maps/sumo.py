"""Import of a SUMO network: the net unchanged, and a scenario on it that `idm` has driven once without traffic."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import tostring  # only to write elements; `safe_xml` parses

from foresee_dsl.compile.foreign.geometry_repair import Geometry
from foresee_dsl.compile.foreign.networks import Tell, in_silence
from foresee_dsl.compile.foreign.signal_programs import fix_times
from foresee_dsl.compile.nets.netconvert import NetconvertLimitError, without_header
from foresee_dsl.compile.nets.safe_xml import parse_xml, unpacked
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.topology import Topology
from foresee_dsl.errors import CompileError, InputError, SimulationError
from foresee_dsl.exchange.bridges import bridge_notes
from foresee_dsl.exchange.outcome import ExchangeError, Imported, import_together, write_text
from foresee_dsl.exchange.starter import Drive, Ground, starter
from foresee_dsl.language import model as m
from foresee_dsl.language.model import Scenario
from foresee_exchange.maps.cutting import CUT, Part, cut_net
from foresee_exchange.naming import name_of, sentence

NET = ".net.xml"
_SHOWN = 3
"""Maximum number of places that a note lists (ours)."""
Contents = tuple[dict[str, int], Counter[str], tuple[str, ...]]
"""Report on a map: counts of the elements that are taken over and that are left out, and notes on guesses."""


def run(file: Path, *, out: Path, part: Part | None = None, tell: Tell = in_silence) -> Imported:
    """Write `NAME.net.xml` and the scenario `NAME.foresee` for a SUMO network `NAME.net.xml`.

    Args:
        part: the part to keep, as `NAME_part`; None: all. tell: called with each step that takes long.
    """
    name = name_of(file.name.removesuffix(".gz").removesuffix(NET).removesuffix(".xml"), "net")
    if part is None:
        return _run(file, name, out, file.name, (), tell)
    with tempfile.TemporaryDirectory(prefix="foresee-net-") as folder:
        cut, note = cut_net(file, part, Path(folder), tell)
        return _run(cut, part_name(name), out, f"a part of {file.name}", (note,), tell)


def part_name(name: str) -> str:
    """Return the name for a part of a map, which differs from the map's own, so that no file of the map is replaced."""
    return f"{name}_part"


def _run(file: Path, name: str, out: Path, source: str, notes: tuple[str, ...], tell: Tell) -> Imported:
    tell("reading the network")
    root = parse_xml(file, "net", "a SUMO network", ExchangeError)
    if root.find("edge") is None or root.find("location") is None:
        raise ExchangeError(f"{file} is not a complete SUMO network: it has no edges or no location")
    changed = fix_times(root)
    left_out = Counter(
        {
            "signal programs that react to traffic (driven with fixed times)": changed.reacting,
            "signal programs besides the one that SUMO begins with": changed.others,
        }
    )
    data = tostring(root, encoding="utf-8", xml_declaration=True) if changed else without_header(unpacked(file))
    del root  # this frees as much memory as all later steps need
    return with_starter(
        data,
        f"{name}{NET}",
        name,
        out,
        source=source,
        contents=lambda parts: (counts(parts), left_out, notes),
        tell=tell,
    )


def with_starter(
    data: bytes,
    file: str,
    name: str,
    out: Path,
    *,
    source: str,
    contents: Callable[[Topology], Contents],
    tell: Tell = in_silence,
) -> Imported:
    """Write a network and the scenario `NAME.foresee` that runs on it, together or not at all.

    Args:
        data, file: the network file's bytes and name. name: the scenario's name.
        source: origin of the network, for the scenario's `doc`. contents: returns the report on the net.
        tell: called with each step that takes long.
    """

    def write(folder: Path) -> Imported:
        (folder / file).write_bytes(data)
        ground = _ground(folder / file, tell)
        roads = ground.roads
        doc = sentence(f"A first drive on {source}.")

        def find(without: frozenset[str]) -> tuple[Scenario, Drive]:
            tell("searching a route for the ego")
            first = starter(ground, name=name, network=file, doc=doc, without=without)
            tell(f"driving the ego's route of {first[1].length_m:.0f} m")
            return first

        scenario, way, drive = first_that_arrives(find, folder, roads)
        write_text(folder / f"{name}.foresee", scenario)
        taken, left_out, notes = contents(roads)
        flat = bridge_notes(ground.bridges)
        drive_notes = (*_of_the_drive(name, way, drive), *notes, *ground.notes, *_side(roads), *flat)
        return Imported((), 1, taken, +left_out, (*drive_notes, *geometry_notes(ground.geometry)))

    return import_together(out, write)


def _ground(file: Path, tell: Tell) -> Ground:
    try:
        return Ground.of(file, tell)
    except NetconvertLimitError as err:
        raise ExchangeError(f"{err}; or {CUT}") from err


def _of_the_drive(name: str, way: Drive, drive: DriveResult) -> tuple[str, ...]:
    over = f" over the signal of {', '.join(way.signals)}" if way.signals else " without a signal: no route has one"
    notes = [f"the ego drives {way.length_m:.0f} m{over}; edit {name}.foresee for another route"]
    if not drive.arrived:
        notes.append(
            f"idm, alone on the road, does not reach its goal on any of the routes that were tried: {drive.reason}"
        )
    return tuple(notes)


def _side(roads: RoadNetwork) -> tuple[str, ...]:
    return ("traffic keeps to the left",) if roads.left_hand else ()


def geometry_notes(geometry: Geometry) -> tuple[str, ...]:
    """Return notes on a map's lines: the repaired ones, and those that remain broken."""
    notes = []
    if geometry.repaired:
        notes.append(f"{len(geometry.repaired)} lines that a car cannot follow were smoothed, within their lanes and "
                     f"junctions: {_some(geometry.repaired)}")  # fmt: skip
    if geometry.broken:
        notes.append(f"{len(geometry.broken)} places are defective and were closed, so that no route leads over them: "
                     f"{_some(geometry.broken)}; `foresee check` lists them all")  # fmt: skip
    return tuple(notes)


def _some(places: Sequence[str]) -> str:
    more = f"; {len(places) - _SHOWN} more" if len(places) > _SHOWN else ""
    return "; ".join(places[:_SHOWN]) + more


def counts(parts: Topology) -> dict[str, int]:
    """Return counts of a net's elements, by name."""
    open_to = [edge for edge in parts.edges.values() if edge.for_kind("car")]
    return {
        "edges for cars": len(open_to),
        "junctions": len({edge.end for edge in open_to}),
        "signals": len({m.tls for m in parts.movements if m.tls}),
        "crossings": len(parts.crossings),
    }


_DRIVER = "idm"
_MOST_TRIED = 6
"""Maximum number of routes that `idm` drives until it arrives (ours: each takes a second or two)."""
_NEAR_M = 30.0


@dataclass(frozen=True)
class DriveResult:
    """Result of a drive without traffic: whether the vehicle arrived and, if it did not, the reason in words and the
    edges on which it ended."""

    arrived: bool
    reason: str
    ended_on: frozenset[str] = frozenset()


def first_that_arrives(
    find: Callable[[frozenset[str]], tuple[m.Scenario, Drive]], folder: Path, roads: RoadNetwork
) -> tuple[m.Scenario, Drive, DriveResult]:
    """Return the best route on which `idm` reaches its goal without traffic; if there is none, the best route and the
    result of its drive.

    `find` returns the best route without some edges. `folder` contains the network; temporary files there are removed.
    """
    scenario, way = find(frozenset())
    drive = driven_alone(scenario, folder, roads)
    first = scenario, way, drive
    without: frozenset[str] = frozenset()
    for _ in range(_MOST_TRIED - 1):
        if drive.arrived:
            return scenario, way, drive
        without |= drive.ended_on or {way.edges[0]}
        try:
            scenario, way = find(without)
        except ExchangeError:  # there are no further routes
            return first
        drive = driven_alone(scenario, folder, roads)
    return (scenario, way, drive) if drive.arrived else first


def driven_alone(scenario: m.Scenario, folder: Path, roads: RoadNetwork) -> DriveResult:
    """Place all actors of a scenario, then drive it without its background traffic; return the result."""
    # Imported here, because SUMO and the drivers are slow to import.
    from foresee_dsl.campaign.driving import run_test_case
    from foresee_dsl.compile import compile_test_case
    from foresee_dsl.language.project.loading import load_test_case
    from foresee_dsl.simulate.results.verdict import Verdict
    from foresee_dsl.simulate.trace import X, Y

    body = tuple(item for item in scenario.body if not isinstance(item, m.Traffic))
    file = folder / "first_drive.foresee"
    try:
        write_text(file, scenario)
        compile_test_case(load_test_case(file))  # checks that the traffic can be placed, too
        write_text(file, scenario.model_copy(update={"body": body}))
        result = run_test_case(load_test_case(file), _DRIVER, 0, deadlines=None)
    except (InputError, CompileError, SimulationError) as err:
        return DriveResult(False, str(err).replace(f"{file}:", ""))
    finally:
        file.unlink(missing_ok=True)
    x, y = (float(value) for value in result.trace.states[-1, 0, [X, Y]])
    return DriveResult(result.verdict is Verdict.PASS, result.reason, _edges_at(roads, x, y))


def _edges_at(roads: RoadNetwork, x: float, y: float) -> frozenset[str]:
    """Return the edge at a place; inside a junction, the target edges of the nearest lane there."""
    near = roads.nearest_lane(x, y, within_m=_NEAR_M)
    if near is None:
        return frozenset()
    if not near.lane.internal:
        return frozenset({near.lane.edge})
    return frozenset(movement.to_edge for movement in roads.movements_through(near.lane.id))
