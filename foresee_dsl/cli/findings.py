"""Commands for a single finding: `minimise`, `review`, `diagnose` and `sure`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.options.common import AllowOutsideOption, JsonOption, console, jobs_option, print_json

if TYPE_CHECKING:
    from foresee_dsl.campaign.records import Minimised
    from foresee_dsl.campaign.written import WrittenCampaign

FindingArgument = Annotated[
    str, typer.Argument(metavar="FINDING|MUTANT", help="A finding's number or name, or a mutant's file.")
]
CampaignOption = Annotated[
    Path, typer.Option("--campaign", help="The campaign's folder, in which findings are looked up.")
]
OtherDriverOption = Annotated[str, typer.Option("--driver", help="Drive with this driver instead of the recorded one.")]
_RunProgramsOption = Annotated[
    bool, typer.Option("--run-programs", help="Start the program that the file records as an external driver.")
]


def minimise(
    finding: FindingArgument,
    campaign: CampaignOption = Path("out"),
    out: Annotated[
        Path | None,
        typer.Option("--out", help="The folder to write into; by default minimised/NAME."),
    ] = None,
    full: Annotated[
        bool, typer.Option("--full", help="Write the finding in its original form, without minimising it.")
    ] = False,
    budget: Annotated[int, typer.Option(min=1, max=100_000, help="Maximum number of runs.")] = 60,
    driver: OtherDriverOption = "",
    run_programs: _RunProgramsOption = False,
    store: Annotated[
        Path | None, typer.Option("--store", help="Folder in which results are stored; by default the campaign's.")
    ] = None,
    json: JsonOption = False,
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Make a failing mutant as small as its failure allows.

    Changes and actors that the failure does not need are left out, changed numbers move back towards the original
    values as far as it still fails, and the clip is shortened; the same failure with the same actor remains.
    A campaign does this for each finding. Repeating the command runs nothing again.

    [dim]foresee minimise red_light_runner_r02_p1_m3
    foresee minimise out/children/scenario7/red_light_runner_r02_p1_m3.foresee --out smaller
    foresee minimise red_light_runner_r02_p1_m3 --full --out as_found[/dim]
    """
    from foresee_dsl.campaign.findings.minimise_file import Texts, minimise_file
    from foresee_dsl.campaign.findings.named_failure import find_failure

    check_campaign(campaign, finding)
    wanted = find_failure(finding, campaign)
    folder = out or Path("minimised") / wanted.name
    if full:
        files = Texts.unreduced(wanted, allow_outside=allow_outside).write(folder)
        if json:
            print_json({"mutant": wanted.file, "full": True, "files": files})
        else:
            typer.echo("\n".join(str(file) for file in files))
        return
    minimised, parent, runs = minimise_file(
        wanted, store, driver=driver, budget=budget, run_programs=run_programs, allow_outside=allow_outside
    )
    files = Texts.of(minimised, parent).write(folder)
    if json:
        from foresee_dsl.documents import plain

        small = {name: value for name, value in plain(minimised).items() if name not in ("file", "clip")}
        print_json({"mutant": wanted.file, "full": False, "files": files, "runs_now": runs, **small})
    else:
        _print_minimised(minimised, runs, files)


def _print_minimised(minimised: Minimised, runs: int, files: tuple[Path, Path]) -> None:
    screen = console()
    effort = "the result was in the store, so nothing was run" if not runs else f"{runs} runs"
    screen.print(f"{minimised.child.name}: {minimised.child.reason}", soft_wrap=True, markup=False)
    for change in minimised.child.changes:
        screen.print(f"  change {change}", soft_wrap=True, markup=False)
    left_out = minimised.dropped.text
    screen.print(f"  left out: {left_out or 'nothing'} ({effort})", soft_wrap=True, markup=False)
    for edge in minimised.boundaries:
        screen.print(f"  {edge.sentence}", soft_wrap=True, markup=False)
    if minimised.note:
        screen.print(f"  {minimised.note}", soft_wrap=True, markup=False)
    for file in files:
        screen.print(str(file), soft_wrap=True, markup=False)


def review(
    finding: Annotated[
        str | None, typer.Argument(metavar="FINDING|MUTANT", help="A finding's number or name; without it, list all.")
    ] = None,
    campaign: CampaignOption = Path("out"),
    json: JsonOption = False,
) -> None:
    """Show a finding for review: whose failure it is and why, the smallest difference, the failure boundary, what the
    driver withstood. Without a finding, list all of the campaign.

    [dim]foresee review 3
    foresee review red_light_runner_r02_p1_m3 --campaign nightly --json[/dim]
    """
    from foresee_dsl.campaign.findings.named_failure import find_failure
    from foresee_dsl.campaign.findings.review import review_of

    if finding is None:
        _list_findings(campaign, json=json)
        return
    check_campaign(campaign, finding)
    finding_review = review_of(find_failure(finding, campaign, tests=True))
    if json:
        print_json(finding_review)
        return
    from foresee_dsl.report.terminal.review import review_text

    typer.echo(review_text(finding_review), nl=False)


