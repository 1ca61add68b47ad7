"""Commands for children whose parent changed: repin."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.common import FAILED, JsonOption, print_json

if TYPE_CHECKING:
    from collections.abc import Sequence

    from foresee_dsl.errors import Diagnostic
    from foresee_dsl.language.project.document import TestCase
    from foresee_dsl.language.repinning.repin import Child


def repin(
    paths: Annotated[list[Path], typer.Argument(metavar="CHILD", help="Clips and mutants, or folders of them.")],
    write: Annotated[
        bool, typer.Option("--write/--dry-run", help="Write the new pins; by default only say what would happen.")
    ] = False,
    run: Annotated[
        bool, typer.Option("--run", help="Drive every stale child before and after: the same verdict?")
    ] = False,
    json: JsonOption = False,
) -> None:
    """Show what a parent's edit does to its stale children, and write their new pins.

    A child that no longer fits its parent is a conflict: it is named, left alone, and the exit code is 1.

    [dim]foresee repin out/children
    foresee repin regressions --write
    foresee repin clip.foresee --run[/dim]
    """
    from foresee_dsl.language.repinning.repin import State, plan
    from foresee_dsl.language.repinning.repin import write as write_pins

    children = plan(paths, _placement)
    verdicts = _verdicts(children) if run else {}
    written = write_pins(children) if write else ()
    failed = [child for child in children if child.state in (State.CONFLICT, State.BLOCKED)]
    if json:
        told = [child.as_dict() | {"verdict": verdicts.get(child.file)} for child in children]
        print_json({"schema": 1, "ok": not failed, "written": [str(file) for file in written], "children": told})
    else:
        _print(children, verdicts, write=write)
    if failed:
        raise typer.Exit(FAILED)


def _placement(case: TestCase) -> Sequence[Diagnostic]:
    """Build the network and place everybody."""
    from foresee_dsl.compile import placement_mistakes

    return placement_mistakes([case])


def _verdicts(children: Sequence[Child]) -> dict[Path, tuple[str, str]]:
    """Drive the stale children under their old parent and under the new one; what each run ended with."""
    from foresee_dsl.campaign.repin_effects import before_and_after
    from foresee_dsl.language.repinning.repin import State

    return before_and_after([child for child in children if child.state is State.STALE])


def _print(children: Sequence[Child], verdicts: dict[Path, tuple[str, str]], *, write: bool) -> None:
    from foresee_dsl.language.repinning.text import describe, summary

    for child in children:
        typer.echo(describe(child, verdicts.get(child.file), written=write), nl=False)
    typer.echo(summary(children, written=write))
