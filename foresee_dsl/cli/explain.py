"""The command explain: what a code means, why it is wrong, what to do, a wrong and a right example."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.common import FAILED, JsonOption, console, print_json

if TYPE_CHECKING:
    from foresee_dsl.language.codes.code import Code

_FILE = "\n--- "
"""What begins another file of an example, in front of its name."""
_PIN = "sha256:5ef2c6120a41"
"""What stands for a parent's pin in an example."""


def explain(
    code: Annotated[
        str | None, typer.Argument(metavar="CODE", help="Such as FS012; without one all are listed.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Say what a code means: why it is wrong, what to do, a wrong and a right example.

    [dim]foresee explain FS012
    foresee explain[/dim]
    """
    from foresee_dsl.report.codes import every_code

    codes = every_code()
    if code is None:
        _list(list(codes.values()), json=json)
        return
    name = code.strip().upper()
    found = codes.get(name)
    if found is None:
        typer.echo(f"error: there is no code {code[:40]}{_nearest(name, list(codes))}", err=True)
        raise typer.Exit(FAILED)
    if json:
        print_json({"schema": 1, "codes": [_data(found)]})
    else:
        _show(found)


def _nearest(name: str, known: list[str]) -> str:
    from foresee_dsl.language.messages.suggest import closest

    small = [code.lower() for code in known]
    digits = "".join(c for c in name if c.isdigit())
    meant = closest(f"fs{digits.zfill(3)}", small) or closest(name.lower(), small)
    meant = meant.upper() if meant else None
    return f": did you mean {meant}?" if meant else "; `foresee explain` lists them"


def _data(code: Code) -> dict[str, str]:
    return {
        "code": code.code,
        "severity": code.severity,
        "title": code.title,
        "explanation": code.explanation,
        "within": code.frame,
        "wrong": code.wrong.replace("PIN", _PIN),
        "right": code.right.replace("PIN", _PIN),
    }


def _list(codes: list[Code], *, json: bool) -> None:
    if json:
        print_json({"schema": 1, "codes": [_data(code) for code in codes]})
        return
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, show_header=False)
    for code in codes:
        tint = "cyan" if code.severity == "warning" else "red"
        table.add_row(Text(code.code, tint), Text(code.severity), Text(code.title))
    console().print(table)


def _show(code: Code) -> None:
    from rich.text import Text

    from foresee_dsl.editor.highlight import show
    from foresee_dsl.language.codes.examples import FRAMES

    out = console()
    tint = "cyan" if code.severity == "warning" else "red"
    out.print(Text.assemble((code.code, f"bold {tint}"), (f" {code.severity}: ", tint), (code.title, "bold")))
    out.print()
    out.print(Text(code.explanation))
    said = FRAMES[code.frame].said
    right = _without_repeats(code.wrong, code.right)
    for word, example in (("wrong", code.wrong), ("right", right)):
        if example:
            where = f", {said}" if said and _FILE not in example and not example.startswith("$") else ""
            out.print(Text(f"\n{word}{where}:"))
            show(textwrap.indent(example.rstrip("\n").replace("PIN", _PIN), "  ") + "\n")


def _without_repeats(wrong: str, right: str) -> str:
    """Return the right example without the files that are as in the wrong one."""
    shown = wrong.split(_FILE)
    first, *files = right.split(_FILE)
    kept = [f"{part.partition(chr(10))[0]} (as above)" if part in shown[1:] else part for part in files]
    return _FILE.join([first, *kept])
