"""The command `show`: shows a run as story, timeline and pictures, or step by step with what the driver saw and why it
waited."""

from __future__ import annotations

import math
import os
import sys
from contextlib import nullcontext
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.findings import check_campaign
from foresee_dsl.cli.options import common
from foresee_dsl.cli.options.common import WIDEST
from foresee_dsl.language.campaign_values import SEED

if TYPE_CHECKING:
    from rich.console import Console

    from foresee_dsl.report.show.page import Page
    from foresee_dsl.report.show.panels import Strip
    from foresee_dsl.report.show.sources import RunRequest, ShownRun

_BOTH_WIDE = 110
"""Width of the terminal, in columns, from which two moments of a mutant and two of its parent fit side by side."""


class Picture(StrEnum):
    """How a picture is shown in the terminal."""

    AUTO = "auto"
    NONE = "none"
    KITTY = "kitty"
    SIXEL = "sixel"
    ITERM = "iterm"


class UpSide(StrEnum):
    """Direction that points up in the pictures."""

    EGO = "ego"
    NORTH = "north"


def show(
    targets: Annotated[
        list[str],
        typer.Argument(
            metavar="ADDRESS|TRACE|MUTANT|FINDING",
            help="FILE::CASE, a clip, a mutant, a trace (.npz), or a finding's number or name in --campaign.",
        ),
    ],
    driver: Annotated[
        str,
        typer.Option("--driver", help="The driver; by default the recorded one (mutant, finding), otherwise pdm."),
    ] = "",
    seed: Annotated[
        int | None,
        typer.Option("--seed", min=SEED[0], max=SEED[1], help="The seed; by default the recorded one, otherwise 0."),
    ] = None,
    campaign: Annotated[
        Path,
        typer.Option(
            "--campaign", metavar="OUT", help="A campaign's folder, in which findings and traces are looked up."
        ),
    ] = Path("out"),
    picture: Annotated[
        Picture,
        typer.Option(
            "--picture", help="How the strip is shown: as a picture if the terminal can show one; none: as characters."
        ),
    ] = Picture.AUTO,
    up: Annotated[
        UpSide, typer.Option("--up", help="Direction at the top of the strip: the ego's heading, or north.")
    ] = UpSide.EGO,
    moments: Annotated[
        int | None,
        typer.Option(
            "--moments",
            min=1,
            max=12,
            help="Maximum number of pictures; by default 6, for a mutant on a narrow terminal 4.",
        ),
    ] = None,
    png: Annotated[Path | None, typer.Option("--png", metavar="FILE", help="Write the strip to a PNG file.")] = None,
    svg: Annotated[Path | None, typer.Option("--svg", metavar="FILE", help="Write the strip to an SVG file.")] = None,
    gif: Annotated[
        Path | None,
        typer.Option("--gif", metavar="FILE", help="Write the seconds around the most critical moment as a film."),
    ] = None,
    criticality: Annotated[
        Path | None,
        typer.Option(
            "--criticality", metavar="FILE", help="Write the criticality of each step to a .csv or .json file."
        ),
    ] = None,
    actor: Annotated[
        str,
        typer.Option("--actor", metavar="ID", help="--criticality: the other actor; by default the story's opponent."),
    ] = "",
    states: Annotated[
        Path | None,
        typer.Option("--csv", metavar="FILE", help="Write places, headings and speeds of all actors to a .csv file."),
    ] = None,
    step: Annotated[
        bool,
        typer.Option(
            "--step",
            help="Step through the run by keys: what the driver saw and answered, and why; in a pipe, print all steps.",
        ),
    ] = False,
    from_s: Annotated[
        float | None, typer.Option("--from", min=0, help="With --step or --gif: time of the first step, in seconds.")
    ] = None,
    to_s: Annotated[
        float | None, typer.Option("--to", min=0, help="With --step or --gif: time of the last step, in seconds.")
    ] = None,
    every_s: Annotated[
        float | None,
        typer.Option(
            "--every", min=0.05, help="With --step: seconds between steps; by default 0.05 with keys, 0.5 in a pipe."
        ),
    ] = None,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Simulate again, even if a campaign has the trace of the same run.")
    ] = False,
    full: Annotated[
        bool, typer.Option("--full", help="Show a finding in its original form, not the minimised one.")
    ] = False,
    allow_outside: common.AllowOutsideOption = False,
) -> None:
    """Show what happens in a run: sentences with times, a timeline, and the important moments from above.

    A mutant is shown beside its parent: from which moment they differ, and how. With --step, each step is shown with
    what the driver saw and why it waited.

    [dim]foresee show scenarios/scenario7.foresee::r01
    foresee show out/children/scenario7/red_light_runner_r02_p1_m3.foresee
    foresee show red_light_runner_r02_p1_m3 --campaign out --svg strip.svg
    foresee show red_light_runner_r02_p1_m3 --step --from 2 --to 3
    foresee show 3 --gif finding.gif --criticality finding.csv[/dim]
    """
    from foresee_dsl.report.show.sources import RunRequest, find

    check_campaign(campaign, *targets)
    _one_file(targets, png, svg, gif, criticality, states)
    request = RunRequest(driver, seed, campaign, allow_outside, fresh, full)
    console = _console()
    for number, target in enumerate(targets):
        if number:
            console.print()
        run = find(target, request)
        page = _page(run, request, up, moments, console.width)
        for file in (png, svg):
            if file is not None:
                _write(file, page.strips, page.run.story.sentence, as_png=file is png)
        if criticality is not None:
            from foresee_dsl.report.show.series import write_criticality

            write_criticality(run, criticality, actor)
        if states is not None:
            from foresee_dsl.report.show.series import write_states

            write_states(run.trace, states)
        if gif is not None:
            from foresee_dsl.files import write_whole
            from foresee_dsl.report.show.film import film

            write_whole(gif, film(run, from_s, to_s))
        if step:
            _walk(console, page, from_s or 0.0, math.inf if to_s is None else to_s, every_s)
        else:
            _print_page(console, page, picture)


