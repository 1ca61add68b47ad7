"""The command `conform`: checks whether a driver keeps the rules of the driver protocol."""

from __future__ import annotations

from typing import Annotated

import typer

from foresee_dsl.cli.completion import drivers
from foresee_dsl.cli.options import common
from foresee_dsl.cli.options.output import FormatOption, JunitOption, report_results
from foresee_dsl.report.formats import CommandReport


def conform(
    driver: Annotated[
        str,
        typer.Argument(metavar="DRIVER", help="A driver, as for `--driver` of other commands.", autocompletion=drivers),
    ],
    jobs: Annotated[int, typer.Option("--jobs", min=1, max=256, help="Number of processes.")] = 2,
    seed: common.SeedOption = 0,
    step_deadline: common.StepDeadlineOption = None,
    format_: FormatOption = "text",
    junit: JunitOption = None,
    exit_zero: common.ExitZeroOption = False,
    json: common.JsonOption = False,
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
        "json" if json else format_,
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
