"""`foresee import carla`: CARLA's leaderboard routes become scenarios, a file a family, a case a route."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.cache import read_net_once
from foresee_dsl.compile.nets.safe_xml import parse_xml
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.exchange.carla.families import STAGED, Row, row_of
from foresee_dsl.exchange.carla.files import read_routes, read_triggers, read_vtypes, town_of
from foresee_dsl.exchange.carla.journey import Journey, passes
from foresee_dsl.exchange.carla.match import Import, journeys_of, of_town
from foresee_dsl.exchange.carla.models import CATALOGUE, catalogue_of, ego_of, vehicles_of
from foresee_dsl.exchange.carla.net import prepared_net
from foresee_dsl.exchange.carla.text import FileOfCases, placed_wrongly, text_of
from foresee_dsl.exchange.maps.contents import left_out_of, notes_on
from foresee_dsl.exchange.maps.heights import Heights
from foresee_dsl.exchange.naming import check_ids, distinct_name, file_name
from foresee_dsl.exchange.outcome import ExchangeError, Imported, write_together
from foresee_dsl.language.model import Catalogue, VehicleModel
from foresee_dsl.language.project.loading import bundled_models


def run(
    map_file: Path,
    route_files: Sequence[Path],
    trigger_files: Sequence[Path] = (),
    *,
    out: Path,
    vtypes: Path | None = None,
) -> Imported:
    """Write a scenario file for each family, with a case for each route, and the network that they use.

    Args:
        map_file: `TownXX.xodr`, which is copied, or a SUMO net made of it, which is prepared: without an offset, with
            sidewalks and crossings.
        route_files: XML. trigger_files: JSON. A file's name (or its folder's) says the family: `Scenario7`.
        out: the folder to write into.
        vtypes: CARLA's blueprints; they become a catalogue, and the ego one of them.

    Raises:
        CompileError: a file is unreadable, too large, no such file, or declares entities.
        ExchangeError: the routes belong to another town, or nothing can be imported.
        InputError: what was written has mistakes (a fault of ours).
    """
    if not route_files:
        raise ExchangeError("there are no route files: name at least one")
    left_out: Counter[str] = Counter()
    routes = [route for file in route_files for route in read_routes(file, left_out)]
    triggers = [trigger for file in trigger_files for trigger in read_triggers(file, left_out)]
    routes = of_town(map_file, routes, left_out)
    catalogue = catalogue_of(read_vtypes(vtypes), left_out) if vtypes is not None else None
    found: list[Imported] = []

    def write(folder: Path) -> None:
        net = _put_network(map_file, folder)
        state = _state(net, _models(catalogue), left_out)
        journeys = journeys_of(state, routes, triggers)
        files = _files(state, journeys, net.name, catalogue)
        _write_files(state, files, folder, catalogue)
        _list_map(state, map_file)
        cases = sum(len(file.rows) for file in files.values())
        found.append(Imported((), cases, dict(state.taken), +state.left_out, tuple(state.notes)))

    files = write_together(out, write)
    done = found[0]
    return Imported(files, done.cases, done.taken, done.left_out, done.notes)


def _put_network(map_file: Path, folder: Path) -> Path:
    copy = folder / file_name(map_file.name)
    if map_file.name.endswith(".net.xml"):
        prepared_net(map_file, copy)
    elif map_file.suffix == ".xodr":
        parse_xml(map_file, "OpenDRIVE", "an OpenDRIVE map")  # says what is wrong before anything is copied
        shutil.copyfile(map_file, copy)
    else:
        raise ExchangeError(f"{map_file} is no map: its name must end in .xodr or .net.xml")
    return copy


def _models(catalogue: Catalogue | None) -> dict[str, VehicleModel]:
    own = {model.name: model for model in catalogue.body if isinstance(model, VehicleModel)} if catalogue else {}
    return bundled_models() | own


def _state(net: Path, models: Mapping[str, VehicleModel], left_out: Counter[str]) -> Import:
    net_file = foreign_net(net)
    parts, signals = read_net_once(net_file, None)
    network = RoadNetwork.of(parts)
    if not any(edge.for_kind("car") for edge in network.edges.values()):
        raise ExchangeError(f"{net.name} has no lanes for cars: nobody could drive on it")
    check_ids((*network.edges, *network.junctions), net.name)
    return Import(network, signals, Heights.of(net_file), spec_of(models[ego_of(models)]), left_out)


def _files(state: Import, journeys: Sequence[Journey], net: str, catalogue: Catalogue | None) -> dict[str, FileOfCases]:
    """Sort the cases into files by name: a family, and where need be what of it has no signal or nothing staged."""
    rows: dict[str, list[Row]] = {}
    sources: dict[str, dict[str, None]] = {}
    names: dict[str, set[str]] = {}
    count: Counter[str] = Counter()
    for journey in journeys:
        family = journey.route.family
        taken = names.setdefault(family, set())
        name = distinct_name(f"route_{journey.route.id}", "route", taken)
        taken.add(name)
        row = _row(state, journey, name, count[family], net, catalogue)
        if row is None:
            state.left_out["routes that the compiler cannot place"] += 1
            continue
        count[family] += 1
        rows.setdefault(_file_name(row), []).append(row)
        sources.setdefault(_file_name(row), {})[journey.route.file.name] = None
    _tell_families(state, [row for found in rows.values() for row in found])
    return {
        name: FileOfCases(name, net, tuple(found), catalogue, tuple(sources[name]), town_of(Path(net)))
        for name, found in sorted(rows.items())
    }


def _tell_families(state: Import, rows: Sequence[Row]) -> None:
    count = Counter(row.family for row in rows)
    for family, number in sorted(count.items(), key=lambda item: item[0].zfill(3)):
        state.taken[f"routes of family {family}" if family else "routes without a family"] += number
        if family not in STAGED:
            state.left_out[f"behaviour of Scenario{family or '?'}, which we do not know"] += number
    unstaged = sum(row.variant == "open" and row.family in STAGED for row in rows)
    state.left_out["routes on which there is no place for their family's behaviour"] += unstaged
    state.left_out["routes over or under another road (the world is flat: they have no traffic)"] += sum(
        row.bridge for row in rows
    )
    if not state.has_sidewalks:
        state.notes.append("the map has no sidewalks: besides those of the families nobody walks around")


def _row(state: Import, journey: Journey, name: str, number: int, net: str, catalogue: Catalogue | None) -> Row | None:
    """The case of a route: staged where the compiler finds a place for everybody, else open; None for neither.

    Where there are no sidewalks nobody walks around.
    """
    bridge = passes(journey, state.bridges)
    for staged in (True, False):
        row = row_of(state.network, state.signals, journey, name=name, number=number, staged=staged)
        row = replace(row, bridge=bridge, walkers=state.has_sidewalks)
        file = FileOfCases(_file_name(row), net, (row,), catalogue, (), "")
        if not placed_wrongly(file, state.network, state.signals):
            return row
    return None


def _file_name(row: Row) -> str:
    family = f"scenario{row.family}" if row.family else "routes"
    name = f"{family}_{row.variant}" if row.variant and row.family in STAGED else family
    at_junction = row.family in STAGED and row.variant in ("", "walker") and row.family != "3"
    name = f"{name}_no_signal" if at_junction and not row.signal else name
    return f"{name}_bridge" if row.bridge else name


def _write_files(state: Import, files: Mapping[str, FileOfCases], folder: Path, catalogue: Catalogue | None) -> None:
    from foresee_dsl.language.printer import print_model

    if not files:
        raise ExchangeError("no route could be imported: " + (state.notes[0] if state.notes else "there is none"))
    if catalogue is not None:
        (folder / CATALOGUE).write_text(print_model(catalogue), encoding="utf-8", newline="\n")
        state.taken["blueprints"] += len(vehicles_of(catalogue))
    for name, file in files.items():
        (folder / f"{name}.foresee").write_text(text_of(file), encoding="utf-8", newline="\n")


def _list_map(state: Import, map_file: Path) -> None:
    if map_file.suffix != ".xodr":
        return
    root = parse_xml(map_file, "OpenDRIVE", "an OpenDRIVE map")
    parts, _ = read_net_once(foreign_net(map_file), None)
    state.left_out.update(left_out_of(root, parts))
    state.notes += notes_on(root, parts)
