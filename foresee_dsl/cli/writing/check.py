"""The commands `check`, which shows all errors of some files, and `explain`, which explains the code of an error."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.completion import case_addresses
from foresee_dsl.cli.options.common import (
    CALL,
    FAILED,
    AllowOutsideOption,
    JsonOption,
    console,
    give,
    json_document,
    print_diagnostics,
    print_json,
)
from foresee_dsl.cli.options.output import format_option
from foresee_dsl.report.formats import PEOPLE, CommandReport, rendered
from foresee_dsl.report.safe_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from foresee_dsl.errors import Diagnostic
    from foresee_dsl.language.checked_files import CheckResult
    from foresee_dsl.language.codes import Code

Paths = Annotated[
    list[str],
    typer.Argument(metavar="PATH", help="Files, folders, or test cases (FILE::CASE).", autocompletion=case_addresses),
]


def check(
    paths: Paths,
    format_: Annotated[
        str,
        format_option(
            "full: for people; concise: one line per diagnostic; json, github, sarif: for tools.",
            "full",
            "concise",
            "json",
            "github",
            "sarif",
        ),
    ] = "full",
    places: Annotated[
        bool, typer.Option("--places/--no-places", help="Also build the network and check the place of every actor.")
    ] = True,
    strict: Annotated[bool, typer.Option("--strict", help="Treat warnings as errors.")] = False,
    select: Annotated[
        list[str] | None,
        typer.Option("--select", metavar="CODE", help="Show only these warnings (FS301, or FS3 for a group)."),
    ] = None,
    ignore: Annotated[
        list[str] | None, typer.Option("--ignore", metavar="CODE", help="Hide these warnings; errors cannot be hidden.")
    ] = None,
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Find errors in the text, in the names and, with the network, in the positions of actors.

    Exit code 1 if there is an error, or with --strict a warning. `foresee explain CODE` explains a code.

    [dim]foresee check scenarios
    foresee check --format github --strict scenarios[/dim]
    """
    from foresee_dsl.errors import InputError
    from foresee_dsl.language.checked_files import CheckResult, check_paths

    wanted, unwanted = _codes(select, "--select"), _codes(ignore, "--ignore")
    try:
        result = check_paths(paths, allow_outside=allow_outside)
    except InputError as error:  # a missing file is reported in the requested format too
        result = CheckResult(0, (), error.diagnostics)
    diagnostics = result.diagnostics
    if result.campaigns:
        from foresee_dsl.campaign.campaign_file import mistakes_of  # slow: it searches for plug-ins

        for document in result.campaigns:
            diagnostics += mistakes_of(document, allow_outside=allow_outside, with_goal=True)
    if places:
        from foresee_dsl.compile import with_placements

        diagnostics = with_placements(diagnostics, result.cases)
    selected = [
        d
        for d in diagnostics
        if d.severity == "error" or (d.code.startswith(wanted or "") and not d.code.startswith(unwanted))
    ]
    failed = any(strict or d.severity == "error" for d in selected)
    _print(format_, result, selected, failed=failed)
    if failed:
        raise typer.Exit(FAILED)


def _codes(options: Iterable[str] | None, option: str) -> tuple[str, ...]:
    """Return the codes of texts such as `FS301,FS302`; raise if no code begins with one of them."""
    codes = tuple(code.strip().upper() for part in options or () for code in part.split(",") if code.strip())
    if codes:
        from foresee_dsl.language.codes import every_code

        for code in codes:
            if not any(existing.startswith(code) for existing in every_code()):
                raise typer.BadParameter(f"there is no code {code}; `foresee explain` lists all", param_hint=option)
    return codes


def _print(format_: str, result: CheckResult, diagnostics: Sequence[Diagnostic], *, failed: bool) -> None:
    def data() -> str:
        return json_document(
            {"ok": not failed, "files": result.files, "test_cases": len(result.cases), "diagnostics": diagnostics}
        )

    if format_ in PEOPLE or CALL.get().output is not None:  # with --output, the report still appears on the terminal
        _print_for_people(result, diagnostics)
    if format_ not in PEOPLE:
        give(rendered(format_, CommandReport("check", data, mistakes=lambda: diagnostics)))


def _print_for_people(result: CheckResult, diagnostics: Sequence[Diagnostic]) -> None:
    if diagnostics:
        print_diagnostics(tuple(diagnostics))
    if not any(d.severity == "error" for d in diagnostics):
        warned = "no errors, but warnings" if diagnostics else "no errors found"
        typer.echo(f"{counted(result.files, 'file')}, {counted(len(result.cases), 'test case')}: {warned}")


# ---- explain --------------------------------------------------------------------------------------------------------

_FILE = "\n--- "
"""Text in front of the name of each further file of an example."""


def explain(
    code: Annotated[
        str | None, typer.Argument(metavar="CODE", help="A code such as FS012; without it, all codes are listed.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Explain a code: why the input is wrong, what to do, a wrong and a right example.

    [dim]foresee explain FS012
    foresee explain[/dim]
    """
    from foresee_dsl.language.codes import every_code

    codes = every_code()
    if code is None and json:
        print_json({"codes": codes.values()})
        return
    if code is None:
        _list(list(codes.values()))
        return
    name = code.strip().upper()
    meaning = codes.get(name)
    if meaning is None:
        typer.echo(f"error: there is no code {code[:40]}{_nearest(name, list(codes))}", err=True)
        raise typer.Exit(FAILED)
    if json:
        print_json({"codes": [meaning]})
    else:
        _show(meaning)


def _nearest(name: str, codes: list[str]) -> str:
    from foresee_dsl.language.messages.suggest import closest

    small = [code.lower() for code in codes]
    digits = "".join(c for c in name if c.isdigit())
    suggestion = closest(f"fs{digits.zfill(3)}", small) or closest(name.lower(), small)
    return f": did you mean {suggestion.upper()}?" if suggestion else "; `foresee explain` lists them"


def _list(codes: list[Code]) -> None:
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, show_header=False)
    for code in codes:
        tint = "cyan" if code.severity == "warning" else "red"
        table.add_row(Text(code.code, tint), Text(code.severity), Text(code.title))
    console().print(table)


def _show(code: Code) -> None:
    from rich.text import Text

    from foresee_dsl.cli.options.plain_output import plain
    from foresee_dsl.editor.highlight import show

    out = console()
    tint = "cyan" if code.severity == "warning" else "red"
    out.print(Text.assemble((code.code, f"bold {tint}"), (f" {code.severity}: ", tint), (code.title, "bold")))
    out.print()
    out.print(Text(code.explanation))
    right = _without_repeats(code.wrong_example, code.right_example)
    for word, example in (("wrong", code.wrong_example), ("right", right)):
        if example:
            where = f", {code.within}" if code.within and _FILE not in example and not example.startswith("$") else ""
            out.print(Text(f"\n{word}{where}:"))
            show(plain(textwrap.indent(example.rstrip("\n"), "  ")) + "\n")


def _without_repeats(wrong: str, right: str) -> str:
    """Return the right example without the text of files that are the same in the wrong one."""
    wrong_parts = wrong.split(_FILE)
    first, *files = right.split(_FILE)
    repeated = [f"{part.partition(chr(10))[0]} (as above)" if part in wrong_parts[1:] else part for part in files]
    return _FILE.join([first, *repeated])