def _one_file(targets: list[str], *files: Path | None) -> None:
    if len(targets) > 1 and any(file is not None for file in files):
        raise typer.BadParameter("a file can hold only one run: name a single run")


def _console() -> Console:
    """Return a console that writes no control codes if NO_COLOR is set or the output is a pipe."""
    from foresee_dsl.cli.options.plain_output import harmless_console

    plain = bool(os.environ.get("NO_COLOR"))
    return harmless_console(highlight=False, color_system=None if plain else "auto", soft_wrap=True)


def _page(run: ShownRun, request: RunRequest, up: UpSide, moments: int | None, width: int) -> Page:
    from foresee_dsl.report.show.moments import LEAST, MOST
    from foresee_dsl.report.show.page import Page
    from foresee_dsl.report.show.sources import parent_of

    parent = parent_of(run, request, lambda note: typer.echo(note, err=True))
    most = LEAST if parent is not None and width < _BOTH_WIDE else MOST
    return Page(run, parent, "ego" if up is UpSide.EGO else "north", moments or most)


def _print_page(console: Console, page: Page, picture: Picture) -> None:
    width, wrap = min(console.width, WIDEST), console.is_terminal
    sent = _as_picture(page.strips, picture)
    for line in page.head(width, wrap=wrap) if sent else page.lines(width, wrap=wrap):
        console.print(line, soft_wrap=True)
    if sent:
        console.print()
        for line in page.timeline(width):
            console.print(line, soft_wrap=True)
        console.file.flush()
        console.file.write(sent)
        console.file.flush()
        for line in page.foot():
            console.print(line, soft_wrap=True)


def _walk(console: Console, page: Page, from_s: float, to_s: float, every_s: float | None) -> None:
    from foresee_dsl.report.show.steps import recorded_steps, step_lines
    from foresee_dsl.report.show.walk import RunWalk, walk
    from foresee_dsl.simulate.trace import STEP_S

    by_keys = console.is_terminal and sys.stdin.isatty() and os.name == "posix"
    with console.status("driving again ...") if by_keys else nullcontext():
        steps, same = recorded_steps(page.run, from_s, to_s, every_s or (STEP_S if by_keys else 0.5))
    if not same:
        typer.echo(
            "this run differs from the kept trace, because the driver has changed (`--fresh` shows the new run)",
            err=True,
        )
    if by_keys:
        walk(console, RunWalk(page, steps))
        return
    width = min(console.width, WIDEST)
    for line in page.head(width, wrap=False):
        console.print(line, soft_wrap=True)
    for run_step in steps:
        console.print()
        for line in step_lines(run_step, page.run.trace, page.strips[-1].opponent, width if console.is_terminal else 0):
            console.print(line, soft_wrap=True)


def _as_picture(strips: tuple[Strip, ...], picture: Picture) -> str:
    """Return the strips in the terminal's picture format; "" if it has none, or resvg-py is missing."""
    from foresee_dsl.errors import ForeseeError
    from foresee_dsl.report.show.terminal_pictures import Pictures, detect, encoded

    way = Pictures(picture.value)
    if way is Pictures.AUTO:
        way = Pictures.NONE if os.environ.get("NO_COLOR") else detect()
    if way is Pictures.NONE:
        return ""
    from foresee_dsl.report.drawing.svg import png_of_svg
    from foresee_dsl.report.show.strip import svg_of

    try:
        return encoded(png_of_svg(svg_of(strips, "", per_row=6), zoom=1.2), way)
    except ForeseeError:
        if picture is Picture.AUTO:
            return ""
        raise


def _write(file: Path, strips: tuple[Strip, ...], label: str, *, as_png: bool) -> None:
    from foresee_dsl.files import write_whole
    from foresee_dsl.report.drawing.svg import png_of_svg
    from foresee_dsl.report.show.strip import svg_of

    per_row = 3 if len(strips) == 1 else 6  # the moments of a mutant stand right below those of its parent
    svg = svg_of(strips, label, per_row=per_row)
    write_whole(file, png_of_svg(svg) if as_png else svg)
