"""The command `sure`: how sure a failure is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foresee_dsl.cli.minimise import CampaignOption
from foresee_dsl.cli.options.common import JsonOption, console, print_json


def sure(
    finding: Annotated[
        str,
        typer.Argument(metavar="FINDING|MUTANT|TEST_CASE", help="A finding's number or name, a file, or FILE::CASE."),
    ],
    campaign: CampaignOption = Path("out"),
    driver: Annotated[str, typer.Option("--driver", help="Drive with this driver instead of the recorded one.")] = "",
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Seed, instead of the recorded one.")] = None,
    jobs: Annotated[int, typer.Option("--jobs", min=1, max=512, help="Number of processes.")] = 1,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for the failing region as a scenario that draws cases in it.")
    ] = None,
    run_programs: Annotated[
        bool, typer.Option("--run-programs", help="Start the program that the file records as an external driver.")
    ] = False,
    json: JsonOption = False,
) -> None:
    """Say how sure a failure is: the share of 20 sensor seeds that fail, the smallest change of each changed value at
    which it passes, a map over the two changes that matter most, and the failing region as a `require` line.

    It takes some 120 runs of the finding. The result is kept beside the campaign, where the page and `review` show it.

    [dim]foresee sure 3
    foresee sure 3 --jobs 2 --out region[/dim]
    """
    from foresee_dsl.campaign.findings.diagnosing import failing_named
    from foresee_dsl.campaign.findings.sure import how_sure
    from foresee_dsl.campaign.findings.sureness import keep_sureness
    from foresee_dsl.errors import ForeseeError
    from foresee_dsl.report.terminal.live import bars
    from foresee_dsl.report.terminal.review import sureness_text

    failing = failing_named(finding, campaign, driver=driver, seed=seed, run_programs=run_programs)
    with bars(console(error=True)) as progress:
        task = progress.add_task("runs", total=None)
        result = how_sure(failing, jobs, lambda done, of: progress.update(task, completed=done, total=of), out)
    if failing.campaign is not None:
        keep_sureness(failing.campaign, result)
    if out is not None and result.region is None:
        raise ForeseeError(f"nothing is written to {out}: {result.note}")
    if json:
        print_json(result)
    else:
        typer.echo(sureness_text(result), nl=False)