def check_campaign(folder: Path, *wanted: str) -> None:
    """Raise `ForeseeError` if a folder, in which the findings `wanted` are looked up, holds the campaigns of several
    drivers or rankers instead of one campaign. Files are not looked up in it.
    """
    from foresee_dsl.campaign.written import JSON, campaign_folders
    from foresee_dsl.errors import ForeseeError
    from foresee_dsl.language.project.addresses import is_file

    by_name = not wanted or not all(is_file(Path(name.partition("::")[0])) for name in wanted)
    if by_name and not is_file(folder / JSON) and any(folder.glob(f"*/{JSON}")):
        below = ", ".join(map(str, campaign_folders(folder)))
        raise ForeseeError(f"{folder} holds several campaigns, each in a folder of its own: name one of {below}")


def written_campaign(campaign: Path) -> WrittenCampaign:
    """Return the campaign in a folder.

    Raises:
        ForeseeError: the folder does not hold a campaign.
    """
    from foresee_dsl.campaign.written import JSON, read_campaign_file
    from foresee_dsl.errors import ForeseeError

    check_campaign(campaign)
    written = read_campaign_file(campaign / JSON)
    if written is None:
        raise ForeseeError(f"there is no campaign in {campaign}: `foresee campaign PATH --out {campaign}` runs one, "
                           "`--campaign OUT` names another folder")  # fmt: skip
    return written


def _list_findings(campaign: Path, *, json: bool) -> None:
    from foresee_dsl.campaign.triage.standing import standing_of_written
    from foresee_dsl.report.terminal.campaign import print_findings

    written = written_campaign(campaign)
    standing = standing_of_written(written)
    if json:
        print_json({"findings": written.grouped, "standing": standing})
    else:
        print_findings(console(), written, standing)


def diagnose(
    finding: Annotated[
        str | None,
        typer.Argument(metavar="FINDING|MUTANT|TEST_CASE", help="A finding's number or name, a file, or FILE::CASE."),
    ] = None,
    campaign: CampaignOption = Path("out"),
    every: Annotated[
        bool,
        typer.Option(
            "--all", help="Diagnose all findings of the campaign, and count how often each part is the cause."
        ),
    ] = False,
    driver: OtherDriverOption = "",
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Seed to use instead of the recorded one.")] = None,
    jobs: Annotated[int, jobs_option("Number of processes for `--all`.")] = 1,
    run_programs: _RunProgramsOption = False,
    json: JsonOption = False,
) -> None:
    """Say which part of the driver causes a failure: drive it again with ideal perception, tracking, prediction, rules
    or control. The result is kept beside the campaign, where the page and `review` show it.

    [dim]foresee diagnose 3
    foresee diagnose --all --campaign nightly --jobs 2
    foresee diagnose scenarios/scenario7.foresee::r04 --driver idm[/dim]
    """
    from foresee_dsl.campaign.findings.diagnosing import all_failing, failing_named
    from foresee_dsl.campaign.findings.diagnosing import diagnose as run_diagnoses
    from foresee_dsl.errors import ForeseeError
    from foresee_dsl.report.terminal.review import counts_text, diagnosis_text

    if every == (finding is not None):
        raise typer.BadParameter("name one finding, or write --all", param_hint="FINDING")
    check_campaign(campaign, *([finding] if finding is not None else []))
    if finding is None:
        failures = all_failing(campaign, driver=driver, run_programs=run_programs)
    else:
        failures = [failing_named(finding, campaign, driver=driver, seed=seed, run_programs=run_programs)]
    results = []
    for result in run_diagnoses(failures, jobs):
        if result.diagnosis is None and not every:
            raise ForeseeError(f"{result.name} is not diagnosed: {result.note}")
        results.append(result)
        if not json:
            typer.echo(diagnosis_text(result, short=every), nl=False)
    if json:
        print_json({"diagnoses": results})
    elif every:
        typer.echo(counts_text(results), nl=False)


def sure(
    finding: Annotated[
        str,
        typer.Argument(metavar="FINDING|MUTANT|TEST_CASE", help="A finding's number or name, a file, or FILE::CASE."),
    ],
    campaign: CampaignOption = Path("out"),
    driver: OtherDriverOption = "",
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Seed to use instead of the recorded one.")] = None,
    jobs: Annotated[int, jobs_option("Number of processes.")] = 1,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for the failing region as a scenario that draws cases in it.")
    ] = None,
    run_programs: _RunProgramsOption = False,
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

    check_campaign(campaign, finding)
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
