"""The commands `campaign`, the whole method on many test cases, and `plan`, what a campaign would run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foresee_dsl.cli.options import common
from foresee_dsl.cli.options.campaign_options import (
    ExecutorOption,
    Flags,
    HelpAllOption,
    LimitFlags,
    Paths,
    Request,
    SchedulerOption,
    executor_of,
    notes_on,
    of_other_versions,
    requested,
    shard_of,
    with_flags,
)
from foresee_dsl.cli.options.common import (
    FAILED,
    FailFastOption,
    console,
    json_document,
    selected,
)
from foresee_dsl.cli.options.output import FormatOption, JunitOption, format_option, report_results
from foresee_dsl.cli.options.stop_signal import StopSignal
from foresee_dsl.measuring import Part
from foresee_dsl.report.formats import PEOPLE, CommandReport
from foresee_dsl.report.safe_text import counted

if TYPE_CHECKING:
    from rich.console import Console

    from foresee_dsl.campaign.execution.engine import Listener
    from foresee_dsl.campaign.plan import CampaignPlan
    from foresee_dsl.campaign.profiling.profile import Profile
    from foresee_dsl.campaign.results import CampaignResult
    from foresee_dsl.campaign.storage.store import Store
    from foresee_dsl.campaign.workers.pool import RunOptions
    from foresee_dsl.language.document import TestCase
    from foresee_dsl.report.terminal.live import JsonLog


@with_flags
def campaign(
    ctx: typer.Context,
    paths: Paths,
    flags: Flags,
    *,
    executor: ExecutorOption = "local",
    scheduler: SchedulerOption = "",
    dashboard: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Address at which the Dask web page of a cluster on this machine is shown, such as :8787.",
        ),
    ] = "",
    limits: LimitFlags,
    report: Annotated[
        Path | None,
        typer.Option(help="Also save the report to this file, as the ending of its name says: .svg, .html or .txt."),
    ] = None,
    raw: Annotated[bool, typer.Option("--raw", help="Also report the raw counts, by family and kind.")] = False,
    fail_fast: FailFastOption = False,
    exit_zero: common.ExitZeroOption = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress.")] = False,
    log_json: Annotated[
        Path | None, typer.Option(help="Write every event to this file, one JSON object per line.")
    ] = None,
    format_: FormatOption = "text",
    junit: JunitOption = None,
    profile: common.ProfileOption = False,
    help_all: HelpAllOption = False,  # noqa: ARG001 - its callback prints the help
) -> None:
    """Run a whole campaign: test cases, forecasts, clips, mutants; keep the failures and write a report.

    Results in the store are not computed again, so the same command continues a stopped campaign.
    Exit code 1 when a test case or a mutant failed.

    [dim]foresee campaign scenarios --jobs 2 --out out
    foresee campaign scenarios/scenario7.foresee::r02
    foresee campaign nightly.foresee --jobs 8[/dim]
    """
    profiler = ctx.with_resource(common.profiling()) if profile else None
    from contextlib import ExitStack
    from functools import partial

    from foresee_dsl.campaign.execution.engine import StoredCounts
    from foresee_dsl.campaign.storage.lock import only_writer
    from foresee_dsl.campaign.storage.store import Store
    from foresee_dsl.campaign.workers.pool import RunOptions
    from foresee_dsl.language.project.loading import load_test_cases
    from foresee_dsl.report.page.running import RunningPage
    from foresee_dsl.report.terminal.live import FirstFailure, progress

    if report is not None and report.suffix not in (".svg", ".html", ".txt"):
        raise typer.BadParameter(f"{report} must end in .svg, .html or .txt", param_hint="--report")
    request = requested(ctx, paths, flags, limits.budget)
    stop, first_failure = StopSignal(), FirstFailure()
    run_by = executor_of(executor, scheduler, dashboard)
    options = RunOptions(
        jobs=flags.jobs,
        limits=limits.within(request.budget_min),
        shard=shard_of(flags.shard),
        retry=limits.retry,
        executor=run_by if profiler is None else profiler.executor(run_by),
        stop=(lambda: stop() or first_failure.name != "") if fail_fast else stop,
    )
    with Part.READING:
        cases = selected(load_test_cases(request.paths, allow_outside=flags.allow_outside), None, flags.only)
        cases, left_out = _chosen(cases, request, flags)
        _check(cases)
    if profiler is not None:
        profiler.ready()
    # Until the pages are written, no other campaign may use the folder.
    ctx.with_resource(only_writer(flags.out))
    with ExitStack() as stack:
        store = stack.enter_context(Store(flags.store_folder))
        listeners, log = progress(stack, console(error=True), quiet=quiet, log=log_json, settings=request.settings[0])
        stored = StoredCounts()
        listeners += [first_failure, stored, RunningPage(flags.out / "report.html", request.settings[0])]
        stack.enter_context(stop.listening())
        results = _run_all(cases, request, flags, store, options, listeners, log)
        notes = [*left_out, *notes_on(store)]
    spent = (
        None
        if profiler is None
        else partial(
            profiler.profile, [s.driver for s in request.settings], workers=flags.jobs, not_measured=stored.count
        )
    )
    _report(results, report, format_, junit, store=flags.store_folder, raw=raw, profile=spent)
    screen = console(error=format_ not in PEOPLE)
    _pages([folder for folder, _ in results], flags.out, screen)
    if spent is not None:
        from foresee_dsl.report.terminal.profile import print_profile

        print_profile(screen, spent())
    for note in notes:
        screen.print(note, markup=False)
    if results[-1][1].interrupted:
        at_failure = bool(first_failure.name) and fail_fast and not stop()
        ended = "Stopped at the first failure. " if at_failure else "The time budget is used up. "
        again = "The same command without --fail-fast" if at_failure else "The same command"
        screen.print(f"{'' if stop() else ended}{again} continues from there.")
        if stop():
            raise typer.Exit(stop.exit_code)
    if any(result.broken or (result.failed and not exit_zero) for _, result in results):
        raise typer.Exit(FAILED)


def _chosen(cases: Sequence[TestCase], request: Request, flags: Flags) -> tuple[tuple[TestCase, ...], list[str]]:
    """Return the first of the test cases that have the campaign's goal (without a goal, of all), the request's notes,
    and notes on what is left out: other test cases, and earlier failures that belong to none of them.
    """
    from foresee_dsl.campaign.allocation.earlier import EarlierMutants
    from foresee_dsl.campaign.goal import left_out, with_goal

    settings = request.settings[0]
    notes = [*request.notes, left_out(cases, settings.goal)]
    cases = with_goal(cases, settings.goal)[: flags.first]
    if settings.first_from:
        earlier = EarlierMutants.in_folder(Path(settings.first_from), but=request.folder(settings, flags.out))
        if others := earlier.left_out(cases):
            of = f"{others} of {counted(earlier.count, 'failing mutant')} in {settings.first_from}"
            belong = "belongs" if others == 1 else "belong"
            notes.append(f"not run first: {of} {belong} to other test cases, or to other versions of these")
    return tuple(cases), [note for note in notes if note]


def _check(cases: Sequence[TestCase]) -> None:
    """Raise the errors of test cases and of their project's triage before a store is created."""
    from foresee_dsl.campaign.triage.decisions import read_decisions, triage_file
    from foresee_dsl.compile import placement_mistakes
    from foresee_dsl.errors import InputError

    if mistakes := placement_mistakes(cases):
        raise InputError(mistakes)
    read_decisions(triage_file(case.id for case in cases))


