"""The command `study`: answers the paper's questions with campaigns of this tool."""

from __future__ import annotations

import sys
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.campaign.workers import CPUS
from foresee_dsl.cli.completion import case_addresses
from foresee_dsl.cli.options.campaign_options import (
    ExecutorOption,
    Jobs,
    LimitFlags,
    SchedulerOption,
    ShardOption,
    StoreOption,
    executor_of,
    notes_on,
    shard_of,
    with_flags,
)
from foresee_dsl.cli.options.common import (
    FAILED,
    AllowOutsideOption,
    OnlyOption,
    console,
    json_document,
    names_in,
    selected,
)
from foresee_dsl.cli.options.output import RecordFormatOption, report_results
from foresee_dsl.report.formats import CommandReport
from foresee_study.settings import StudySettings

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rich.console import Console

    from foresee_dsl.campaign.workers.pool import RunOptions
    from foresee_dsl.language.document import TestCase
    from foresee_study.folder import Cost, StudyFolder
    from foresee_study.halves import Half
    from foresee_study.running import Cases, StudyRun
    from foresee_study.tables.table import Table

ALL = "all"
REPORT = "report"


@with_flags
def study(
    question: Annotated[
        str,
        typer.Argument(
            metavar="QUESTION", help="rq1 to rq5 (several with commas), all of them, search, default, or report."
        ),
    ],
    paths: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[PATH]...",
            help="Scenario files, folders or test cases (default: the bundled ones). For report: the study's folder.",
            autocompletion=case_addresses,
        ),
    ] = None,
    *,
    out: Annotated[Path, typer.Option("--out", help="The study's folder.")] = Path("out/study"),
    store: StoreOption = None,
    settings: StudySettings,
    half: Annotated[
        str | None,
        typer.Option(
            metavar="HALF",
            help="Half of the test cases, by a hash of their names: even, odd or all. Settings were chosen on the even "
            "half; results are reported on the odd half, which is the default.",
            show_default=False,
        ),
    ] = None,
    cases: Annotated[
        int | None, typer.Option("--cases", min=1, help="Maximum number of test cases, spread over all families.")
    ] = None,
    only: OnlyOption = None,
    exhaustive: Annotated[
        str,
        typer.Option(
            metavar="D,R", help="Exhaustive search: R repetitions with each of the first D drivers; 0,0: none."
        ),
    ] = "1,1",
    fuzzing: Annotated[
        str,
        typer.Option(metavar="R,C,M", help="For rq4, DriveFuzz: R repetitions, C cycles, M mutations per cycle."),
    ] = "1,1,1",
    budget_hours: Annotated[
        float | None,
        typer.Option(
            min=0,
            help="For search: simulated hours of each search, by default 200 s for each test case.",
            show_default=False,
        ),
    ] = None,
    beside: Annotated[
        list[Path] | None,
        typer.Option(
            help="For search and default: folder of a study with rankers and exhaustive searches of the same preset; "
            "may be given several times; of equal campaigns the first one counts.",
        ),
    ] = None,
    towns: Annotated[
        list[Path] | None,
        typer.Option("--town", help="For rq5: a folder of test cases of another town; may be given several times."),
    ] = None,
    jobs: Jobs = CPUS,
    shard: ShardOption = "",
    executor: ExecutorOption = "local",
    scheduler: SchedulerOption = "",
    limits: LimitFlags,
    plan: Annotated[bool, typer.Option("--plan", help="Only show how many runs each question needs.")] = False,
    page: Annotated[Path | None, typer.Option(help="Also write the page of results to this file.")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress.")] = False,
    format_: RecordFormatOption = "text",
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Answer the paper's questions with this tool: run the campaigns, and write tables, figures and a page of results.

    All results are in one store: questions share their runs, and the same command continues a stopped study.

    [dim]foresee study rq2 --drivers pdm --repetitions 1 --jobs 2
    foresee study all --half all --plan
    foresee study report out/study --half odd[/dim]
    """
    from foresee_dsl.campaign.campaign_file import NOBODY
    from foresee_study.folder import StudyFolder
    from foresee_study.questions import PAPERS, QUESTIONS
    from foresee_study.settings import BUNDLED

    chosen = half_named(half)
    for other in beside or ():
        StudyFolder(other).read()  # before anything runs: a folder without a study is an error
    if question == REPORT:
        if len(paths or ()) > 1:
            raise typer.BadParameter("report takes one study's folder", param_hint="PATH")
        _report(StudyFolder(Path(paths[0]) if paths else out), chosen, page, beside, form=format_)
        return
    names = PAPERS if question == ALL else names_in(question)
    if not names or not set(names) <= set(QUESTIONS):
        choices = ", ".join((*QUESTIONS, ALL, REPORT))
        raise typer.BadParameter(f"{question!r} is not one of: {choices}", param_hint="QUESTION")
    exhaustive_drivers, exhaustive_repetitions = numbers_in(exhaustive, 2, "--exhaustive")
    fuzz_repetitions, cycles, mutations = numbers_in(fuzzing, 3, "--fuzzing")
    check_names(settings)
    settings = replace(
        settings,
        half=chosen or settings.half,
        first=cases,
        exhaustive_repetitions=exhaustive_repetitions,
        exhaustive_drivers=exhaustive_drivers,
        against=None if settings.against is None else tuple(name for name in settings.against if name != NOBODY),
        fuzz_repetitions=fuzz_repetitions,
        fuzz_cycles=cycles,
        fuzz_mutations=mutations,
        towns=tuple(town.name for town in towns or ()),
    )
    groups = {BUNDLED: cases_of(paths, settings, only, allow_outside=allow_outside)}
    if budget_hours is not None:
        settings = replace(settings, budget_s=round(budget_hours * 3600 / len(groups[BUNDLED]), 1))
    groups |= {town.name: town_cases(town, settings, allow_outside=allow_outside) for town in towns or ()}
    folder = StudyFolder(out)
    if plan:
        _plan(names, settings, groups, store or folder.store, form=format_, jobs=jobs)
        return
    from foresee_dsl.campaign.workers.pool import RunOptions
    from foresee_study.statistics.effects import lacks_statsmodels

    options = RunOptions(
        jobs=jobs,
        limits=limits.within(limits.budget),
        shard=shard_of(shard),
        retry=limits.retry,
        executor=executor_of(executor, scheduler),
    )
    screen = console(error=True)
    if lacking := lacks_statsmodels():
        screen.print(lacking, markup=False, soft_wrap=True)
    ran = _run(names, settings, groups, folder, store or folder.store, options, quiet=quiet)
    if ran.interrupted:
        screen.print(f"The same command continues from there; `foresee study report {out}` shows what there is.")
        raise typer.Exit(FAILED)
    if lacking:
        screen.print(lacking, markup=False, soft_wrap=True)
    elif options.shard.number:
        screen.print(f"Part {shard} is in the store; join the parts with `foresee store merge`, then ask again.")
    else:
        _report(folder, chosen, page, beside, form=format_, names=names)
    if ran.broken:
        raise typer.Exit(FAILED)


def _run(
    names: Sequence[str], settings: StudySettings, cases: Cases, folder: StudyFolder, store: Path, options: RunOptions,
    *, quiet: bool,
) -> StudyRun:  # fmt: skip
    """Run the questions, and print the notes on what is left out and the time of each; a signal ends the command with
    its exit code.
    """
    from foresee_dsl.campaign.storage.lock import only_writer
    from foresee_dsl.campaign.storage.store import Store
    from foresee_dsl.cli.options.stop_signal import StopSignal
    from foresee_dsl.compile import placement_mistakes
    from foresee_dsl.errors import InputError
    from foresee_dsl.report.terminal.live import progress
    from foresee_study.running import possible, run_study

    if mistakes := placement_mistakes([case for group in cases.values() for case in group]):
        raise InputError(mistakes)
    settings, notes = possible(settings)
    stop, screen = StopSignal(), console(error=True)

    def say(text: str) -> None:
        screen.print(text, markup=False, soft_wrap=True)

    for note in notes:
        say(note)
    with ExitStack() as stack:
        stack.enter_context(only_writer(folder.at))
        # Written early, so that the finished part of a study that is killed can be reported.
        folder.noted(settings, {}, notes)
        opened = stack.enter_context(Store(store))
        listeners, _ = progress(stack, screen, quiet=quiet, log=None)
        stack.enter_context(stop.listening())
        ran = run_study(names, settings, cases, folder, store=opened, listeners=listeners,
                        options=replace(options, stop=stop), say=(lambda _: None) if quiet else say)  # fmt: skip
        damage = notes_on(opened)
        folder.noted(settings, ran.costs, notes)
    for line in (*ran.broken, *damage):
        say(line)
    _print_took(screen, folder, ran.costs)
    if ran.interrupted and stop():
        say("The same command continues from there.")
        raise typer.Exit(stop.exit_code)
    return ran


def _report(
    folder: StudyFolder,
    half: Half | None,
    page: Path | None,
    beside: list[Path] | None,
    *,
    form: str,
    names: Sequence[str] = (),
) -> None:
    """Write all results of the study's folder, and print the tables of these questions (default: all)."""
    from foresee_study.folder import StudyFolder as Folder
    from foresee_study.report import write_report

    written = write_report(folder, half, page, [Folder(at) for at in beside or ()])
    selected_tables = [
        table for name, tables in written.tables.items() if name in (names or written.tables) for table in tables
    ]
    report_results(
        form,
        CommandReport("study", lambda: json_document({"tables": selected_tables}, "study")),
        people=lambda screen: _print_tables(screen, selected_tables),
    )
    screen = console(error=True)
    for note in written.notes:
        screen.print(note, markup=False, soft_wrap=True)
    screen.print(f"Tables: {folder.tables}, the page: {written.page}", markup=False, soft_wrap=True)


def _print_tables(screen: Console, tables: Sequence[Table]) -> None:
    from foresee_dsl.report.terminal.tables import plain_table

    wide = screen.width if screen.is_terminal else sys.maxsize
    for table in (part for whole in tables for part in whole.parts(wide)):
        rows = [(row.label, *table.texts(row)) for row in table.rows]
        screen.print(f"\n{table.title}", style="bold", markup=False)
        screen.print(plain_table((table.first, *table.stacked), rows, gap=1))
        for note in table.notes:
            screen.print(note, style="dim", markup=False)


def _plan(names: Sequence[str], settings: StudySettings, cases: Cases, store: Path, *, form: str, jobs: int) -> None:
    from foresee_dsl.campaign.storage.store import Store
    from foresee_dsl.report.terminal.tables import duration, plain_table
    from foresee_study.planning import plan_study
    from foresee_study.running import possible

    settings, notes = possible(settings)
    with Store(store, write=False) if (store / "runs.sqlite").is_file() else nullcontext() as opened:
        plans = plan_study(names, settings, cases, opened)

    def people(screen: Console) -> None:
        for note in notes:
            screen.print(note, markup=False)
        rows = [
            (p.question, p.campaigns, p.done, p.to_run, p.at_most_more, duration(p.one_core_s / jobs)) for p in plans
        ]
        heads = ("question", "campaigns", "runs done", "to run", "at most more", f"at most, {jobs} workers")
        screen.print(plain_table(heads, rows))
        screen.print(
            "Runs that an earlier question needs too are not counted again. "
            "Runs with reference drivers are not included."
        )

    report_results(form, CommandReport("study", lambda: json_document({"questions": plans}, "study")), people=people)


def _print_took(screen: Console, folder: StudyFolder, costs: dict[str, Cost]) -> None:
    from foresee_dsl.report.terminal.tables import duration

    for name, cost in costs.items():
        spent = "in parts" if cost.wall_s is None else duration(cost.wall_s)
        screen.print(f"{name}: {spent} with {cost.jobs} workers (in {folder.at})", markup=False)


# --- the meaning of the options
# -----------------------------------------------------------------------------------------


def check_names(settings: StudySettings) -> None:
    """Raise `BadParameter` for a preset or a search that there is not."""
    from foresee_dsl.derive.presets import UnknownPresetError, preset
    from foresee_study.search.searches import SEARCHES

    for name in settings.searches:
        one_of(SEARCHES, name, "--searches")
    try:
        for name in settings.readings:
            preset(name)
    except UnknownPresetError as err:
        raise typer.BadParameter(str(err), param_hint="--readings") from err


def half_named(text: str | None) -> Half | None:
    """Return the half with this name; None without a name."""
    from foresee_study.halves import Half

    return None if text is None else Half(one_of(Half, text, "--half"))


def one_of(names: Iterable[str], text: str, option: str) -> str:
    """Return a text that is one of these names; another one is wrong usage of the option."""
    if text not in (choices := list(names)):
        raise typer.BadParameter(f"{text!r} is not one of: {', '.join(choices)}", param_hint=option)
    return text


def numbers_in(text: str, count: int, option: str) -> list[int]:
    """Return `count` whole numbers, read from a text that separates them by commas."""
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != count or not all(part.isascii() and part.isdigit() for part in parts):
        raise typer.BadParameter(f"{text!r}: write {count} whole numbers, separated by commas", param_hint=option)
    return [int(part) for part in parts]


def cases_of(
    paths: list[str] | None, settings: StudySettings, only: list[str] | None, *, allow_outside: bool
) -> tuple[TestCase, ...]:
    """Return the test cases of a study: the test cases of its half, up to the maximum number."""
    from foresee_dsl.files import data_folder
    from foresee_dsl.language.project.loading import load_test_cases
    from foresee_study.halves import of_half, sample

    cases = load_test_cases(paths or [str(data_folder("scenarios"))], allow_outside=allow_outside)
    return sample(selected(of_half(cases, settings.half), None, only), settings.first)


def town_cases(folder: Path, settings: StudySettings, *, allow_outside: bool) -> tuple[TestCase, ...]:
    """Return the test cases of a town, of both halves, because no setting was chosen on them."""
    from foresee_dsl.language.project.loading import load_test_cases

    return tuple(load_test_cases([folder], allow_outside=allow_outside)[: settings.first])
