"""The command `draw`: draws a scene or a network from above, to a file or to a page that changes with the text."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.completion import case_addresses
from foresee_dsl.cli.options.common import FAILED, AllowOutsideOption

if TYPE_CHECKING:
    from foresee_dsl.report.picture.draw import Drawing


def draw(
    address: Annotated[
        str,
        typer.Argument(
            metavar="FILE[::CASE]",
            help="A scenario, case, clip, mutant or network (also .net.xml and .xodr); by default its first case.",
            autocompletion=case_addresses,
        ),
    ],
    svg: Annotated[
        Path | None,
        typer.Option(
            "--svg",
            metavar="FILE",
            help="The SVG file to write; by default NAME.svg in this folder; - prints the picture.",
        ),
    ] = None,
    png: Annotated[
        Path | None, typer.Option("--png", metavar="FILE", help="A PNG file to write (needs resvg-py).")
    ] = None,
    whole: Annotated[
        bool, typer.Option("--whole", help="Draw the whole network, not only the part around the actors.")
    ] = False,
    width: Annotated[
        int, typer.Option("--width", min=240, max=4000, help="Width in pixels; the size of letters does not change.")
    ] = 720,
    dark: Annotated[
        bool, typer.Option("--dark", help="Use dark colours in the PNG; an SVG follows its reader's setting.")
    ] = False,
    watch: Annotated[
        bool, typer.Option("--watch", help="Show the drawing on a local web page, and draw again on every save.")
    ] = False,
    port: Annotated[
        int,
        typer.Option(
            "--port", min=0, max=65535, help="With --watch: the local port of the page; 0 takes any free port."
        ),
    ] = 0,
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Draw the scene at its start: roads, signals, actors, their routes, trigger places. Nothing is simulated.

    [dim]foresee draw scenarios/scenario7.foresee::r01
    foresee draw scenarios/networks/town.foresee --png town.png
    foresee draw scenarios/scenario7.foresee --watch[/dim]
    """
    if watch:
        from foresee_dsl.report.picture.watch import watch as serve

        serve(address, svg=svg, whole=whole, port=port, allow_outside=allow_outside, say=_say)
        return
    from foresee_dsl.files import write_whole
    from foresee_dsl.report.drawing.svg import svg_of
    from foresee_dsl.report.picture.draw import draw as drawing_of

    drawing = drawing_of(address, width=float(width), whole=whole, allow_outside=allow_outside)
    if str(svg) == "-":
        typer.echo(svg_of(drawing.sheet), nl=False)
    elif svg is not None or png is None:
        file = svg or Path(f"{_stem(address, drawing)}.svg")
        write_whole(file, svg_of(drawing.sheet))
        _say(f"wrote {file}")
    if png is not None:
        from foresee_dsl.report.drawing.svg import png_of_svg

        write_whole(png, png_of_svg(svg_of(drawing.sheet, scheme="dark" if dark else "light")))
        _say(f"wrote {png}")
    if drawing.subject.mistakes:
        for number, mistake in enumerate(drawing.subject.mistakes, start=1):
            place = f"{mistake.text.path.name}:{mistake.text.line}: " if mistake.text is not None else ""
            _say(f"{number}: {place}{mistake.message}")
        raise typer.Exit(FAILED)


def _say(line: str) -> None:
    typer.echo(line, err=True)


def _stem(address: str, drawing: Drawing) -> str:
    name = Path(address.partition("::")[0]).name
    for suffix in (".foresee", ".net.xml", ".xodr"):
        name = name.removesuffix(suffix)
    return f"{name}_{drawing.subject.case}" if drawing.subject.case else name