def _run_all(
    cases: Sequence[TestCase],
    request: Request,
    flags: Flags,
    store: Store,
    options: RunOptions,
    listeners: Sequence[Listener],
    log: JsonLog | None,
) -> list[tuple[Path, CampaignResult]]:
    """Run one campaign per driver and ranker; return each result with the campaign's folder."""
    from dataclasses import asdict

    from foresee_dsl.campaign.execution.engine import run_campaign

    results = []
    for settings in request.settings:
        if log is not None:
            log.write("begin", test_cases=len(cases), settings=asdict(settings), jobs=flags.jobs,
                      store=str(store.folder))  # fmt: skip
        folder = request.folder(settings, flags.out)
        result = run_campaign(cases, settings, out=folder, store=store, listeners=listeners, options=options,
                              repeat=True)  # fmt: skip
        results.append((folder, result))
        if log is not None:
            log.write("end", interrupted=result.interrupted, broken=len(result.broken),
                      wall_s=round(result.wall_s, 2))  # fmt: skip
        if result.interrupted:
            break
    return results


def _report(
    results: list[tuple[Path, CampaignResult]],
    file: Path | None,
    form: str,
    junit: Path | None,
    *,
    store: Path,
    raw: bool,
    profile: Callable[[], Profile] | None,
) -> None:
    """Print the campaigns' results in the requested format, and save the text report to a file.

    `profile` returns where the time went so far, or is None without `--profile`; the JSON output contains it.
    """
    from dataclasses import replace

    from foresee_dsl.campaign.folder import as_text, campaign_document
    from foresee_dsl.campaign.triage.standing import standing_of
    from foresee_dsl.documents import plain
    from foresee_dsl.report.builds.case_results import CaseResult, of_campaign
    from foresee_dsl.report.terminal.campaign import print_campaign, save_campaign

    def people(screen: Console) -> None:
        for folder, result in results:
            print_campaign(screen, result, folder, store, raw=raw)

    def data() -> str:
        more = {"profile": plain(profile())} if profile is not None else {}
        if len(results) > 1:
            return _several(results, more)
        folder, result = results[0]
        standing = {"standing": plain(standing_of(result, folder))}
        return as_text({**campaign_document(result), **standing, **more})

    def case_results() -> list[CaseResult]:
        if len(results) == 1:
            return list(of_campaign(results[0][1], results[0][0]))
        return [
            replace(result_of_case, name=f"{result_of_case.name} [{result.settings.driver}, {result.settings.ranker}]")
            for folder, result in results
            for result_of_case in of_campaign(result, folder)
        ]

    report_results(
        form,
        CommandReport(
            "campaign", data, case_results, properties=[("driver", result.settings.driver) for _, result in results]
        ),
        people=people,
        junit=junit,
    )
    if file is not None:
        for folder, result in results:
            save_campaign(file, result, folder, store)


