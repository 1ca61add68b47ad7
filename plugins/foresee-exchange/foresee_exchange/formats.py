"""The bundled formats, as entry points name them: the options and the function of each format.

This module is imported for every help text, so heavy imports are inside the functions.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from foresee_dsl.exchange.outcome import Imported
from foresee_dsl.exchange.protocol import AllowOutside, Option, OutFolder, RunDriver, RunSeed, Tell
from foresee_exchange.openscenario.losses import Coordinates

if TYPE_CHECKING:
    from foresee_exchange.maps.cutting import Part

Around = Annotated[
    str | None,
    Option("Keep the part around a junction, an edge or `X,Y` of the map; the radius is in m.", metavar="PLACE,RADIUS"),
]
InBoundary = Annotated[
    str | None,
    Option("Keep the edges in a box (m), as netconvert's --keep-edges does.", metavar="XMIN,YMIN,XMAX,YMAX"),
]
InGeoBoundary = Annotated[
    str | None, Option("Keep the edges in a box in degrees, west and south first.", metavar="LON,LAT,LON,LAT")
]


def _part(around: str | None, in_boundary: str | None, in_geo_boundary: str | None) -> Part | None:
    """Return the part of a map to keep; a `ValueError` says what is wrong with the options."""
    from foresee_exchange.maps.cutting import part_of

    return part_of(around, in_boundary, in_geo_boundary)


@dataclass(frozen=True)
class CarlaOptions:
    """Options of `foresee import carla`."""

    map_: Annotated[Path, Option("The town: TownXX.xodr, or a SUMO net made from it.", ("--map",))]
    routes: Annotated[list[Path], Option("Route file (XML); repeat the option for several.")]
    out: OutFolder
    more: Annotated[
        list[Path] | None,
        Option("Further route (.xml) and trigger (.json) files.", metavar="[FILE]...", positional=True),
    ] = None
    triggers: Annotated[list[Path] | None, Option("Trigger file (JSON); repeat the option for several.")] = None
    vtypes: Annotated[Path | None, Option("CARLA's blueprints as SUMO vTypes (XML).")] = None


def from_carla(options: CarlaOptions, tell: Tell) -> Imported:  # noqa: ARG001 - the protocol's
    """Turn CARLA's leaderboard routes into scenarios: one file per family, one case per route.

    [dim]foresee import carla --map Town10HD.xodr --routes S7/*.xml --triggers S7/*.json --out town10[/dim]
    """
    from foresee_exchange.carla import importer

    extra = list(options.more or ())
    routes = [*options.routes, *(file for file in extra if file.suffix != ".json")]
    triggers = [*(options.triggers or ()), *(file for file in extra if file.suffix == ".json")]
    return importer.run(options.map_, routes, triggers, out=options.out, vtypes=options.vtypes)


@dataclass(frozen=True)
class SumoOptions:
    """Options of `foresee import sumo`."""

    file: Annotated[Path, Option("A SUMO network (.net.xml, .net.xml.gz).", metavar="FILE", positional=True)]
    out: OutFolder
    around: Around = None
    in_boundary: InBoundary = None
    in_geo_boundary: InGeoBoundary = None

    def __post_init__(self) -> None:
        self.part()

    def part(self) -> Part | None:
        """Return the part of the map to keep; a `ValueError` says what is wrong with the options."""
        return _part(self.around, self.in_boundary, self.in_geo_boundary)


@dataclass(frozen=True)
class OpenDriveOptions(SumoOptions):
    """Options of `foresee import opendrive`."""

    file: Annotated[Path, Option("An OpenDRIVE map (.xodr).", metavar="FILE", positional=True)]


def from_opendrive(options: OpenDriveOptions, tell: Tell) -> Imported:
    """Turn an OpenDRIVE map, or a part of it, into a network and a first scenario."""
    from foresee_exchange.maps import opendrive

    return opendrive.run(options.file, out=options.out, part=options.part(), tell=tell)


@dataclass(frozen=True)
class OsmOptions:
    """Options of `foresee import osm`."""

    file: Annotated[
        Path, Option("An OpenStreetMap extract (.osm, .osm.gz, .osm.pbf).", metavar="FILE", positional=True)
    ]
    out: OutFolder
    around: Annotated[
        str | None, Option("Keep the part around a place (degrees; radius in m).", metavar="LON,LAT,RADIUS")
    ] = None
    in_geo_boundary: InGeoBoundary = None

    def __post_init__(self) -> None:
        _part(self.around, None, self.in_geo_boundary)


def from_osm(options: OsmOptions, tell: Tell) -> Imported:
    """Turn an OpenStreetMap extract, or a part of it, into a network and a first scenario."""
    from foresee_exchange.maps import osm

    part = _part(options.around, None, options.in_geo_boundary)
    return osm.run(options.file, out=options.out, part=part, tell=tell)


def from_sumo(options: SumoOptions, tell: Tell) -> Imported:
    """Turn a SUMO network, or a part of it, into a network and a first scenario.

    [dim]foresee import sumo town.net.xml --around 1200,850,300 --out town[/dim]
    """
    from foresee_exchange.maps import sumo

    return sumo.run(options.file, out=options.out, part=options.part(), tell=tell)


@dataclass(frozen=True)
class FromOpenScenarioOptions:
    """Options of `foresee import openscenario`."""

    file: Annotated[Path, Option("An OpenSCENARIO XML file (.xosc).", metavar="FILE", positional=True)]
    out: OutFolder
    ego: Annotated[
        str, Option("The entity under test; by default one with a name such as `Ego`, otherwise the first vehicle.")
    ] = ""
    map_: Annotated[
        Path | None,
        Option("The road network, or a folder that contains it; by default the one that the file names.", ("--map",)),
    ] = None
    coordinates: Annotated[Coordinates, Option("Handedness: CARLA's are left-handed; by default it is detected.")] = (
        Coordinates.auto
    )
    partial: Annotated[
        bool,
        Option(
            "Write the scenario even if actions, triggers or participants are lost; comments list them.", ("--partial",)
        ),
    ] = False
    allow_outside: AllowOutside = False


def from_openscenario(options: FromOpenScenarioOptions, tell: Tell) -> Imported:  # noqa: ARG001 - the protocol's
    """Turn an OpenSCENARIO XML file into a scenario. Exit code 1 if a part of it would be lost.

    [dim]foresee import openscenario cut_in.xosc --out cut_in
    foresee import openscenario cut_in.xosc --out cut_in --partial[/dim]
    """
    from foresee_exchange.openscenario.reading import importer

    return importer.run(
        options.file,
        out=options.out,
        ego=options.ego,
        road=options.map_,
        coordinates=options.coordinates,
        partial=options.partial,
        allow_outside=options.allow_outside,
    )


@dataclass(frozen=True)
class ToOpenScenarioOptions:
    """Options of `foresee export openscenario`."""

    address: Annotated[str, Option("A mutant, a clip or a test case.", metavar="FILE[::CASE]", positional=True)]
    out: OutFolder
    behaviour: Annotated[
        bool,
        Option(
            "Write the actors' actions and triggers, as far as possible; or the recorded trajectories.",
            ("--behaviour/--trajectories",),
        ),
    ] = False
    driver: RunDriver = ""
    seed: RunSeed = None
    allow_outside: AllowOutside = False


def to_openscenario(options: ToOpenScenarioOptions, tell: Tell) -> Imported:  # noqa: ARG001 - the protocol's
    """Write OpenSCENARIO XML 1.2 and an OpenDRIVE map, to replay a failure in another simulator.

    [dim]foresee export openscenario out/children/scenario7/red_light_runner_r02_p1_m3.foresee --out replay[/dim]
    """
    from foresee_exchange.openscenario.writing import exporter

    return exporter.run(
        options.address,
        out=options.out,
        behaviour=options.behaviour,
        driver=options.driver,
        seed=options.seed,
        allow_outside=options.allow_outside,
    )


@dataclass(frozen=True)
class CarlaRouteOptions:
    """Options of `foresee export carla-route`."""

    addresses: Annotated[
        list[str], Option("Clips, mutants or test cases on one map.", metavar="FILE[::CASE]...", positional=True)
    ]
    out: Annotated[Path, Option("The file to write.")]
    town: Annotated[str, Option("CARLA's name of the map; by default its file name.")] = ""
    route_format: Annotated[str, Option("Version of CARLA that reads the file: 0.9.10 or 0.9.15.", ("--format",))] = (
        "0.9.10"
    )
    allow_outside: AllowOutside = False


def to_carla_route(options: CarlaRouteOptions, tell: Tell) -> Imported:  # noqa: ARG001 - the protocol's
    """Write the ego's start and goal of each test case as a route file of CARLA's leaderboard.

    [dim]foresee export carla-route out/clips/*.foresee --out routes.xml[/dim]
    """
    from foresee_exchange.carla import exporter

    return exporter.run(
        options.addresses,
        out=options.out,
        town=options.town,
        route_format=options.route_format,
        allow_outside=options.allow_outside,
    )
