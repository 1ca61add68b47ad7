"""The command `store`: shows statistics of the results that campaigns store, and cleans up, merges or exports them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.options.common import JsonOption, console, print_json

if TYPE_CHECKING:
    from foresee_dsl.campaign.storage.maintenance import MergeCounts, Statistics

ACTIONS = ("stat", "gc", "export", "merge")
TITLES = {"fuzz": "mutated whole (foresee fuzz)"}
"""Table headings for the kinds of results that plug-ins store; other kinds appear under their own names."""


def store(
    action: Annotated[
        str,
        typer.Argument(
            metavar="ACTION", help="What to do: stat, gc (delete traces that no result uses), export or merge."
        ),
    ],
    folders: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[STORE]...", help="Folder of the store, by default out/store; for merge, several."),
    ] = None,
    to: Annotated[Path | None, typer.Option("--to", help="With export: the file to write, .parquet or .csv.")] = None,
    into: Annotated[
        Path | None, typer.Option("--into", help="With merge: the store that receives all results.")
    ] = None,
    older: Annotated[
        bool, typer.Option("--older", help="With gc: also delete results of other versions of this tool.")
    ] = False,
    damaged: Annotated[
        bool, typer.Option("--damaged", help="With gc: also read every trace and delete damaged ones.")
    ] = False,
    json: JsonOption = False,
) -> None:
    """Inspect, clean up, merge or export the folder in which campaigns store their results.

    [dim]foresee store stat
    foresee store gc --older
    foresee store export --to runs.parquet
    foresee store merge part1/store part2/store --into out/store[/dim]
    """
    from foresee_dsl.campaign.stages import STEPS
    from foresee_dsl.campaign.storage.maintenance import export, merge, statistics, sweep
    from foresee_dsl.campaign.storage.store import Store

    if action not in ACTIONS:
        raise typer.BadParameter(f"{action!r} is not one of: {', '.join(ACTIONS)}", param_hint="ACTION")
    stores = folders or [Path("out/store")]
    if action == "merge":
        if into is None or not folders:
            raise typer.BadParameter("merge needs at least one store, and --into DIR", param_hint="--into")
        merged = merge(folders, into)
        _print(merged, _merged(into, merged), json=json)
        return
    if len(stores) != 1:
        raise typer.BadParameter(f"{action} takes one store", param_hint="STORE")
    folder = stores[0]
    if action == "stat":
        with Store(folder, write=False) as opened:
            statistics_of_store = statistics(opened, [step.kind for step in STEPS])
        if json:
            print_json(statistics_of_store)
        else:
            _print_statistics(folder, statistics_of_store)
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


def _merged(into: Path, merged: MergeCounts) -> str:
    """Return the result of `merge` as text, with the results that were left out in a second line."""
    text = f"{into}: {merged.new} new results, {merged.known} already there"
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


def _print_statistics(folder: Path, statistics: Statistics) -> None:
    from foresee_dsl.campaign.stages import STEPS
    from foresee_dsl.report.terminal.tables import duration, plain_table

    screen = console()
    titles = {step.kind: step.title for step in STEPS} | TITLES
    always = [step.kind for step in STEPS]
    kinds = [
        (titles.get(kind, kind), statistics.kinds.get(kind, {})) for kind in dict.fromkeys([*always, *statistics.kinds])
    ]
    rows = (
        (title, sum(verdicts.values()), ", ".join(f"{n} {verdict}" for verdict, n in verdicts.items() if verdict))
        for title, verdicts in kinds
    )
    screen.print(plain_table(("results", "number", "verdicts"), rows, align="<><"))
    if statistics.broken:
        screen.print(f"{statistics.broken} crashed or hung; `foresee campaign --retry` runs them again")
    screen.print(f"simulated {duration(statistics.simulated_s)} in {duration(statistics.wall_s)} of wall time")
    tools = ", ".join(f"{count} by {tool}" for tool, count in statistics.tools.items())
    screen.print(f"{folder}: {statistics.traces} traces {statistics.trace_bytes / 1e6:.1f} MB, "
                 f"rows {statistics.database_bytes / 1e6:.1f} MB" + (f" ({tools})" if tools else ""))  # fmt: skip
