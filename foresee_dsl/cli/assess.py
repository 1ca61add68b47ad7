"""`foresee assess`: how drivers do on plain test cases, before anything is mutated."""

from __future__ import annotations

import os
from typing import Annotated

import typer

from foresee_dsl.cli.common import FAILED, AllowOutsideOption, JsonOption, SeedOption, console, print_json


def assess(
    paths: Annotated[
        list[str], typer.Argument(metavar="PATH", help="Scenario files, folders, or test cases (FILE::CASE).")
    ],
    driver: Annotated[list[str] | None, typer.Option("--driver", help="A driver; may be given several times.")] = None,
    jobs: Annotated[int, typer.Option("--jobs", min=1, max=256, help="Worker processes.")] = os.cpu_count() or 1,
    seed: SeedOption = 0,
    show: Annotated[bool, typer.Option("--failures", help="Also list the runs that did not arrive.")] = False,
    json: JsonOption = False,
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Run test cases with one or several drivers and compare: who arrives, who fails and how, how they drive.

    [dim]foresee assess scenarios --driver pdm --driver idm[/dim]
    """
    from foresee_dsl.campaign.assessment import assess_drivers
    from foresee_dsl.drivers.registry import load_driver
    from foresee_dsl.language.project.loading import load_test_cases
    from foresee_dsl.report.drivers import RunsProgress, as_dict, print_assessment

    drivers = list(dict.fromkeys(driver or ["pdm"]))
    for name in drivers:
        load_driver(name)  # an unknown name is said before anything runs
    cases = load_test_cases(paths, allow_outside=allow_outside)
    screen = console(error=json)
    with RunsProgress(screen, len(cases) * len(drivers)) as progress:
        runs, broken = assess_drivers(cases, drivers, jobs=jobs, seed=seed, told=progress.done)
    if json:
        print_json(as_dict(runs, broken, seed))
    else:
        print_assessment(screen, runs, broken, failures=show)
    if broken:
        raise typer.Exit(FAILED)
