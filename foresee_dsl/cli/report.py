"""Commands that write pages and reports: `report` for a finished campaign, `view` for one file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foresee_dsl.cli.findings import CampaignOption, check_campaign
from foresee_dsl.cli.options.common import CALL, AllowOutsideOption, json_document
from foresee_dsl.cli.options.output import format_option, report_results
from foresee_dsl.language.campaign_values import SEED
from foresee_dsl.report.formats import CommandReport


def report(
    out: Annotated[Path, typer.Argument(metavar="OUT", help="A finished campaign's folder.")] = Path("out"),
    format: Annotated[
        str,
        format_option(
            "html: a page with playback (OUT/report.html); markdown: for a pull request (OUT/report.md, with "
            "pictures beside it); text: for a terminal; json: for tools.",
            "html",
            "markdown",
            "text",
            "json",
        ),
    ] = "html",
    reasons: Annotated[
        bool, typer.Option("--reasons", help="html: drive the failing runs again, for the driver's own reasons.")
    ] = False,
) -> None:
    """Write the report of a finished campaign; without --reasons, nothing is run again.

    The report notes files that are missing or were edited since.

    [dim]foresee report out
    foresee report out --format markdown --output review/report.md[/dim]
    """
    from foresee_dsl.campaign.written import campaign_folders

    folders, output = campaign_folders(out), CALL.get().output
    match format:
        case "html":
            from foresee_dsl.report.page.html import write_report

            file = output or out / "report.html"
            write_report(folders, file, reasons=reasons)
            typer.echo(str(file))
        case "markdown":
            from foresee_dsl.report.page.markdown import write_markdown

            file = output or out / "report.md"
            write_markdown(folders, file)
            typer.echo(str(file))
        case _:
            from foresee_dsl.report.page.contents import contents_of
            from foresee_dsl.report.page.markdown import as_text
            from foresee_dsl.report.page.runs import Reader

            contents = contents_of(folders, Reader(plays=False))
            report_results(
                format,
                CommandReport("report", lambda: json_document(contents)),
                people=lambda _: typer.echo(as_text(contents), nl=False),
            )


def view(
    address: Annotated[
        str,
        typer.Argument(
            metavar="FILE[::CASE]|FINDING", help="A test case, clip, mutant, trace, or a finding's number or name."
        ),
    ],
    driver: Annotated[
        str,
        typer.Option("--driver", help="The driver that runs it; by default the recorded one, otherwise pdm."),
    ] = "",
    seed: Annotated[
        int | None,
        typer.Option("--seed", min=SEED[0], max=SEED[1], help="The seed; by default the recorded one, otherwise 0."),
    ] = None,
    campaign: CampaignOption = Path("out"),
    output: Annotated[
        Path | None, typer.Option("--output", metavar="FILE", help="The page's file; by default out/view/NAME.html.")
    ] = None,
    open_: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Write a page with playback of one file: a test case, clip or mutant is run first; a trace is shown unchanged.

    [dim]foresee view scenarios/scenario7.foresee::r01 --open
    foresee view out/children/scenario7/red_light_runner_r02_p1_m3.foresee
    foresee view red_light_runner_r02_p1_m3 --campaign out
    foresee view runs/red_light_runner_r01.npz --output page.html[/dim]
    """
    from foresee_dsl.campaign.findings.named_failure import find_failure
    from foresee_dsl.language.project.addresses import is_file
    from foresee_dsl.report.page.single import write_view

    check_campaign(campaign, address)
    failure = None
    if not is_file(Path(address.partition("::")[0])) and is_file(campaign / "campaign.json"):
        failure = find_failure(address, campaign, tests=True)
        address = str(failure.file)

    def say(note: str) -> None:
        typer.echo(note, err=True)

    file = write_view(address, output, driver=driver, seed=seed, failure=failure, allow_outside=allow_outside, say=say)
    typer.echo(str(file))
    if open_:
        import webbrowser

        webbrowser.open(file.absolute().as_uri())
