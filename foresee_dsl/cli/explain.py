"""The command explain: what a code means, why it is wrong, what to do, a wrong and a right example."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.common import FAILED, JsonOption, console, print_json

if TYPE_CHECKING:
    from foresee_dsl.language.codes import Code

_SHOWN = 74
"""Columns of an example's line that are shown: with its margin it stays under 80."""
_PIN = "sha256:5ef2c6120a41"
"""What stands for a parent's pin in an example."""


def explain(
    code: Annotated[
        str | None, typer.Argument(metavar="[CODE]", help="Such as FS012; without one all are listed.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Say what a code means: why it is wrong, what to do, a wrong and a right example.

    [dim]foresee explain FS012    foresee explain[/dim]
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
    from foresee_dsl.language.suggest import closest

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
    from rich.padding import Padding
    from rich.text import Text

    from foresee_dsl.language.examples import FRAMES

    out = console()
    tint = "cyan" if code.severity == "warning" else "red"
    out.print(Text.assemble((code.code, f"bold {tint}"), (f" {code.severity}: ", tint), (code.title, "bold")))
    out.print()
    out.print(Text(code.explanation))
    said = FRAMES[code.frame].said
    for word, example in (("wrong", code.wrong), ("right", code.right)):
        if example:
            where = f", {said}" if said and "\n--- " not in example and not example.startswith("$") else ""
            out.print(Text(f"\n{word}{where}:"))
            out.print(
                Padding(Text("\n".join(map(_cut, _lines(example))), "dim" if word == "wrong" else ""), (0, 0, 0, 4))
            )


def _lines(example: str) -> list[str]:
    return example.rstrip("\n").replace("PIN", _PIN).split("\n")


def _cut(line: str) -> str:
    return line if len(line) <= _SHOWN else line[: _SHOWN - 3] + "..."
