"""`foresee import carla`: CARLA's leaderboard routes become scenarios, one file per family, one case per route."""

from __future__ import annotations

import math
import shutil
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from foresee_dsl.compile.bundle import ModelSpec, Signal
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.compile.foreign.geometry_repair import repair_overlaps
from foresee_dsl.compile.foreign.networks import close_parking, foreign_net, write_net
from foresee_dsl.compile.foreign.signal_programs import fix_times, give_programs
from foresee_dsl.compile.nets.cache import read_net_once
from foresee_dsl.compile.nets.netconvert import run_netconvert
from foresee_dsl.compile.nets.safe_xml import parse_net, parse_xml
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.exchange.bridges import Heights, bridges
from foresee_dsl.exchange.outcome import ExchangeError, Imported, import_together, write_text
from foresee_dsl.exchange.starter import check_network
from foresee_dsl.language.model import Catalogue
from foresee_exchange.carla import files, placed_route, scenario_files
from foresee_exchange.carla.files import CarlaRoute, Trigger, offset_of, town_of
from foresee_exchange.carla.placed_route import PlacedRoute
from foresee_exchange.carla.scenario_files import ScenarioFile
from foresee_exchange.carla.staging import STAGED, Case, case_of
from foresee_exchange.carla.ways import NEAR_M
from foresee_exchange.maps.opendrive import left_out_of, notes_on
from foresee_exchange.naming import distinct_name, file_name

MOST_LOST = 0.5
"""If more than this share of the routes is not on the map, the map is taken to be that of another town (ours)."""
_LEAST_WAY_M = 1.0


@dataclass
class Town:
    """A map with the files that are imported, and the report on the import so far."""

    network: RoadNetwork
    signals: Mapping[str, Signal]
    heights: Heights
    ego: ModelSpec
    left_out: Counter[str] = field(default_factory=Counter)
    taken: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)

    @cached_property
    def bridges(self) -> tuple[XY, ...]:
        """Return the places where a road goes over another, m."""
        return tuple((bridge.x, bridge.y) for bridge in bridges(self.network, self.heights))

    @cached_property
    def has_sidewalks(self) -> bool:
        """Return whether the map has a sidewalk anywhere."""
        return any(lane.kinds == {"pedestrian"} and not lane.internal for lane in self.network.lanes.values())


def routes_in_town(map_file: Path, routes: Sequence[CarlaRoute], left_out: Counter[str]) -> list[CarlaRoute]:
    """Return the routes in the town of a map and count the others; `ExchangeError` if all are in other towns."""
    town = town_of(map_file)
    in_town = [route for route in routes if not town or route.town in ("", town)]
    if not in_town:
        route = routes[0]
        raise ExchangeError(
            f"{route.file}: route {route.id} is in {route.town}, but the map {map_file.name} is {town}: "
            f"use the map of {route.town}, or leave this file out"
        )
    left_out.update(f"routes in {route.town}" for route in routes if town and route.town not in ("", town))
    return in_town


def place_routes(town: Town, routes: Sequence[CarlaRoute], triggers: Sequence[Trigger]) -> list[PlacedRoute]:
    """Return the routes that the ego can drive on the map; count and report the others.

    Raises:
        ExchangeError: most routes are not on the map.
    """
    drivable: list[PlacedRoute] = []
    lost: list[str] = []
    broken: list[str] = []
    of_family = Counter(route.family for route in routes)
    for route in routes:
        near = [t for t in triggers if t.family and t.town in ("", route.town or t.town)]
        try:
            placed = _placed(town, route, near, of_family)
        except RouteError as err:
            lost.append(f"{route.key}: {err}")
            continue
        if placed.start_off_m > NEAR_M:
            lost.append(f"{route.key}: the ego would start {placed.start_off_m:.1f} m from CARLA's start")
        elif placed.finish_m <= _LEAST_WAY_M:
            lost.append(f"{route.key}: its end is at its start")
        elif placed_route.turns_back(placed):
            broken.append(f"{route.key}: it uses lanes that have the wrong direction in the map")
        elif (off := placed_route.strays(town.network, placed))[0] > 0:
            broken.append(f"{route.key}: it leaves the road at ({off[1]:.0f} m, {off[2]:.0f} m) by {off[0]:.1f} m")
        else:
            drivable.append(placed)
    if len(lost) > MOST_LOST * len(routes):
        raise ExchangeError(
            f"{len(lost)} of {len(routes)} routes are not on this map, which may be that of another town: {lost[0]}"
        )
    town.left_out["routes that are not on the map"] += len(lost)
    town.left_out["routes that cannot be driven on this map"] += len(broken)
    town.notes += lost + broken
    _report_places(town, drivable, triggers)
    return drivable


