"""Commands for authors: compile, expand; and what there is to use: drivers, models."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foresee_dsl.cli.common import AllowOutsideOption, JsonOption, OutOption, console, print_json


def compile_(
    address: Annotated[str, typer.Argument(metavar="FILE[::CASE]", help="A test case.")],
    out: OutOption = Path("compiled"),
    json: JsonOption = False,
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Write a test case as SUMO files: network, types, routes, configuration (open it with sumo-gui).

    [dim]foresee compile scenarios/scenario7.foresee::r01 --out town[/dim]
    """
    from foresee_dsl.compile import compile_test_case
    from foresee_dsl.compile.sumo_files import write_sumo_folder
    from foresee_dsl.language.project.loading import load_test_case

    bundle = compile_test_case(load_test_case(address, allow_outside=allow_outside))
    files = write_sumo_folder(bundle, out)
    if json:
        print_json({"schema": 1, "test_case": address, "key": bundle.key, "files": [str(f) for f in files]})
    else:
        for file in files:
            typer.echo(str(file))
        for note in bundle.scene.notes:
            typer.echo(f"note: {note}", err=True)


def expand(
    address: Annotated[str, typer.Argument(metavar="FILE[::CASE]", help="A child, or a test case.")],
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Print a child, or a case, as one full scenario: its parents and its network written out.

    [dim]foresee expand out/children/scenario7/red_light_runner_r02_p1_m3.foresee[/dim]
    """
    from foresee_dsl.editor.highlight import show
    from foresee_dsl.language.printer import print_model
    from foresee_dsl.language.project.expand import expanded_model
    from foresee_dsl.language.project.loading import load_test_case

    show(print_model(expanded_model(load_test_case(address, allow_outside=allow_outside))))


def drivers(json: JsonOption = False) -> None:
    """List the drivers that can be put under test."""
    from foresee_dsl.drivers.registry import describe_drivers

    found = describe_drivers()
    if json:
        keys = ("name", "version", "about", "package")
        print_json({"schema": 1, "drivers": [dict(zip(keys, d, strict=True)) for d in found]})
        return
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for heading in ("driver", "version", "package", "about"):
        table.add_column(heading)
    for d in found:
        table.add_row(d.name, d.version, d.package, d.doc)
    console().print(table)


def models(
    catalogue: Annotated[
        Path | None, typer.Argument(metavar="FILE", help="A catalogue; by default the bundled one.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """List the models of vehicles, people and things that scenarios can name."""
    from foresee_dsl.compile.catalogue import spec_of
    from foresee_dsl.language.project.loading import load_catalogue

    specs = [spec_of(model) for model in load_catalogue(catalogue).values()]
    if json:
        from dataclasses import asdict

        print_json({"schema": 1, "models": [asdict(s) | {"rear_overhang_m": s.rear_overhang_m} for s in specs]})
        return
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    table.add_column("model", no_wrap=True)
    for heading in ("length", "width", "height", "top", "speeds up", "brakes", "hardest"):
        table.add_column(heading, justify="right", no_wrap=True)
    for s in specs:
        table.add_row(
            s.name,
            f"{s.length_m:.2f}",
            f"{s.width_m:.2f}",
            f"{s.height_m:.2f}",
            f"{s.max_speed_mps * 3.6:.0f}",
            f"{s.acceleration_mps2:.1f}",
            f"{s.braking_mps2:.1f}",
            f"{s.emergency_braking_mps2:.1f}",
        )
    console().print(table)
    console().print("Sizes in m, top speed in km/h, speeding up and braking in m/s².", highlight=False)
