"""Commands of a regression suite: `keep` adds failures to it, `verify` runs it with a driver, `compare` compares two
drivers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.campaign.workers import CPUS
from foresee_dsl.cli.findings import CampaignOption, OtherDriverOption, check_campaign
from foresee_dsl.cli.options.campaign_options import Jobs
from foresee_dsl.cli.options.common import (
    FAILED,
    DeadlineOption,
    ExitZeroOption,
    JsonOption,
    StepDeadlineOption,
    json_document,
    names_in,
    print_json,
)
from foresee_dsl.cli.options.output import ComparisonFormatOption, FormatOption, JunitOption, report_results
from foresee_dsl.report.formats import CommandReport

if TYPE_CHECKING:
    from foresee_dsl.campaign.regression.keeping import Report

PAIR = 2
"""Number of drivers or campaigns that a comparison has."""


def keep(
    what: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="FINDING|MUTANT", help="Findings by number or name, or mutants, clips, test cases (FILE::CASE)."
        ),
    ] = None,
    to: Annotated[Path, typer.Option("--to", help="Folder of the regression suite.")] = Path("regressions"),
    campaign: CampaignOption = Path("out"),
    as_: Annotated[
        str,
        typer.Option(
            "--as", metavar="NAME", help="Name of the test in the suite; possible only if a single test is kept."
        ),
    ] = "",
    full: Annotated[
        bool, typer.Option("--full", help="Keep a finding in its original form, not the minimised one.")
    ] = False,
    prune: Annotated[bool, typer.Option("--prune", help="Remove files that no test of the suite needs.")] = False,
    json: JsonOption = False,
) -> None:
    """Keep failures as regression tests: copy them and the files they need into a self-contained folder.

    Each test states the expected result of the driver; `foresee verify` checks it.
    The folder's README.md lists the tests. Keeping a test again changes nothing.

    [dim]foresee keep 3 --to regressions
    foresee keep out/children/behind_the_bus/behind_the_bus_commuter_p1_m1.foresee
    foresee keep --prune[/dim]
    """
    import re
    from dataclasses import replace

    from foresee_dsl.campaign.regression import keeping
    from foresee_dsl.campaign.regression.keeping import source_of
    from foresee_dsl.language.model import NAME_PATTERN

    wanted = list(dict.fromkeys(what or ()))
    if not wanted and not prune:
        raise typer.BadParameter(
            "name at least one finding, mutant or test case to keep, or write --prune", param_hint="FINDING|MUTANT"
        )
    if as_ and (len(wanted) != 1 or not re.fullmatch(NAME_PATTERN, as_)):
        raise typer.BadParameter(
            "it needs a name of small letters, digits and _, and a single test to keep", param_hint="--as"
        )
    report = keeping.Report()
    if wanted:
        check_campaign(campaign, *wanted)
        report = keeping.keep([source_of(name, campaign, full=full) for name in wanted], to, name=as_)
    removed = keeping.prune(to) if prune else ()
    if json:
        print_json(replace(report, removed=removed))
    else:
        _print_kept(report, removed)


def _print_kept(report: Report, removed: tuple[Path, ...]) -> None:
    for test in report.tests:
        how = " (minimised)" if test.new and test.minimised else ""
        typer.echo(f"{'kept' if test.new else 'kept already':<14}{test.file}{how}")
        if test.new and test.sentence:
            typer.echo(f"{'':<14}{test.sentence}")
    for file in report.parents:
        typer.echo(f"{'copied':<14}{file}")
    for note in report.notes:
        typer.echo(f"{'note':<14}{note}")
    for file in removed:
        typer.echo(f"{'removed':<14}{file}")
    if not report.tests and not removed:
        typer.echo("no file was removed, because every file is in use")


def verify(
    paths: Annotated[
        list[Path], typer.Argument(metavar="PATH", help="Mutants and files with `expected` lines, or folders of them.")
    ],
    driver: OtherDriverOption = "",
    run_programs: Annotated[
        bool, typer.Option("--run-programs", help="Start the programs that files record as external drivers.")
    ] = False,
    update: Annotated[
        bool, typer.Option("--update", help="Record today's results as the expected ones, and exit with 0.")
    ] = False,
    exit_zero: ExitZeroOption = False,
    step_deadline: StepDeadlineOption = None,
    deadline: DeadlineOption = None,
    jobs: Jobs = CPUS,
    format_: FormatOption = "text",
    junit: JunitOption = None,
) -> None:
    """Run test cases again and compare with the expected results: as expected, fixed, came back, changed, stale, new.

    Exit code 1 when a result is not as expected, even if a failure is gone.
    A mutant without an `expected` line is expected to fail as it did when it was found.

    [dim]foresee verify regressions --driver pdm
    foresee verify regressions --driver pdm --update
    foresee verify out/children[/dim]
    """
    from foresee_dsl.campaign.regression.expectations import Status
    from foresee_dsl.campaign.regression.verify import update as write_expected
    from foresee_dsl.campaign.regression.verify import verify_files
    from foresee_dsl.drivers.deadlines import Deadlines
    from foresee_dsl.report.builds.case_results import of_rechecks
    from foresee_dsl.report.terminal.comparison import print_verification

    deadlines = Deadlines(step_deadline, deadline)
    rechecks = verify_files(paths, driver=driver, run_programs=run_programs, jobs=jobs, deadlines=deadlines)
    written = write_expected(rechecks) if update else None
    report_results(
        format_,
        CommandReport(
            "verify",
            lambda: json_document(
                {
                    "ok": all(recheck.status is Status.AS_EXPECTED for recheck in rechecks),
                    "counts": {status: sum(recheck.status is status for recheck in rechecks) for status in Status},
                    "written": written or (),
                    "tests": rechecks,
                }
            ),
            lambda: of_rechecks(rechecks, driver),
            properties=[("driver", driver or "as recorded")],
        ),
        people=lambda screen: print_verification(screen, rechecks, written),
        junit=junit,
    )
    unsettled = [recheck for recheck in rechecks if not (update and recheck.status.can_be_recorded)]
    if not exit_zero and any(recheck.status is not Status.AS_EXPECTED for recheck in unsettled):
        raise typer.Exit(FAILED)


def compare(
    paths: Annotated[
        list[str],
        typer.Argument(
            metavar="BASE NEW | PATH", help="The folders of two campaigns; with --drivers, suites or scenarios to run."
        ),
    ],
    drivers: Annotated[
        str, typer.Option("--drivers", metavar="OLD,NEW", help="Run the test cases of PATH with these two drivers.")
    ] = "",
    format_: ComparisonFormatOption = "text",
    exit_zero: ExitZeroOption = False,
    step_deadline: StepDeadlineOption = None,
    deadline: DeadlineOption = None,
    jobs: Jobs = CPUS,
) -> None:
    """Compare two versions of a driver on the same test cases: new failures, fixed, still failing, nearer misses.

    Test cases and mutants are paired by their meaning. McNemar's exact test says whether chance alone explains the
    difference. Exit code 1 at new failures.

    [dim]foresee compare out_main out
    foresee compare --drivers pdm,mine regressions
    foresee compare out_main out --format markdown --output comment.md[/dim]
    """
    from foresee_dsl.campaign.regression.compared_sides import side_of_campaign, side_of_driver, tests_under
    from foresee_dsl.campaign.regression.comparison import OutcomeChange
    from foresee_dsl.campaign.regression.comparison import compare as paired
    from foresee_dsl.drivers.deadlines import Deadlines

    names = names_in(drivers)
    if drivers and len(names) != PAIR:
        raise typer.BadParameter(
            "it needs two drivers with a comma between them, such as --drivers pdm,mine", param_hint="--drivers"
        )
    if not drivers and len(paths) != PAIR:
        raise typer.BadParameter(
            "name the folders of two campaigns, or write --drivers OLD,NEW and name the test cases to run",
            param_hint="PATH",
        )
    if drivers:
        tests, deadlines = tests_under(paths), Deadlines(step_deadline, deadline)
        base, new = (side_of_driver(tests, name, jobs=jobs, deadlines=deadlines) for name in names)
    else:
        for path in paths:
            check_campaign(Path(path))
        base, new = (side_of_campaign(Path(path)) for path in paths)
    comparison = paired(base, new)
    from foresee_dsl.report.terminal.comparison import print_comparison, to_markdown

    report_results(
        format_,
        CommandReport(
            "compare", lambda: json_document(comparison), forms={"markdown": lambda: to_markdown(comparison)}
        ),
        people=lambda screen: print_comparison(screen, comparison),
    )
    if not exit_zero and comparison.of(OutcomeChange.NEW_FAILURE):
        raise typer.Exit(FAILED)
