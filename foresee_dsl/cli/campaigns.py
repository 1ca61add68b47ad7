"""Commands for whole folders: campaign and verify."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from foresee_dsl.cli.common import (
    FAILED,
    AllowOutsideOption,
    DriverOption,
    HandoverOption,
    JsonOption,
    OutOption,
    PresetOption,
    RankerOption,
    SeedOption,
    console,
    print_json,
)

Jobs = Annotated[int, typer.Option("--jobs", min=1, max=256, help="Worker processes.")]
_CPUS = os.cpu_count() or 1


def campaign(
    paths: Annotated[
        list[str], typer.Argument(metavar="PATH", help="Scenario files, folders, or test cases (FILE::CASE).")
    ],
    driver: DriverOption = "pdm",
    ranker: RankerOption = "foresee",
    preset: PresetOption = "focused",
    before: Annotated[float, typer.Option(min=0.5, max=60, help="Seconds of a clip before its risky point.")] = 5.0,
    after: Annotated[float, typer.Option(min=0.5, max=60, help="Seconds of a clip after it.")] = 5.0,
    risky_points: Annotated[int, typer.Option(min=1, max=1000, help="Risky points of a run, at most.")] = 4,
    children: Annotated[int, typer.Option(min=0, max=1000, help="Mutated children of a clip.")] = 4,
    handover: HandoverOption = 0.0,
    jobs: Jobs = _CPUS,
    seed: SeedOption = 0,
    out: OutOption = Path("out"),
    report: Annotated[
        Path | None, typer.Option(help="Also save the report to this file: .svg, .html or .txt by its name.")
    ] = None,
    json: JsonOption = False,
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Run everything: test cases, forecasts, clips, mutants; keep what fails, and report.

    [dim]foresee campaign scenarios --jobs 2 --out out
    foresee campaign scenarios/scenario7.foresee::r02[/dim]
    """
    from foresee_dsl.campaign.engine import run_campaign
    from foresee_dsl.campaign.settings import CampaignSettings
    from foresee_dsl.derive.clip import DRIVES_S
    from foresee_dsl.derive.presets import preset as load_preset
    from foresee_dsl.drivers.registry import load_driver
    from foresee_dsl.forecast.registry import load_ranker
    from foresee_dsl.language.project import load_test_cases
    from foresee_dsl.report.terminal import CampaignProgress, print_campaign, save_campaign

    if report is not None and report.suffix not in (".svg", ".html", ".txt"):
        raise typer.BadParameter(f"{report} must end in .svg, .html or .txt", param_hint="--report")
    if handover > max(before - DRIVES_S, 0.0):
        message = f"it has to end {DRIVES_S:g} s before the risky point, so {before - DRIVES_S:g} s is the longest here"
        raise typer.BadParameter(message, param_hint="--handover")
    settings = CampaignSettings(
        driver, ranker, preset, before, after, risky_points, children, seed, handover_s=handover
    )
    # Unknown names are said before anything runs.
    load_driver(driver)
    load_ranker(ranker)
    load_preset(preset)
    cases = load_test_cases(paths, allow_outside=allow_outside)
    screen = console(error=json)
    with CampaignProgress(screen) as progress:
        result = run_campaign(cases, settings, out=out, jobs=jobs, listener=progress)
    if json:
        print_json(result.as_dict())
    else:
        print_campaign(screen, result, out)
    if report is not None:
        save_campaign(report, result, out)
    if result.interrupted:
        raise typer.Exit(130)
    if result.broken:
        raise typer.Exit(FAILED)


def verify(
    paths: Annotated[
        list[Path], typer.Argument(metavar="PATH", help="Recorded failures: mutants' files, or folders of them.")
    ],
    driver: Annotated[str, typer.Option("--driver", help="Another driver than the recorded one.")] = "",
    run_programs: Annotated[
        bool, typer.Option("--run-programs", help="Start the programs that files record as external drivers.")
    ] = False,
    jobs: Jobs = _CPUS,
    json: JsonOption = False,
) -> None:
    """Run recorded failures again: reproduced, fixed, changed, or stale (the parent was edited)?

    Exit code 1 when a failure is stale or changed: it no longer says what it said.

    [dim]foresee verify out/children
    foresee verify regressions --driver mine[/dim]
    """
    from foresee_dsl.campaign.verify import Status, as_dict, verify_files
    from foresee_dsl.language.project import recorded_children

    rechecks = verify_files(recorded_children(paths), driver=driver, run_programs=run_programs, jobs=jobs)
    if json:
        print_json(as_dict(rechecks))
    else:
        from foresee_dsl.report.terminal import print_verification

        print_verification(console(), rechecks)
    if any(r.status in (Status.STALE, Status.CHANGED) for r in rechecks):
        raise typer.Exit(FAILED)