def _placed(town: Town, route: CarlaRoute, triggers: Sequence[Trigger], of_family: Counter[str]) -> PlacedRoute:
    if not route.family:
        placed = placed_route.place_route(town.network, route, [], town.ego, in_order=False, heights=town.heights)
        first = placed.first(triggers)
        route = replace(route, family=first.family if first is not None else "")
    near = route.triggers or [trigger for trigger in triggers if trigger.family == route.family]
    in_order = not route.triggers and len(near) == of_family[route.family]
    return placed_route.place_route(town.network, route, near, town.ego, in_order=in_order, heights=town.heights)


def _place(trigger: Trigger) -> tuple[str, int, int]:
    """Return the family and the place of a trigger, rounded to metres, because CARLA's files repeat some triggers."""
    return trigger.family, round(trigger.pose.x), round(trigger.pose.y)


def _report_places(town: Town, placed: Sequence[PlacedRoute], triggers: Sequence[Trigger]) -> None:
    used = {_place(route.trigger) for route in placed if route.trigger is not None}
    towns = {route.route.town for route in placed if route.route.town}
    elsewhere = [t for t in triggers if t.town and towns and t.town not in towns]
    town.left_out.update(f"triggers in {trigger.town}" for trigger in elsewhere)
    unused = sum(_place(t) not in used for t in triggers if t not in elsewhere)
    town.left_out["triggers that no test case uses (each uses one trigger)"] += unused
    moved = [route.start_off_m for route in placed if route.start_off_m > placed_route.MISSED_M]
    if moved:
        town.notes.append(
            f"routes that start beside CARLA's place (at most {max(moved):.1f} m), made for another map: {len(moved)}"
        )
    without = sum(route.trigger is None for route in placed)
    if without and triggers:
        town.notes.append(
            f"routes without a trigger within 5 m, whose behaviour is therefore placed from the start: {without}"
        )
    town.left_out["goals beside the lane that the ego comes on (the goal is a length along its route)"] += sum(
        math.dist(route.line.at(route.goal_s)[:2], (route.route.end.x, route.route.end.y)) > placed_route.BESIDE_GOAL_M
        for route in placed
    )


SIDEWALK_MOST_MPS = 30.0
"""Speed limit up to which roads get sidewalks, m/s (ours: all CARLA towns except the motorways of Town04 and 05)."""


def run(
    map_file: Path,
    route_files: Sequence[Path],
    trigger_files: Sequence[Path] = (),
    *,
    out: Path,
    vtypes: Path | None = None,
) -> Imported:
    """Write one scenario file per family, with one case per route, and the network that they use.

    Args:
        map_file: `TownXX.xodr`, which is copied; or a SUMO net made from it, which gets an offset of 0,
            sidewalks and crossings.
        route_files: XML. trigger_files: JSON. The name of the file or its folder contains the family: `Scenario7`.
        out: the folder to write into.
        vtypes: CARLA's blueprints, which become a catalogue with the ego's model.

    Raises:
        CompileError: a file is missing, unreadable, too large, or declares entities.
        ExchangeError: the routes belong to another town, or no route can be imported.
        InputError: the written files have errors (our own fault).
    """
    if not route_files:
        raise ExchangeError("there are no route files: give at least one")
    left_out: Counter[str] = Counter()
    routes = [route for file in route_files for route in files.read_routes(file, left_out)]
    triggers = [trigger for file in trigger_files for trigger in files.read_triggers(file, left_out)]
    routes = routes_in_town(map_file, routes, left_out)
    catalogue = scenario_files.catalogue_of(files.read_vtypes(vtypes), left_out) if vtypes is not None else None

    def write(folder: Path) -> Imported:
        net = _put_network(map_file, folder)
        town = _town(net, catalogue, left_out)
        written = _scenario_files(town, place_routes(town, routes, triggers), net.name, catalogue)
        if not written:
            raise ExchangeError(
                "no route could be imported: " + (town.notes[0] if town.notes else "the files contain none")
            )
        if catalogue is not None:
            write_text(folder / scenario_files.CATALOGUE, catalogue)
            town.taken["blueprints"] += len(scenario_files.vehicles_of(catalogue))
        for file in written:
            (folder / f"{file.name}.foresee").write_text(scenario_files.text_of(file), encoding="utf-8", newline="\n")
        if map_file.suffix == ".xodr":
            root = parse_xml(map_file, "OpenDRIVE", "an OpenDRIVE map")
            parts, _ = read_net_once(foreign_net(map_file), None)
            town.left_out.update(left_out_of(root, parts))
            town.notes += notes_on(root, parts)
        cases = sum(len(file.cases) for file in written)
        return Imported((), cases, dict(town.taken), +town.left_out, tuple(town.notes))

    return import_together(out, write)


def _put_network(map_file: Path, folder: Path) -> Path:
    copy = folder / file_name(map_file.name)
    if map_file.name.endswith(".net.xml"):
        prepare_net(map_file, copy)
    elif map_file.suffix == ".xodr":
        # Errors in the map must be reported before the file is copied.
        parse_xml(map_file, "OpenDRIVE", "an OpenDRIVE map")
        shutil.copyfile(map_file, copy)
    else:
        raise ExchangeError(f"{map_file} cannot be a map: its name must end in .xodr or .net.xml")
    return copy


