"""Commands of a regression suite: keep failures in it, verify it with a driver, compare two drivers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foresee_dsl.cli.campaign_options import CPUS, Jobs
from foresee_dsl.cli.common import FAILED, JsonOption, json_document
from foresee_dsl.cli.output import FormatOption, JunitOption, ReportFormat, report_results

ExitZero = Annotated[bool, typer.Option("--exit-zero", help="Exit code 0 whatever was found: only the report counts.")]


def verify(
    paths: Annotated[
        list[Path], typer.Argument(metavar="PATH", help="Mutants and files with `expected` lines, or folders of them.")
    ],
    driver: Annotated[str, typer.Option("--driver", help="Another driver than the recorded one.")] = "",
    run_programs: Annotated[
        bool, typer.Option("--run-programs", help="Start the programs that files record as external drivers.")
    ] = False,
    update: Annotated[
        bool, typer.Option("--update", help="Write what is found as what is expected from now on, and exit with 0.")
    ] = False,
    exit_zero: ExitZero = False,
    jobs: Jobs = CPUS,
    format_: FormatOption = ReportFormat.text,
    junit: JunitOption = None,
    json: JsonOption = False,
) -> None:
    """Run test cases again and compare with what is expected: as expected, fixed, came back, changed, stale, new?

    Exit code 1 when something is not as expected, a test that passes now included: `--update` writes that down. A
    mutant without an `expected` line is expected to fail as its file records.

    [dim]foresee verify regressions --driver pdm
    foresee verify regressions --driver pdm --update
    foresee verify out/children[/dim]
    """
    from foresee_dsl.campaign.regression.expectations import Status
    from foresee_dsl.campaign.verify import as_dict, verify_files
    from foresee_dsl.campaign.verify import update as write_expected
    from foresee_dsl.report.case_results import of_rechecks
    from foresee_dsl.report.verification import print_verification

    rechecks = verify_files(paths, driver=driver, run_programs=run_programs, jobs=jobs)
    written = write_expected(rechecks) if update else None
    report_results(
        ReportFormat.json if json else format_,
        results=lambda: of_rechecks(rechecks, driver),
        data=lambda: json_document(as_dict(rechecks, written)),
        people=lambda screen: print_verification(screen, rechecks, written),
        junit=junit,
        properties=[("driver", driver or "as recorded")],
    )
    unsettled = [one for one in rechecks if not (update and one.status.can_be_recorded)]
    if not exit_zero and any(one.status is not Status.AS_EXPECTED for one in unsettled):
        raise typer.Exit(FAILED)
