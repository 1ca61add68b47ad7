"""Commands for authors: check, fmt, compile, expand, diff; and what there is to use: drivers, models."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Annotated

import typer

from foresee_dsl.cli.common import FAILED, JsonOption, OutOption, console, print_diagnostics, print_json

Paths = Annotated[list[str], typer.Argument(help="Files, folders, or test cases (FILE::CASE).")]


def check(
    paths: Paths,
    json: JsonOption = False,
    places: Annotated[
        bool, typer.Option("--places/--no-places", help="Also build the network and place every actor.")
    ] = True,
) -> None:
    """Look for mistakes: in the text, in the names, and (with the network) in where things stand.

    [dim]foresee check scenarios    foresee check my.foresee::r01[/dim]
    """
    from foresee_dsl.language.checked_files import check_paths

    result = check_paths(paths)
    diagnostics = list(result.diagnostics)
    if places:
        from foresee_dsl.compile import placement_mistakes

        diagnostics += placement_mistakes(result.cases)
    failed = any(d.severity == "error" for d in diagnostics)
    if json:
        from foresee_dsl.language.diagnostics import to_json

        print_json({"schema": 1, "ok": not failed, "files": result.files, "test_cases": len(result.cases),
                    "diagnostics": [to_json(d) for d in diagnostics]})  # fmt: skip
    else:
        if diagnostics:
            print_diagnostics(tuple(diagnostics))
        if not failed:
            typer.echo(f"{result.files} files, {len(result.cases)} test cases: no mistakes found")
    if failed:
        raise typer.Exit(FAILED)


def fmt(
    paths: Paths,
    check_only: Annotated[
        bool, typer.Option("--check", help="Change nothing; exit code 1 if something would change.")
    ] = False,
    show_diff: Annotated[bool, typer.Option("--diff", help="Change nothing; print what would change.")] = False,
) -> None:
    """Bring files into the one layout: comments and grouping stay, the meaning never changes.

    [dim]foresee fmt scenarios    foresee fmt --check .    cat x.foresee | foresee fmt -[/dim]
    """
    import sys

    from foresee_dsl.language.parser import format_text, load
    from foresee_dsl.language.project import scenario_files
    from foresee_dsl.resources import write_whole

    if paths == ["-"]:
        typer.echo(format_text(sys.stdin.read(), "<stdin>"), nl=False)
        return
    changed = 0
    files = scenario_files(paths)
    for file in files:
        before = load(file).text
        after = format_text(before, str(file))
        if after == before:
            continue
        changed += 1
        if show_diff:
            lines = difflib.unified_diff(
                before.splitlines(keepends=True), after.splitlines(keepends=True), str(file), str(file)
            )
            typer.echo("".join(lines), nl=False)
        elif check_only:
            typer.echo(f"would change {file}")
        else:
            write_whole(file, after)
            typer.echo(f"formatted {file}")
    if not changed:
        typer.echo(f"{len(files)} files are as they should be")
    if changed and (check_only or show_diff):
        raise typer.Exit(FAILED)


def compile_(
    address: Annotated[str, typer.Argument(metavar="FILE[::CASE]", help="A test case.")],
    out: OutOption = Path("compiled"),
    json: JsonOption = False,
) -> None:
    """Write a test case as SUMO files: network, types, routes, configuration (open it with sumo-gui).

    [dim]foresee compile scenarios/scenario7.foresee::r01 --out town[/dim]
    """
    from foresee_dsl.compile import compile_test_case
    from foresee_dsl.compile.files import write_sumo_folder
    from foresee_dsl.language.project import load_test_case

    bundle = compile_test_case(load_test_case(address))
    files = write_sumo_folder(bundle, out)
    if json:
        print_json({"schema": 1, "test_case": address, "key": bundle.key, "files": [str(f) for f in files]})
    else:
        for file in files:
            typer.echo(str(file))
        for note in bundle.scene.notes:
            typer.echo(f"note: {note}", err=True)


def expand(address: Annotated[str, typer.Argument(metavar="FILE[::CASE]", help="A child, or a test case.")]) -> None:
    """Print a child (or a case) as one full scenario, nothing referred to.

    [dim]foresee expand out/children/scenario7/red_light_runner_r02_p1_m3.foresee[/dim]
    """
    from foresee_dsl.language.expand import expanded_model
    from foresee_dsl.language.printer import print_model
    from foresee_dsl.language.project import load_test_case

    typer.echo(print_model(expanded_model(load_test_case(address))), nl=False)


def diff(
    old: Annotated[str, typer.Argument(metavar="OLD", help="A file, or FILE::CASE.")],
    new: Annotated[str, typer.Argument(metavar="NEW", help="Another.")],
    json: JsonOption = False,
) -> None:
    """Say what differs in meaning between two files; exit code 0 whether or not they differ.

    [dim]foresee diff a.foresee b.foresee    foresee diff clip.foresee clip_m3.foresee[/dim]
    """
    from foresee_dsl.language.diff import diff_addresses, render_text, to_dict

    changes = diff_addresses(old, new)
    if json:
        print_json({"schema": 1, "old": old, "new": new, "changes": [to_dict(c) for c in changes]})
    else:
        typer.echo(render_text(changes) if changes else "no difference in meaning")


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
    catalogue: Annotated[Path | None, typer.Argument(help="A catalogue file; by default the bundled one.")] = None,
    json: JsonOption = False,
) -> None:
    """List the models of vehicles and pedestrians that scenarios can name."""
    from foresee_dsl.compile.catalogue import spec_of
    from foresee_dsl.language.project import load_catalogue

    specs = [spec_of(model) for model in load_catalogue(catalogue).values()]
    if json:
        from dataclasses import asdict

        print_json({"schema": 1, "models": [asdict(s) for s in specs]})
        return
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    table.add_column("model")
    for heading in ("length", "width", "top speed", "speeds up", "brakes", "hardest"):
        table.add_column(heading, justify="right")
    for s in specs:
        table.add_row(
            s.name,
            f"{s.length_m:.2f} m",
            f"{s.width_m:.2f} m",
            f"{s.max_speed_mps * 3.6:.0f} km/h",
            f"{s.acceleration_mps2:.1f} m/s²",
            f"{s.braking_mps2:.1f} m/s²",
            f"{s.emergency_braking_mps2:.1f} m/s²",
        )
    console().print(table)