def prepare_net(source: Path, out: Path) -> None:
    """Write a net in the coordinates of its original map, with sidewalks and crossings if it has none.

    Signal programs are replaced by ours, because those of a net made from CARLA's map are netconvert's guesses.
    """
    root = parse_net(source)
    try:
        x, y = offset_of(root)
    except ValueError as err:
        raise ExchangeError(f"{source} has a netOffset that is not a pair of numbers") from err
    options = ["--offset.disable-normalization", "true", "--offset.x", f"{-x}", "--offset.y", f"{-y}"]
    if not any(lane.get("allow") == "pedestrian" for lane in root.iter("lane")):
        options += ["--sidewalks.guess", "true", "--sidewalks.guess.max-speed", f"{SIDEWALK_MOST_MPS}"]
    options += ["--crossings.guess", "true", "--no-turnarounds.except-deadend", "true", "--no-warnings", "true"]
    with tempfile.TemporaryDirectory(prefix="foresee-net-") as name:
        folder = Path(name)
        run_netconvert(["-s", str(source.resolve()), *options, "-o", "net.net.xml"], folder)
        net = parse_net(folder / "net.net.xml")
        close_parking(net)
        repair_overlaps(net)
        give_programs(net)
        fix_times(net)  # signals for several junctions, which keep their programs
        write_net(net, out)


def _town(net: Path, catalogue: Catalogue | None, left_out: Counter[str]) -> Town:
    models = scenario_files.models_with(catalogue)
    net_file = foreign_net(net)
    parts, signals = read_net_once(net_file, None)
    network = RoadNetwork.of(parts)
    check_network(network, net.name)
    return Town(network, signals, Heights.of(net_file), spec_of(models[scenario_files.ego_of(models)]), left_out)


def _scenario_files(
    town: Town, routes: Sequence[PlacedRoute], net: str, catalogue: Catalogue | None
) -> list[ScenarioFile]:
    """Return the files, sorted by name: one per family, and separate files for cases without a signal or without
    behaviour."""
    cases: dict[str, list[Case]] = {}
    sources: dict[str, dict[str, None]] = {}
    names: dict[str, set[str]] = {}
    count: Counter[str] = Counter()
    for route in routes:
        family = route.route.family
        used_names = names.setdefault(family, set())
        name = distinct_name(f"route_{route.route.id}", "route", used_names)
        used_names.add(name)
        case = _case(town, route, name, count[family], net, catalogue)
        if case is None:
            town.left_out["routes that the compiler cannot place"] += 1
            continue
        count[family] += 1
        cases.setdefault(_file_name(case), []).append(case)
        sources.setdefault(_file_name(case), {})[route.route.file.name] = None
    _report_families(town, [case for cases_of_file in cases.values() for case in cases_of_file])
    return [
        ScenarioFile(name, net, tuple(cases_of_file), catalogue, tuple(sources[name]), town_of(Path(net)))
        for name, cases_of_file in sorted(cases.items())
    ]


def _report_families(town: Town, cases: Sequence[Case]) -> None:
    count = Counter(case.family for case in cases)
    for family, number in sorted(count.items(), key=lambda item: item[0].zfill(3)):
        town.taken[f"routes of family {family}" if family else "routes without a family"] += number
        if family not in STAGED:
            town.left_out[f"behaviour of Scenario{family or '?'}, which this tool does not know"] += number
    unstaged = sum(case.variant == "open" and case.family in STAGED for case in cases)
    town.left_out["routes that have no place for their family's behaviour"] += unstaged
    bridged = sum(case.bridge for case in cases)
    town.left_out["routes over or under another road (the world is flat: they have no traffic)"] += bridged
    if not town.has_sidewalks:
        town.notes.append("the map has no sidewalks: only the families' own pedestrians walk there")


def _case(town: Town, route: PlacedRoute, name: str, number: int, net: str, catalogue: Catalogue | None) -> Case | None:
    """Return a route's case, with its family's behaviour if the compiler can place every actor; None if it cannot."""
    bridge = placed_route.passes(route, town.bridges)
    for staged in (True, False):
        case = case_of(town.network, town.signals, route, name=name, number=number, staged=staged)
        case = replace(case, bridge=bridge, walkers=town.has_sidewalks)
        file = ScenarioFile(_file_name(case), net, (case,), catalogue, (), "")
        if not scenario_files.misplaced(file, town.network, town.signals):
            return case
    return None


def _file_name(case: Case) -> str:
    family = f"scenario{case.family}" if case.family else "routes"
    name = f"{family}_{case.variant}" if case.variant and case.family in STAGED else family
    at_junction = case.family in STAGED and case.variant in ("", "walker") and case.family != "3"
    name = f"{name}_no_signal" if at_junction and not case.signal else name
    return f"{name}_bridge" if case.bridge else name
