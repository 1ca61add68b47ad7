"""The group `foresee import`: files of other tools become networks and scenarios."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.common import AllowOutsideOption, JsonOption, counted, print_json

if TYPE_CHECKING:
    from foresee_dsl.exchange.outcome import Imported

import_ = typer.Typer(
    name="import",
    help="Turn files of other tools into networks and scenarios.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

IntoOption = Annotated[Path, typer.Option("--out", help="The folder to write into.")]


@import_.command("carla")
def carla(
    map_: Annotated[Path, typer.Option("--map", help="The town: TownXX.xodr, or a SUMO net made of it.")],
    routes: Annotated[list[Path], typer.Option("--routes", help="Route files (XML); may be given several times.")],
    out: IntoOption,
    more: Annotated[
        list[Path] | None, typer.Argument(metavar="[FILE]...", help="More route (.xml) and trigger (.json) files.")
    ] = None,
    triggers: Annotated[
        list[Path] | None, typer.Option("--triggers", help="Trigger files (JSON); may be given several times.")
    ] = None,
    vtypes: Annotated[Path | None, typer.Option("--vtypes", help="CARLA's blueprints as SUMO vTypes (XML).")] = None,
    json: JsonOption = False,
) -> None:
    """Turn CARLA's leaderboard routes into scenarios: a file a family, a case a route.

    [dim]foresee import carla --map Town10HD.xodr --routes S7/*.xml --triggers S7/*.json --out town10[/dim]
    """
    from foresee_dsl.exchange.carla import importer as exchange

    extra = list(more or ())
    route_files = [*routes, *(file for file in extra if file.suffix != ".json")]
    trigger_files = [*(triggers or ()), *(file for file in extra if file.suffix == ".json")]
    _say(exchange.run(map_, route_files, trigger_files, out=out, vtypes=vtypes), json=json)


@import_.command("opendrive")
def opendrive(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="An OpenDRIVE map (.xodr).")],
    out: IntoOption,
    json: JsonOption = False,
) -> None:
    """Turn an OpenDRIVE map into a network and a starter scenario."""
    from foresee_dsl.exchange.maps import opendrive as exchange

    _say(exchange.run(file, out=out), json=json)


@import_.command("osm")
def osm(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="An extract of OpenStreetMap (.osm).")],
    out: IntoOption,
    json: JsonOption = False,
) -> None:
    """Turn an OpenStreetMap extract into a network and a starter scenario."""
    from foresee_dsl.exchange.maps import osm as exchange

    _say(exchange.run(file, out=out), json=json)


@import_.command("sumo")
def sumo(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A SUMO network (.net.xml).")],
    out: IntoOption,
    json: JsonOption = False,
) -> None:
    """Turn a SUMO network into one of ours and a starter scenario."""
    from foresee_dsl.exchange.maps import sumo as exchange

    _say(exchange.run(file, out=out), json=json)


@import_.command("openscenario")
def openscenario(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="An OpenSCENARIO XML file (.xosc).")],
    out: IntoOption,
    ego: Annotated[
        str, typer.Option("--ego", help="The entity under test; by default `Ego` or the like, else the first vehicle.")
    ] = "",
    map_: Annotated[
        Path | None, typer.Option("--map", help="The network; by default the one that the file names.")
    ] = None,
    json: JsonOption = False,
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Turn an OpenSCENARIO XML file into a scenario, as far as its common subset goes.

    [dim]foresee import openscenario cut_in.xosc --out cut_in[/dim]
    """
    from foresee_dsl.exchange.openscenario.reading import importer as exchange

    _say(exchange.run(file, out=out, ego=ego, road=map_, allow_outside=allow_outside), json=json)


def _say(done: Imported, *, json: bool) -> None:
    if json:
        print_json(
            {
                "schema": 1,
                "files": [str(file) for file in done.files],
                "cases": done.cases,
                "taken": done.taken,
                "left_out": dict(done.left_out),
                "notes": list(done.notes),
            }
        )
        return
    for file in done.files:
        typer.echo(f"wrote {file}")
    if done.cases:
        typer.echo(counted(done.cases, "test case"))
    for title, counts in (("taken over", done.taken), ("not expressed", done.left_out)):
        if counts:
            typer.echo(f"{title}:")
            for what, count in counts.items():
                typer.echo(f"  {count} {what}")
    for note in done.notes:
        typer.echo(f"note: {note}")
