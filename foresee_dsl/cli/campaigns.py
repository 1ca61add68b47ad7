"""Commands for whole folders: campaign and verify."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.campaign_options import (
    CPUS,
    Flags,
    Jobs,
    Paths,
    asked,
    executor_of,
    of_other_versions,
    shard_of,
    with_flags,
)
from foresee_dsl.cli.common import FAILED, OK, JsonOption, console, print_json

if TYPE_CHECKING:
    from rich.console import Console

    from foresee_dsl.campaign.results import CampaignResult


@with_flags
def campaign(
    ctx: typer.Context,
    paths: Paths,
    flags: Flags,
    executor: Annotated[str, typer.Option(help="Who runs it: local (processes here), dask (a cluster).")] = "local",
    scheduler: Annotated[str, typer.Option(help="The Dask scheduler's address; a cluster here unless you say.")] = "",
    deadline: Annotated[
        float | None, typer.Option(min=0.1, help="Wall time in seconds that a run may take; it ends as `timeout`.")
    ] = None,
    memory: Annotated[float, typer.Option(min=100, help="Memory in MB that a worker may take.")] = 4096,
    budget: Annotated[float | None, typer.Option(min=0, help="Begin nothing more after so many minutes.")] = None,
    retry: Annotated[
        bool, typer.Option("--retry", help="Run again what crashed or hung in an earlier campaign.")
    ] = False,
    report: Annotated[
        Path | None, typer.Option(help="Also save the report to this file: .svg, .html or .txt by its name.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress.")] = False,
    log_json: Annotated[Path | None, typer.Option(help="Write every event to this file, a JSON object a line.")] = None,
    json: JsonOption = False,
) -> None:
    """Run everything: test cases, forecasts, clips, mutants; keep what fails, and report.

    What was run before is taken from the store. A campaign that was stopped, by whatever, goes on where it was.

    [dim]foresee campaign scenarios --jobs 2 --out out
    foresee campaign scenarios/scenario7.foresee::r02
    foresee campaign nightly.foresee --jobs 8[/dim]
    """
    from contextlib import ExitStack

    from foresee_dsl.campaign.execution.engine import RunOptions, run_campaign
    from foresee_dsl.campaign.settings import Limits
    from foresee_dsl.campaign.storage.store import Store
    from foresee_dsl.cli.stopping import Stopping
    from foresee_dsl.compile import placement_mistakes
    from foresee_dsl.errors import InputError
    from foresee_dsl.language.project.loading import load_test_cases
    from foresee_dsl.report.live import progress

    if report is not None and report.suffix not in (".svg", ".html", ".txt"):
        raise typer.BadParameter(f"{report} must end in .svg, .html or .txt", param_hint="--report")
    wanted = asked(ctx, paths, flags, budget)
    stop = Stopping()
    options = RunOptions(
        jobs=flags.jobs,
        limits=Limits(deadline, memory, None if wanted.budget_min is None else wanted.budget_min * 60),
        shard=shard_of(flags.shard),
        retry=retry,
        executor=executor_of(executor, scheduler),
        stop=stop,
    )
    cases = load_test_cases(wanted.paths, allow_outside=flags.allow_outside)
    if mistakes := placement_mistakes(cases):
        raise InputError(mistakes)  # before there is a store
    with ExitStack() as stack:
        opened = stack.enter_context(Store(flags.store_folder))
        told, log = progress(stack, console(error=True), quiet=quiet, log=log_json)
        stack.enter_context(stop)
        results = []
        for settings in wanted.settings:
            if log is not None:
                log.begin(test_cases=len(cases), settings=settings.as_dict(), jobs=flags.jobs, store=str(opened.folder))
            folder = wanted.folder(settings, flags.out)
            result = run_campaign(cases, settings, out=folder, store=opened, listener=told, options=options)
            results.append((folder, result))
            if log is not None:
                log.end(interrupted=result.interrupted, broken=len(result.broken), wall_s=round(result.wall_s, 2))
            if result.interrupted:
                break
        others = opened.of_other_versions()
    screen = console(error=json)
    _report(screen, results, report, json=json)
    if others:
        screen.print(of_other_versions(flags.store_folder, others))
    if results[-1][1].interrupted:
        screen.print("The same command goes on from there." if stop() else "The time is up: the same command goes on.")
        raise typer.Exit(stop.exit_code if stop() else OK)
    if any(result.broken for _, result in results):
        raise typer.Exit(FAILED)


def _report(screen: Console, results: list[tuple[Path, CampaignResult]], file: Path | None, *, json: bool) -> None:
    """Say what each campaign found, with its folder: on the screen or as JSON, and in a file."""
    from foresee_dsl.campaign.folder import as_text
    from foresee_dsl.report.terminal import print_campaign, save_campaign

    for folder, result in results:
        if json:
            typer.echo(as_text(result.as_dict()), nl=False)
        else:
            print_campaign(screen, result, folder)
        if file is not None:
            save_campaign(file, result, folder)


def verify(
    paths: Annotated[
        list[Path], typer.Argument(metavar="PATH", help="Recorded failures: mutants' files, or folders of them.")
    ],
    driver: Annotated[str, typer.Option("--driver", help="Another driver than the recorded one.")] = "",
    run_programs: Annotated[
        bool, typer.Option("--run-programs", help="Start the programs that files record as external drivers.")
    ] = False,
    jobs: Jobs = CPUS,
    json: JsonOption = False,
) -> None:
    """Run recorded failures again: reproduced, fixed, changed, or stale (the parent was edited)?

    Exit code 1 when a failure is stale or changed: it no longer says what it said.

    [dim]foresee verify out/children
    foresee verify regressions --driver mine[/dim]
    """
    from foresee_dsl.campaign.verify import Status, as_dict, verify_files
    from foresee_dsl.language.project.loading import recorded_children

    rechecks = verify_files(recorded_children(paths), driver=driver, run_programs=run_programs, jobs=jobs)
    if json:
        print_json(as_dict(rechecks))
    else:
        from foresee_dsl.report.terminal import print_verification

        print_verification(console(), rechecks)
    if any(r.status in (Status.STALE, Status.CHANGED) for r in rechecks):
        raise typer.Exit(FAILED)
