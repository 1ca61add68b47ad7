"""The command `assess`: runs test cases with one or several drivers, without searching for failures."""

from __future__ import annotations

from typing import Annotated

import typer

from foresee_dsl.cli.completion import case_addresses
from foresee_dsl.cli.options import common
from foresee_dsl.cli.options.campaign_options import CPUS, Jobs
from foresee_dsl.cli.options.common import (
    FAILED,
    AllowOutsideOption,
    FailFastOption,
    FirstOption,
    JsonOption,
    OnlyOption,
    SeedOption,
    console,
    json_document,
    selected,
)
from foresee_dsl.cli.options.output import FormatOption, JunitOption, report_results
from foresee_dsl.language.campaign_values import RULES_MODE
from foresee_dsl.report.formats import CommandReport


def assess(
    paths: Annotated[
        list[str],
        typer.Argument(
            metavar="PATH", help="Scenario files, folders, or test cases (FILE::CASE).", autocompletion=case_addresses
        ),
    ],
    driver: Annotated[
        list[str] | None, typer.Option("--driver", help="A driver; repeat the option for several.")
    ] = None,
    jobs: Jobs = CPUS,
    seed: SeedOption = 0,
    first: FirstOption = None,
    only: OnlyOption = None,
    fail_fast: FailFastOption = False,
    rules: common.RulesOption = RULES_MODE,
    step_deadline: common.StepDeadlineOption = None,
    deadline: common.DeadlineOption = None,
    show: Annotated[
        bool, typer.Option("--failures", help="Also list the runs in which the ego did not arrive.")
    ] = False,
    format_: FormatOption = "text",
    junit: JunitOption = None,
    exit_zero: common.ExitZeroOption = False,
    json: JsonOption = False,
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Run test cases with one or several drivers and compare how often they arrive, how they fail, and how they drive.

    Exit code 1 when a run did not arrive, or broke an `expect` line.

    [dim]foresee assess scenarios --driver pdm --driver idm[/dim]
    """
    from foresee_dsl.campaign.assessment import Assessment, assess_drivers
    from foresee_dsl.drivers.deadlines import Deadlines
    from foresee_dsl.drivers.registry import find_driver
    from foresee_dsl.language.project.loading import load_test_cases
    from foresee_dsl.report.builds.case_results import of_assessment
    from foresee_dsl.report.terminal.drivers import print_assessment, runs_progress

    drivers = list(dict.fromkeys(driver or ["pdm"]))
    for name in drivers:
        find_driver(name)  # an unknown name is reported before anything runs
    cases = selected(load_test_cases(paths, allow_outside=allow_outside), first, only)
    form = "json" if json else format_
    total = len(cases) * len(drivers)
    with runs_progress(console(error=True), total) as done:
        runs = assess_drivers(
            cases, drivers, jobs=jobs, seed=seed, on_run=done, deadlines=Deadlines(step_deadline, deadline),
            rules=rules, fail_fast=fail_fast,
        )  # fmt: skip
    report_results(
        form,
        CommandReport(
            "assess",
            lambda: json_document(Assessment(runs, seed)),
            lambda: of_assessment(runs, seed),
            properties=[("driver", name) for name in drivers],
        ),
        people=lambda screen: print_assessment(screen, runs, failures=show, of=total),
        junit=junit,
    )
    if not exit_zero and not all(run.passed for run in runs):
        raise typer.Exit(FAILED)