def _several(results: list[tuple[Path, CampaignResult]], more: Mapping[str, Any]) -> str:
    from foresee_dsl.campaign.folder import campaign_document
    from foresee_dsl.campaign.triage.standing import standing_of

    campaigns = [
        {**campaign_document(result), "folder": str(folder), "standing": standing_of(result, folder)}
        for folder, result in results
    ]
    return json_document({"campaigns": campaigns, **more}, "campaigns")


def _pages(folders: list[Path], out: Path, screen: Console) -> None:
    """Write each campaign's page and, for several campaigns, one page of all."""
    from foresee_dsl.report.page.html import write_report

    pages = [folder / "report.html" for folder in folders]
    for folder, file in zip(folders, pages, strict=True):
        write_report([folder], file)
    if len(folders) > 1:
        pages.append(out / "report.html")
        write_report(folders, pages[-1])
    screen.print(f"\nThe findings with their playback: {pages[-1]}", soft_wrap=True, markup=False)


@with_flags
def plan(
    ctx: typer.Context,
    paths: Paths,
    flags: Flags,
    format: Annotated[
        str, format_option("text: for people; dot: for Graphviz; json: for tools.", "text", "dot", "json")
    ] = "text",
    help_all: HelpAllOption = False,  # noqa: ARG001 - its callback prints the help
) -> None:
    """Show what a campaign with the same options would run, what is already done, and how long the rest takes.

    [dim]foresee plan scenarios
    foresee plan scenarios --format dot | dot -Tsvg > plan.svg[/dim]
    """
    from contextlib import nullcontext

    from foresee_dsl.campaign.plan import plan_campaign
    from foresee_dsl.campaign.stages import Stages
    from foresee_dsl.campaign.storage.store import Store
    from foresee_dsl.documents import plain
    from foresee_dsl.language.project.loading import load_test_cases

    request = requested(ctx, paths, flags)
    cases = selected(load_test_cases(request.paths, allow_outside=flags.allow_outside), None, flags.only)
    cases, left_out = _chosen(cases, request, flags)
    folder, part = flags.store_folder, shard_of(flags.shard)
    stored = (folder / "runs.sqlite").is_file()
    with Store(folder, write=False) if stored else nullcontext() as store:
        stages = [Stages(cases, s, store, request.folder(s, flags.out), part) for s in request.settings]
        plans = [plan_campaign(stages_of_plan, store, jobs=flags.jobs) for stages_of_plan in stages]
        others = store.of_other_versions() if store is not None else 0
    of_each = list(zip(request.settings, plans, strict=True))

    def data() -> str:
        if len(plans) == 1:
            return json_document(plans[0])
        several = [
            {"driver": s.driver, "ranker": s.ranker, "schema": 1, **plain(campaign_plan)}
            for s, campaign_plan in of_each
        ]
        return json_document({"plans": several}, "plans")

    def people(screen: Console) -> None:
        empty = bool(part.text) and not any(stages_of_plan.seeds for stages_of_plan in stages)
        if empty:
            screen.print(f"--shard {part.text}: {part.empty_text}")
        for settings, campaign_plan in of_each if not empty else ():
            if len(plans) > 1:
                screen.print(f"{settings.driver}, {settings.ranker}", style="bold")
            _print_plan(campaign_plan, folder, stored=stored)
        for note in left_out:
            screen.print(note, markup=False)
        if others:
            screen.print(of_other_versions(folder, others))

    def dot() -> str:
        return "".join(f"{campaign_plan.as_dot()}\n" for campaign_plan in plans)

    report_results(format, CommandReport("plan", data, forms={"dot": dot}), people=people)


def _print_plan(campaign_plan: CampaignPlan, folder: Path, *, stored: bool) -> None:
    from foresee_dsl.report.terminal.tables import duration, plain_table

    screen = console()
    rows = [
        (stage.step.title, stage.done, stage.to_run, stage.at_most,
         f"{stage.each_s:.2f} s" + ("" if stage.measured else " (usual)"))
        for stage in campaign_plan.stages
    ]  # fmt: skip
    screen.print(plain_table(("stage", "done", "to run", "at most more", "each"), rows))
    if campaign_plan.allocation is not None:
        screen.print(campaign_plan.allocation.sentence)
    to_run, more = campaign_plan.runs_to_do
    if not to_run + more:
        screen.print(f"All results are in {folder} already: nothing is left to run.")
        return
    screen.print(counted(to_run, "run") + (f", and at most {more} that follow from them" if more else ""))
    means = (
        "by the times in the store"
        if campaign_plan.measured
        else "by usual times, as the store has none of some stages"
    )
    on = counted(campaign_plan.jobs, "worker")
    screen.print(f"about {duration(campaign_plan.estimated_s)} on {on}, {means}")
    if not stored:
        screen.print(f"There is no store in {folder} yet.")
