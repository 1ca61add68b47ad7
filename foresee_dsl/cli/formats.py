"""The groups `foresee import` and `foresee export`: a command for each registered format.

A format is an entry point of the group `foresee_dsl.importers` or `foresee_dsl.exporters`: a function whose parameters
are the command's options, as typer takes them, and which returns what it wrote as an `Imported`. Its module is imported
when its command or a help is asked for, so it imports what is heavy inside the function.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast, get_type_hints

import typer
from typer.core import TyperGroup

from foresee_dsl.cli.options.common import (
    AllowOutsideOption,
    Consenting,
    JsonOption,
    OutOption,
    console,
    counted,
    print_json,
)
from foresee_dsl.cli.options.output import for_tools
from foresee_dsl.exchange.outcome import Coordinates, ExchangeError, Imported
from foresee_dsl.plugins import PluginGroup

if TYPE_CHECKING:
    from foresee_dsl.exchange.maps.cutting import Part

SETTINGS = {"help_option_names": ["-h", "--help"]}


class _Formats(TyperGroup):
    """The commands of a group of plug-ins, each made when it is asked for."""

    plugins: PluginGroup
    document: str
    """What their JSON is called."""

    def __init__(self, **settings: Any) -> None:  # noqa: ANN401 - typer's own, passed on
        super().__init__(**settings)
        self.commands = dict.fromkeys(self.plugins.names(), cast("Any", None))  # the names, for "did you mean"

    def get_command(self, ctx: object, cmd_name: str) -> Any:  # noqa: ANN401 - a type that typer keeps to itself
        """Return the command of a format, or None where none is called so."""
        del ctx
        if cmd_name not in self.commands:
            return None
        alone = typer.Typer(add_completion=False, rich_markup_mode="rich", context_settings=SETTINGS)
        alone.command(name=cmd_name, cls=Consenting)(for_tools(_printing(self._format(cmd_name)), self.document))
        return typer.main.get_command(alone)

    def _format(self, name: str) -> Callable[..., Imported]:
        """Return the function of a format; of a broken one a function that says so, for the help to list."""
        try:
            return cast("Callable[..., Imported]", self.plugins.load(name))
        except ExchangeError as err:
            fault = err

        def broken() -> Imported:
            raise fault

        broken.__doc__ = str(fault)
        return broken


class _Importers(_Formats):
    plugins = PluginGroup("foresee_dsl.importers", "importer", ExchangeError)
    document = "import"


class _Exporters(_Formats):
    plugins = PluginGroup("foresee_dsl.exporters", "exporter", ExchangeError)
    document = "export"


def _printing(write: Callable[..., Imported]) -> Callable[..., None]:
    """Return a command that calls a format's function and prints what it wrote; `--json` comes on top of its options.

    Its signature is the function's, with the annotations evaluated in the function's own module: typer reads both.
    """

    def command(*, json: bool, **options: Any) -> None:  # noqa: ANN401 - what the format's own signature says
        _print_outcome(write(**options), json=json)

    hints = get_type_hints(write, include_extras=True) | {"json": JsonOption, "return": None}
    parameters = [
        parameter.replace(annotation=hints.get(name, str), kind=inspect.Parameter.KEYWORD_ONLY)
        for name, parameter in inspect.signature(write).parameters.items()
    ]
    parameters.append(inspect.Parameter("json", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=JsonOption))
    command.__doc__ = write.__doc__
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = hints
    return command


def _print_outcome(done: Imported, *, json: bool) -> None:
    if json:
        print_json(done)
        return
    for file in done.files:
        typer.echo(f"wrote {file}")
    if done.cases:
        typer.echo(counted(done.cases, "test case"))
    for title, counts in (("taken over", done.taken), ("not expressed", done.left_out), ("lost", done.lost)):
        if counts:
            typer.echo(f"{title}:")
            for what, count in counts.items():
                typer.echo(f"  {count} {what}")
    for note in done.notes:
        typer.echo(f"note: {note}")


_LOOK: dict[str, Any] = {
    "no_args_is_help": True,
    "rich_markup_mode": "rich",
    "add_completion": False,
    "context_settings": SETTINGS,
}
import_ = typer.Typer(
    name="import", cls=_Importers, help="Turn files of other tools into networks and scenarios.", **_LOOK
)
export = typer.Typer(
    name="export", cls=_Exporters, help="Write test cases, clips and mutants for other tools.", **_LOOK
)


def from_carla(
    map_: Annotated[Path, typer.Option("--map", help="The town: TownXX.xodr, or a SUMO net made of it.")],
    routes: Annotated[list[Path], typer.Option("--routes", help="Route files (XML); may be given several times.")],
    out: OutOption,
    more: Annotated[
        list[Path] | None, typer.Argument(metavar="[FILE]...", help="More route (.xml) and trigger (.json) files.")
    ] = None,
    triggers: Annotated[
        list[Path] | None, typer.Option("--triggers", help="Trigger files (JSON); may be given several times.")
    ] = None,
    vtypes: Annotated[Path | None, typer.Option("--vtypes", help="CARLA's blueprints as SUMO vTypes (XML).")] = None,
) -> Imported:
    """Turn CARLA's leaderboard routes into scenarios: a file a family, a case a route.

    [dim]foresee import carla --map Town10HD.xodr --routes S7/*.xml --triggers S7/*.json --out town10[/dim]
    """
    from foresee_dsl.exchange.carla import importer as exchange

    extra = list(more or ())
    route_files = [*routes, *(file for file in extra if file.suffix != ".json")]
    trigger_files = [*(triggers or ()), *(file for file in extra if file.suffix == ".json")]
    return exchange.run(map_, route_files, trigger_files, out=out, vtypes=vtypes)


AroundOption = Annotated[
    str | None,
    typer.Option(
        "--around", metavar="PLACE,RADIUS", help="Keep what is around a junction, an edge or `X,Y` of the map (m)."
    ),
]
InBoundaryOption = Annotated[
    str | None,
    typer.Option(
        "--in-boundary", metavar="XMIN,YMIN,XMAX,YMAX", help="Keep what is in a box (m), as netconvert's --keep-edges."
    ),
]
InGeoBoundaryOption = Annotated[
    str | None,
    typer.Option("--in-geo-boundary", metavar="LON,LAT,LON,LAT", help="The same in degrees, west and south first."),
]


def _part(around: str | None, in_boundary: str | None, in_geo_boundary: str | None) -> Part | None:
    from foresee_dsl.exchange.maps.cutting import part_of

    try:
        return part_of(around, in_boundary, in_geo_boundary)
    except ValueError as err:
        raise typer.BadParameter(str(err)) from err


def _steps() -> AbstractContextManager[Callable[[str], None]]:
    """Show on standard error what an import does, where it takes more than a few seconds."""
    from foresee_dsl.report.terminal.steps import steps

    return steps(console(error=True))


def from_opendrive(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="An OpenDRIVE map (.xodr).")],
    out: OutOption,
    around: AroundOption = None,
    in_boundary: InBoundaryOption = None,
    in_geo_boundary: InGeoBoundaryOption = None,
) -> Imported:
    """Turn an OpenDRIVE map, or a part of it, into a network and a starter scenario."""
    from foresee_dsl.exchange.maps import opendrive as exchange

    part = _part(around, in_boundary, in_geo_boundary)
    with _steps() as tell:
        return exchange.run(file, out=out, part=part, tell=tell)


def from_osm(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="An OpenStreetMap extract (.osm, .osm.gz, .osm.pbf).")],
    out: OutOption,
    around: Annotated[
        str | None,
        typer.Option("--around", metavar="LON,LAT,RADIUS", help="Keep what is around a place (degrees, m)."),
    ] = None,
    in_geo_boundary: InGeoBoundaryOption = None,
) -> Imported:
    """Turn an OpenStreetMap extract, or a part of it, into a network and a starter scenario."""
    from foresee_dsl.exchange.maps import osm as exchange

    part = _part(around, None, in_geo_boundary)
    with _steps() as tell:
        return exchange.run(file, out=out, part=part, tell=tell)


def from_sumo(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A SUMO network (.net.xml, .net.xml.gz).")],
    out: OutOption,
    around: AroundOption = None,
    in_boundary: InBoundaryOption = None,
    in_geo_boundary: InGeoBoundaryOption = None,
) -> Imported:
    """Turn a SUMO network, or a part of it, into one of ours and a starter scenario.

    [dim]foresee import sumo town.net.xml --around 1200,850,300 --out town[/dim]
    """
    from foresee_dsl.exchange.maps import sumo as exchange

    part = _part(around, in_boundary, in_geo_boundary)
    with _steps() as tell:
        return exchange.run(file, out=out, part=part, tell=tell)


def from_openscenario(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="An OpenSCENARIO XML file (.xosc).")],
    out: OutOption,
    ego: Annotated[
        str, typer.Option("--ego", help="The entity under test; by default `Ego` or the like, else the first vehicle.")
    ] = "",
    map_: Annotated[
        Path | None,
        typer.Option("--map", help="The network, or a folder to look for it; by default the one that the file names."),
    ] = None,
    coordinates: Annotated[
        Coordinates, typer.Option("--coordinates", help="CARLA's are left-handed; by default that is found out.")
    ] = Coordinates.auto,
    partial: Annotated[
        bool,
        typer.Option(
            "--partial", help="Write it also where actions, triggers or participants are lost; comments say which."
        ),
    ] = False,
    allow_outside: AllowOutsideOption = False,
) -> Imported:
    """Turn an OpenSCENARIO XML file into a scenario. Exit code 1 where something of it would be lost.

    [dim]foresee import openscenario cut_in.xosc --out cut_in
    foresee import openscenario cut_in.xosc --out cut_in --partial[/dim]
    """
    from foresee_dsl.exchange.openscenario.reading import importer as exchange

    return exchange.run(
        file, out=out, ego=ego, road=map_, coordinates=coordinates, partial=partial, allow_outside=allow_outside
    )


def to_openscenario(
    address: Annotated[str, typer.Argument(metavar="FILE[::CASE]", help="A mutant, a clip or a test case.")],
    out: OutOption,
    behaviour: Annotated[
        bool,
        typer.Option(
            "--behaviour/--trajectories", help="What actors do and when, as far as it goes; or where they went."
        ),
    ] = False,
    driver: Annotated[
        str, typer.Option("--driver", help="The driver; by default the one that a mutant records, else pdm.")
    ] = "",
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, max=2**31 - 1, help="By default what a mutant records, else 0.")
    ] = None,
    allow_outside: AllowOutsideOption = False,
) -> Imported:
    """Write OpenSCENARIO XML 1.2 and an OpenDRIVE map, to replay a failure in another simulator.

    [dim]foresee export openscenario out/children/scenario7/red_light_runner_r02_p1_m3.foresee --out replay[/dim]
    """
    from foresee_dsl.exchange.openscenario.writing import exporter as exchange

    return exchange.run(address, out=out, behaviour=behaviour, driver=driver, seed=seed, allow_outside=allow_outside)


def to_carla_route(
    addresses: Annotated[
        list[str], typer.Argument(metavar="FILE[::CASE]...", help="Clips, mutants or test cases on one map.")
    ],
    out: Annotated[Path, typer.Option("--out", help="The file to write.")],
    town: Annotated[str, typer.Option("--town", help="CARLA's name of the map; by default that of its file.")] = "",
    route_format: Annotated[
        str, typer.Option("--format", help="CARLA's version, by which the file is laid out: 0.9.10 or 0.9.15.")
    ] = "0.9.10",
    allow_outside: AllowOutsideOption = False,
) -> Imported:
    """Write where the ego starts and where it goes as a route file of CARLA's leaderboard, a route each.

    [dim]foresee export carla-route out/clips/*.foresee --out routes.xml[/dim]
    """
    from foresee_dsl.exchange.carla import exporter as exchange

    return exchange.run(addresses, out=out, town=town, route_format=route_format, allow_outside=allow_outside)
