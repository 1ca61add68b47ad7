"""Commands for one finding: minimise, review."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.options.common import AllowOutsideOption, JsonOption, console, print_json

if TYPE_CHECKING:
    from foresee_dsl.campaign.records import Minimised

Finding = Annotated[str, typer.Argument(metavar="FINDING|MUTANT", help="A finding's name, or a mutant's file.")]
CampaignOption = Annotated[Path, typer.Option("--campaign", help="The campaign's folder, where names are looked up.")]


def minimise(
    finding: Finding,
    campaign: CampaignOption = Path("out"),
    out: Annotated[
        Path | None,
        typer.Option("--out", help="The folder to write into; by default minimised/NAME."),
    ] = None,
    full: Annotated[bool, typer.Option("--full", help="Write it as it was found, with nothing left out.")] = False,
    budget: Annotated[int, typer.Option(min=1, max=100_000, help="Runs, at most.")] = 60,
    driver: Annotated[str, typer.Option("--driver", help="Another driver than the recorded one.")] = "",
    run_programs: Annotated[
        bool, typer.Option("--run-programs", help="Start the program that the file records as external driver.")
    ] = False,
    store: Annotated[
        Path | None, typer.Option("--store", help="Folder in which results are stored; by default the campaign's.")
    ] = None,
    json: JsonOption = False,
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Make a failing mutant as small as its failure allows.

    Changes and actors that the failure does not need are left out, its numbers brought as near to the original ones as
    still fails, its clip made shorter; the same failure with the same actor stays.

    A campaign does so for each finding. The same command again runs nothing.

    [dim]foresee minimise red_light_runner_r02_p1_m3
    foresee minimise out/children/scenario7/red_light_runner_r02_p1_m3.foresee --out smaller
    foresee minimise red_light_runner_r02_p1_m3 --full --out as_found[/dim]
    """
    from foresee_dsl.campaign.findings.asked import asked
    from foresee_dsl.campaign.findings.minimise_file import Texts, minimise_file

    wanted = asked(finding, campaign)
    folder = out or Path("minimised") / wanted.name
    if full:
        files = Texts.unreduced(wanted, allow_outside=allow_outside).write(folder)
        if json:
            print_json({"mutant": wanted.file, "full": True, "files": files})
        else:
            typer.echo("\n".join(str(file) for file in files))
        return
    found, parent, runs = minimise_file(
        wanted, store, driver=driver, budget=budget, run_programs=run_programs, allow_outside=allow_outside
    )
    files = Texts.of(found, parent).write(folder)
    if json:
        from foresee_dsl.documents import plain

        small = {name: value for name, value in plain(found).items() if name not in ("file", "clip")}
        print_json({"mutant": wanted.file, "full": False, "files": files, "runs_now": runs, **small})
    else:
        _print_minimised(found, runs, files)


def _print_minimised(found: Minimised, runs: int, files: tuple[Path, Path]) -> None:
    screen = console()
    took = "known from the store, nothing was run" if not runs else f"{runs} runs"
    screen.print(f"{found.child.name}: {found.child.reason}", soft_wrap=True, markup=False)
    for change in found.child.changes:
        screen.print(f"  change {change}", soft_wrap=True, markup=False)
    left_out = found.dropped.text
    screen.print(f"  left out: {left_out or 'nothing'} ({took})", soft_wrap=True, markup=False)
    for edge in found.boundaries:
        screen.print(f"  {edge.sentence}", soft_wrap=True, markup=False)
    if found.note:
        screen.print(f"  {found.note}", soft_wrap=True, markup=False)
    for file in files:
        screen.print(str(file), soft_wrap=True, markup=False)


def review(finding: Finding, campaign: CampaignOption = Path("out"), json: JsonOption = False) -> None:
    """Show a finding for review: what happens, the smallest difference, where it begins to fail, what was withstood.

    [dim]foresee review red_light_runner_r02_p1_m3
    foresee review red_light_runner_r02_p1_m3 --campaign nightly --json[/dim]
    """
    from foresee_dsl.campaign.findings.asked import asked
    from foresee_dsl.campaign.findings.review import review_of

    found = review_of(asked(finding, campaign, tests=True))
    if json:
        print_json(found)
        return
    from foresee_dsl.report.terminal.review import review_text

    typer.echo(review_text(found), nl=False)
