"""The command `plan`: what a campaign would do."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.campaign_options import Flags, Paths, asked, of_other_versions, shard_of, with_flags
from foresee_dsl.cli.common import console, print_json

if TYPE_CHECKING:
    from foresee_dsl.campaign.plan import CampaignPlan


@with_flags
def plan(
    ctx: typer.Context,
    paths: Paths,
    flags: Flags,
    format: Annotated[str, typer.Option("--format", help="text, dot (for Graphviz), or json.")] = "text",
) -> None:
    """Show what a campaign with the same options would run, what is done already, and how long it takes.

    [dim]foresee plan scenarios
    foresee plan scenarios --format dot | dot -Tsvg > plan.svg[/dim]
    """
    from foresee_dsl.campaign.plan import plan_campaign
    from foresee_dsl.campaign.stages import Stages
    from foresee_dsl.campaign.storage.store import Store
    from foresee_dsl.language.project.loading import load_test_cases

    if format not in ("text", "dot", "json"):
        raise typer.BadParameter(f"{format!r} is none: text, dot, json", param_hint="--format")
    wanted = asked(ctx, paths, flags)
    cases = load_test_cases(wanted.paths, allow_outside=flags.allow_outside)
    folder, out, part = flags.store_folder, flags.out, shard_of(flags.shard)
    opened = Store(folder, write=False) if (folder / "runs.sqlite").is_file() else None
    try:
        plans = [
            plan_campaign(Stages(cases, settings, opened, wanted.folder(settings, out), part), opened, jobs=flags.jobs)
            for settings in wanted.settings
        ]
        others = opened.of_other_versions() if opened is not None else 0
    finally:
        if opened is not None:
            opened.close()
    for settings, found in zip(wanted.settings, plans, strict=True):
        if format == "text" and len(plans) > 1:
            console().print(f"{settings.driver}, {settings.ranker}", style="bold")
        _show(found, folder, format, stored=opened is not None)
    if format == "text" and others:
        console().print(of_other_versions(folder, others))


def _show(found: CampaignPlan, folder: Path, format: str, *, stored: bool) -> None:
    if format == "json":
        print_json(found.as_dict())
    elif format == "dot":
        typer.echo(found.as_dot())
    else:
        _print(found, folder, stored=stored)


def _print(found: CampaignPlan, folder: Path, *, stored: bool) -> None:
    from rich.table import Table

    from foresee_dsl.campaign.plan import TITLES
    from foresee_dsl.report.terminal import duration

    screen = console()
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("stage", "done", "to run", "at most more", "each"):
        table.add_column(heading, justify="left" if heading == "stage" else "right")
    for stage in found.stages:
        each = f"{stage.each_s:.2f} s" + ("" if stage.measured else " (usual)")
        table.add_row(TITLES[stage.kind], str(stage.done), str(stage.to_run), str(stage.at_most), each)
    screen.print(table)
    to_run, more = found.runs_to_do
    if not to_run + more:
        screen.print(f"Everything is in {folder}: nothing has to be run.")
        return
    screen.print(f"{to_run} runs" + (f", and at most {more} that follow from them" if more else ""))
    means = "by the times in the store" if found.measured else "by usual times, as the store has none of some stages"
    screen.print(f"at most {duration(found.longest_s)} on {found.jobs} workers, {means}")
    if not stored:
        screen.print(f"There is no store in {folder} yet.")
