"""The command that fuzzes whole test cases."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foresee_dsl.campaign.workers import CPUS
from foresee_dsl.cli.completion import case_addresses
from foresee_dsl.cli.options import common
from foresee_dsl.cli.options.campaign_options import (
    Jobs,
    LimitFlags,
    ShardOption,
    StoreOption,
    notes_on,
    shard_of,
    with_flags,
)
from foresee_dsl.cli.options.common import FAILED, FirstOption, OnlyOption, console, selected
from foresee_dsl.cli.options.output import FormatOption, JunitOption, report_results
from foresee_dsl.cli.options.stop_signal import StopSignal
from foresee_dsl.report.formats import PEOPLE, CommandReport
from foresee_study.fuzz.settings import FuzzSettings

Cases = Annotated[
    list[str],
    typer.Argument(
        metavar="FILE[::CASE]...", help="Scenario files, folders, or test cases.", autocompletion=case_addresses
    ),
]


@with_flags
def fuzz(
    paths: Cases,
    *,
    out: Annotated[Path, typer.Option("--out", help="Folder for the results.")] = Path("fuzz"),
    settings: FuzzSettings,
    jobs: Jobs = CPUS,
    store: StoreOption = None,
    first: FirstOption = None,
    only: OnlyOption = None,
    shard: ShardOption = "",
    limits: LimitFlags,
    exit_zero: common.ExitZeroOption = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress.")] = False,
    format_: FormatOption = "text",
    junit: JunitOption = None,
    allow_outside: common.AllowOutsideOption = False,
) -> None:
    """Mutate whole test cases, cycle after cycle, until the driver fails (DriveFuzz); risky points are not used.

    Each mutation adds or moves an actor near the ego's start, changes the weather, or adds a slippery patch. The worst
    drive of a cycle is mutated in the next one. Exit code 1 when a test case failed, mutated or not.

    [dim]foresee fuzz scenarios/scenario7.foresee --out fuzz --jobs 2
    foresee fuzz scenarios/scenario7.foresee::r02 --cycles 3 --mutations 4[/dim]
    """
    from contextlib import ExitStack

    from foresee_dsl.campaign.storage.lock import only_writer
    from foresee_dsl.campaign.storage.store import Store
    from foresee_dsl.campaign.workers.pool import RunOptions
    from foresee_dsl.compile import placement_mistakes
    from foresee_dsl.drivers.registry import find_driver
    from foresee_dsl.errors import InputError
    from foresee_dsl.language.project.loading import load_test_cases
    from foresee_study.fuzz.engine import fuzz as run_fuzz
    from foresee_study.fuzz.folder import as_text, case_results
    from foresee_study.fuzz.terminal import FuzzProgress, print_fuzz
    from foresee_study.fuzz.texts import original_of

    find_driver(settings.driver)  # an unknown name must be reported before anything runs
    stop = StopSignal()
    options = RunOptions(
        jobs=jobs,
        limits=limits.within(limits.budget),
        shard=shard_of(shard),
        retry=limits.retry,
        stop=stop,
    )
    cases = selected(load_test_cases(paths, allow_outside=allow_outside), first, only)
    for case in cases:
        original_of(case)  # a test case that cannot be extended must be reported before there is a store
    if mistakes := placement_mistakes(cases):
        raise InputError(mistakes)
    with ExitStack() as stack:
        stack.enter_context(only_writer(out))
        kept = stack.enter_context(Store(store or out / "store"))
        listeners = [] if quiet else [stack.enter_context(FuzzProgress(console(error=True)))]
        stack.enter_context(stop.listening())
        result = run_fuzz(cases, settings, out=out, store=kept, listeners=listeners, options=options)
        notes = notes_on(kept)
    report_results(
        format_,
        CommandReport(
            "fuzz", lambda: as_text(result), lambda: case_results(result, out), properties=[("driver", settings.driver)]
        ),
        people=lambda screen: print_fuzz(screen, result, out),
        junit=junit,
    )
    screen = console(error=format_ not in PEOPLE)
    for note in notes:
        screen.print(note, markup=False)
    if result.interrupted:
        screen.print(f"{'' if stop() else 'The time budget is used up. '}The same command continues from there.")
        if stop():
            raise typer.Exit(stop.exit_code)
    if result.broken or not (exit_zero or result.all_passed):
        raise typer.Exit(FAILED)
