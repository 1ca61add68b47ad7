"""The command check: every mistake of some files, in the form that a person or a tool wants."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.common import FAILED, AllowOutsideOption, JsonOption, counted, print_diagnostics, print_json

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from foresee_dsl.errors import Diagnostic
    from foresee_dsl.language.project.checked_files import Checked

Paths = Annotated[list[str], typer.Argument(metavar="PATH", help="Files, folders, or test cases (FILE::CASE).")]


class Format(StrEnum):
    """In what form mistakes are printed."""

    full = "full"
    concise = "concise"
    json = "json"
    github = "github"
    sarif = "sarif"


def check(
    paths: Paths,
    format_: Annotated[
        Format, typer.Option("--format", help="full: for people; concise: one line each; the others: for tools.")
    ] = Format.full,
    json: JsonOption = False,
    places: Annotated[
        bool, typer.Option("--places/--no-places", help="Also build the network and place every actor.")
    ] = True,
    strict: Annotated[bool, typer.Option("--strict", help="Warnings fail the check too.")] = False,
    select: Annotated[
        list[str] | None, typer.Option("--select", metavar="CODE", help="Of the warnings only these (FS301, or FS3).")
    ] = None,
    ignore: Annotated[
        list[str] | None, typer.Option("--ignore", metavar="CODE", help="Not these warnings. Errors always count.")
    ] = None,
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Look for mistakes: in the text, in the names, and (with the network) in where things stand.

    Exit code 1 where there is an error, or with --strict a warning. `foresee explain CODE` says more about each.

    [dim]foresee check scenarios
    foresee check --format github --strict scenarios[/dim]
    """
    from foresee_dsl.errors import InputError
    from foresee_dsl.language.project.checked_files import Checked, check_paths

    wanted, unwanted = _codes(select, "--select"), _codes(ignore, "--ignore")
    try:
        result = check_paths(paths, allow_outside=allow_outside)
    except InputError as error:  # what is named is not there: that too in the form that was asked for
        result = Checked(0, (), error.diagnostics)
    found: list[Diagnostic] = list(result.diagnostics)
    if result.campaigns:
        from foresee_dsl.campaign.campaign_file import (
            mistakes_of,  # plug-ins are looked up: only where a campaign names them
        )

        found += [mistake for document in result.campaigns for mistake in mistakes_of(document)]
    if places:
        from foresee_dsl.compile import placement_mistakes
        from foresee_dsl.report.codes import joined

        found = joined(found, placement_mistakes(result.cases))
    shown = [
        d for d in found if d.severity == "error" or (_chosen(d, wanted, True) and not _chosen(d, unwanted, False))
    ]
    failed = any(strict or d.severity == "error" for d in shown)
    _print(Format.json if json else format_, result, shown, failed=failed)
    if failed:
        raise typer.Exit(FAILED)


def _codes(given: Iterable[str] | None, option: str) -> tuple[str, ...]:
    """Split `FS301,FS302` and refuse what begins no code."""
    codes = tuple(code.strip().upper() for said in given or () for code in said.split(",") if code.strip())
    if codes:
        from foresee_dsl.report.codes import every_code

        for code in codes:
            if not any(known.startswith(code) for known in every_code()):
                raise typer.BadParameter(f"{code} is no code; `foresee explain` lists them", param_hint=option)
    return codes


def _chosen(found: Diagnostic, codes: Sequence[str], default: bool) -> bool:
    return found.code.startswith(tuple(codes)) if codes else default


def _print(format_: Format, result: Checked, shown: Sequence[Diagnostic], *, failed: bool) -> None:
    if format_ is Format.json:
        from foresee_dsl.language.messages.diagnostics import to_json

        print_json({"schema": 1, "ok": not failed, "files": result.files, "test_cases": len(result.cases),
                    "diagnostics": [to_json(d) for d in shown]})  # fmt: skip
    elif format_ is Format.sarif:
        from foresee_dsl.report.codes import every_code
        from foresee_dsl.report.sarif import to_sarif

        print_json(to_sarif(shown, every_code()))
    elif format_ is Format.github:
        from foresee_dsl.report.codes import every_code
        from foresee_dsl.report.github import render_github

        typer.echo(render_github(shown, every_code()), nl=bool(shown))
    elif format_ is Format.concise:
        from foresee_dsl.language.messages.diagnostics import render_concise

        typer.echo("\n".join(map(render_concise, shown)), nl=bool(shown))
    else:
        _print_full(result, shown)


def _print_full(result: Checked, shown: Sequence[Diagnostic]) -> None:
    if shown:
        print_diagnostics(tuple(shown))
    if not any(d.severity == "error" for d in shown):
        warned = "no mistakes, but warnings" if shown else "no mistakes found"
        typer.echo(f"{counted(result.files, 'file')}, {counted(len(result.cases), 'test case')}: {warned}")
