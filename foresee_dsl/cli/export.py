"""The group `foresee export`: test cases for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foresee_dsl.cli.common import AllowOutsideOption, JsonOption
from foresee_dsl.cli.import_ import IntoOption, _say

export = typer.Typer(
    name="export",
    help="Write test cases, clips and mutants for other tools.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@export.command("openscenario")
def openscenario(
    address: Annotated[str, typer.Argument(metavar="FILE[::CASE]", help="A mutant, a clip or a test case.")],
    out: IntoOption,
    behaviour: Annotated[
        bool,
        typer.Option(
            "--behaviour/--trajectories", help="What actors do and when, as far as it goes; or where they went."
        ),
    ] = False,
    driver: Annotated[
        str, typer.Option("--driver", help="Who drives; by default whom a mutant records, else pdm.")
    ] = "",
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, max=2**31 - 1, help="By default what a mutant records, else 0.")
    ] = None,
    json: JsonOption = False,
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Write OpenSCENARIO XML 1.2 and an OpenDRIVE map, to replay a failure in another simulator.

    [dim]foresee export openscenario out/children/scenario7/red_light_runner_r02_p1_m3.foresee --out replay[/dim]
    """
    from foresee_dsl.exchange.openscenario.writing import exporter as exchange

    done = exchange.run(address, out=out, behaviour=behaviour, driver=driver, seed=seed, allow_outside=allow_outside)
    _say(done, json=json)


@export.command("carla-route")
def carla_route(
    addresses: Annotated[
        list[str], typer.Argument(metavar="FILE[::CASE]...", help="Clips, mutants or test cases on one map.")
    ],
    out: Annotated[Path, typer.Option("--out", help="The file to write.")],
    town: Annotated[str, typer.Option("--town", help="CARLA's name of the map; by default that of its file.")] = "",
    json: JsonOption = False,
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Write where the ego starts and where it goes as a route file of CARLA's leaderboard, a route each.

    [dim]foresee export carla-route out/clips/*.foresee --out routes.xml[/dim]
    """
    from foresee_dsl.exchange.carla import exporter as exchange

    _say(exchange.run(addresses, out=out, town=town, allow_outside=allow_outside), json=json)
