"""The command `plan`: what a campaign would do."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.campaign_options import (
    CPUS,
    After,
    Before,
    Children,
    Jobs,
    Paths,
    Repeat,
    RiskyPoints,
    ShardOption,
    StoreOption,
    asked,
    shard_of,
)
from foresee_dsl.cli.common import (
    AllowOutsideOption,
    DriverOption,
    HandoverOption,
    OutOption,
    PresetOption,
    RankerOption,
    SeedOption,
    console,
    print_json,
)

if TYPE_CHECKING:
    from foresee_dsl.campaign.plan import CampaignPlan


def plan(
    ctx: typer.Context,
    paths: Paths,
    driver: DriverOption = "pdm",
    ranker: RankerOption = "foresee",
    preset: PresetOption = "focused",
    before: Before = 5.0,
    after: After = 5.0,
    risky_points: RiskyPoints = 4,
    children: Children = 4,
    handover: HandoverOption = 0.0,
    repeat: Repeat = 1,
    jobs: Jobs = CPUS,
    seed: SeedOption = 0,
    out: OutOption = Path("out"),
    store: StoreOption = None,
    shard: ShardOption = "",
    format: Annotated[str, typer.Option("--format", help="text, dot (for Graphviz), or json.")] = "text",
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Show what a campaign with the same options would run, what is done already, and how long it takes.

    [dim]foresee plan scenarios
    foresee plan scenarios --format dot | dot -Tsvg > plan.svg[/dim]
    """
    from foresee_dsl.campaign.plan import plan_campaign
    from foresee_dsl.campaign.stages import Stages
    from foresee_dsl.campaign.store import Store
    from foresee_dsl.language.project import load_test_cases

    if format not in ("text", "dot", "json"):
        raise typer.BadParameter(f"{format!r} is none: text, dot, json", param_hint="--format")
    wanted = asked(
        ctx, paths, driver=driver, ranker=ranker, preset=preset, before=before, after=after, risky_points=risky_points,
        children=children, handover=handover, seed=seed, repeat=repeat,
    )  # fmt: skip
    cases = load_test_cases(wanted.paths, allow_outside=allow_outside)
    folder = store or out / "store"
    opened = Store(folder, write=False) if (folder / "runs.sqlite").is_file() else None
    part = shard_of(shard)
    try:
        plans = [
            plan_campaign(Stages(cases, settings, opened, wanted.folder(settings, out), part), opened, jobs=jobs)
            for settings in wanted.settings
        ]
    finally:
        if opened is not None:
            opened.close()
    for settings, found in zip(wanted.settings, plans, strict=True):
        if format == "text" and len(plans) > 1:
            console().print(f"{settings.driver}, {settings.ranker}", style="bold")
        _show(found, folder, format, stored=opened is not None)


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
