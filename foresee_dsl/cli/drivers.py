"""Commands that put drivers to the test: `conform` checks whether a driver keeps the rules of the driver protocol, and
`assess` runs test cases with one or several drivers, without searching for failures.
"""

from __future__ import annotations

from typing import Annotated

import typer

from foresee_dsl.campaign.workers import CPUS
from foresee_dsl.cli.completion import case_addresses, drivers
from foresee_dsl.cli.options import common
from foresee_dsl.cli.options.campaign_options import Jobs
from foresee_dsl.cli.options.output import FormatOption, JunitOption, report_results
from foresee_dsl.language.campaign_values import RULES_MODE
from foresee_dsl.report.formats import CommandReport


def conform(
    driver: Annotated[
        str,
        typer.Argument(metavar="DRIVER", help="A driver, as for `--driver` of other commands.", autocompletion=drivers),
    ],
    jobs: Annotated[int, common.jobs_option("Number of processes.")] = 2,
    seed: common.SeedOption = 0,
    step_deadline: common.StepDeadlineOption = None,
    format_: FormatOption = "text",
    junit: JunitOption = None,
    exit_zero: common.ExitZeroOption = False,
) -> None:
    """Check a driver from outside: determinism, reset, ranges, units, times, what it leaves behind, and ten test cases.

    Exit code 1 when a check or a test case failed; each failed check says what to do.

    [dim]foresee conform pdm
    foresee conform "external:python3 my_driver.py" --json[/dim]
    """
    from foresee_dsl.campaign.conformance.suite import conform as examine
    from foresee_dsl.drivers.consent import allow
    from foresee_dsl.drivers.deadlines import Deadlines
    from foresee_dsl.report.builds.case_results import of_conformance
    from foresee_dsl.report.terminal.drivers import print_conformance, tasks_progress

    allow(driver)  # the argument is a driver, never a file: naming a program here is consent, as with `--driver`
    with tasks_progress(common.console(error=True)) as done:
        conformance = examine(driver, seed=seed, jobs=jobs, deadlines=Deadlines(step_deadline), on_task=done)
    report_results(
        format_,
        CommandReport(
            "conform",
            lambda: common.json_document(conformance),
            lambda: of_conformance(conformance),
            properties=(("driver", driver), ("seed", str(seed))),
        ),
        people=lambda screen: print_conformance(screen, conformance),
        junit=junit,
    )
    if not exit_zero and not conformance.conforms:
        raise typer.Exit(common.FAILED)


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
    seed: common.SeedOption = 0,
    first: common.FirstOption = None,
    only: common.OnlyOption = None,
    fail_fast: common.FailFastOption = False,
    rules: common.RulesOption = RULES_MODE,
    step_deadline: common.StepDeadlineOption = None,
    deadline: common.DeadlineOption = None,
    show: Annotated[
        bool, typer.Option("--failures", help="Also list the runs in which the ego did not arrive.")
    ] = False,
    format_: FormatOption = "text",
    junit: JunitOption = None,
    exit_zero: common.ExitZeroOption = False,
    allow_outside: common.AllowOutsideOption = False,
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

    names = list(dict.fromkeys(driver or ["pdm"]))
    for name in names:
        find_driver(name)  # an unknown name is reported before anything runs
    cases = common.selected(load_test_cases(paths, allow_outside=allow_outside), first, only)
    total = len(cases) * len(names)
    with runs_progress(common.console(error=True), total) as done:
        runs = assess_drivers(
            cases, names, jobs=jobs, seed=seed, on_run=done, deadlines=Deadlines(step_deadline, deadline),
            rules=rules, fail_fast=fail_fast,
        )  # fmt: skip
    report_results(
        format_,
        CommandReport(
            "assess",
            lambda: common.json_document(Assessment(runs, seed)),
            lambda: of_assessment(runs, seed),
            properties=[("driver", name) for name in names],
        ),
        people=lambda screen: print_assessment(screen, runs, failures=show, of=total),
        junit=junit,
    )
    if not exit_zero and not all(run.passed for run in runs):
        raise typer.Exit(common.FAILED)
