"""The command `store`: what campaigns keep, looked at, tidied, joined and exported."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.options.common import JsonOption, console, print_json

if TYPE_CHECKING:
    from foresee_dsl.campaign.storage.maintenance import Merged, Statistics

ACTIONS = ("stat", "gc", "export", "merge")
TITLES = {"fuzz": "mutated whole (foresee fuzz)"}
"""What a table calls the kinds of results that plug-ins store; another kind is called as its plug-in calls it."""


def store(
    action: Annotated[str, typer.Argument(metavar="ACTION", help="stat, gc, export or merge.")],
    folders: Annotated[
        list[Path] | None, typer.Argument(metavar="[STORE]...", help="The store; of merge, several.")
    ] = None,
    to: Annotated[Path | None, typer.Option("--to", help="export: the file, .parquet or .csv.")] = None,
    into: Annotated[Path | None, typer.Option("--into", help="merge: the store that gets everything.")] = None,
    older: Annotated[bool, typer.Option("--older", help="gc: also results of other versions of this tool.")] = False,
    damaged: Annotated[
        bool, typer.Option("--damaged", help="gc: also read every trace and drop damaged ones.")
    ] = False,
    json: JsonOption = False,
) -> None:
    """Look after the folder in which campaigns keep what was run.

    [dim]foresee store stat
    foresee store gc --older
    foresee store export --to runs.parquet
    foresee store merge part1/store part2/store --into out/store[/dim]
    """
    from foresee_dsl.campaign.storage.maintenance import export, merge, statistics, sweep
    from foresee_dsl.campaign.storage.store import Store

    if action not in ACTIONS:
        raise typer.BadParameter(f"{action!r} is not one of: {', '.join(ACTIONS)}", param_hint="ACTION")
    named = folders or [Path("out/store")]
    if action == "merge":
        if into is None or not folders:
            raise typer.BadParameter("merge needs stores, and --into DIR", param_hint="--into")
        merged = merge(folders, into)
        _print(merged, _merged(into, merged), json=json)
        return
    if len(named) != 1:
        raise typer.BadParameter(f"{action} looks at one store", param_hint="STORE")
    folder = named[0]
    if action == "stat":
        with Store(folder, write=False) as opened:
            found = statistics(opened)
        if json:
            print_json(found)
        else:
            _print_statistics(folder, found)
    elif action == "gc":
        with Store(folder, write=False):
            pass  # a mistyped folder must not become a store
        with Store(folder) as opened:
            swept = sweep(opened, older=older, damaged=damaged)
        text = f"{folder}: {swept.rows} results and {swept.files} files deleted, {swept.size / 1e6:.1f} MB"
        _print(swept, text, json=json)
    else:
        if to is None:
            raise typer.BadParameter("export needs --to FILE.parquet or --to FILE.csv", param_hint="--to")
        with Store(folder, write=False) as opened:
            count = export(opened, to)
        _print({"rows": count, "file": to}, f"{to}: {count} rows", json=json)


def _merged(into: Path, merged: Merged) -> str:
    """Return what `merge` did as text; what was left out in a line of its own."""
    text = f"{into}: {merged.new} new results, {merged.known} known ones"
    left = [
        f"{count} {what}"
        for count, what in (
            (merged.damaged, "changed on the disk"),
            (merged.without_trace, "without their traces"),
        )
        if count
    ]
    return f"{text}\nleft out: {', '.join(left)}; a campaign runs them again" if left else text


def _print(data: object, text: str, *, json: bool) -> None:
    if json:
        print_json(data)
    else:
        typer.echo(text)


def _print_statistics(folder: Path, found: Statistics) -> None:
    from foresee_dsl.campaign.stages import STEPS
    from foresee_dsl.report.terminal.tables import duration, plain_table

    screen = console()
    titles = {step.kind: step.title for step in STEPS} | TITLES
    always = [step.kind for step in STEPS]
    kinds = [(titles.get(kind, kind), found.kinds.get(kind, {})) for kind in dict.fromkeys([*always, *found.kinds])]
    rows = (
        (title, sum(verdicts.values()), ", ".join(f"{n} {verdict}" for verdict, n in verdicts.items() if verdict))
        for title, verdicts in kinds
    )
    screen.print(plain_table(("results", "number", "verdicts"), rows, align="<><"))
    if found.broken:
        screen.print(f"{found.broken} crashed or hung; `foresee campaign --retry` runs them again")
    screen.print(f"simulated {duration(found.simulated_s)} in {duration(found.wall_s)} of wall time")
    tools = ", ".join(f"{count} by {tool}" for tool, count in found.tools.items())
    screen.print(f"{folder}: {found.traces} traces {found.trace_bytes / 1e6:.1f} MB, "
                 f"rows {found.database_bytes / 1e6:.1f} MB" + (f" ({tools})" if tools else ""))  # fmt: skip
