"""The command `mine`: finds situations in recorded traffic, and writes them as test cases."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from foresee_dsl.cli.options.common import JsonOption, console, print_json

if TYPE_CHECKING:
    from foresee_recordings.mined import Mined, WrittenCase
    from foresee_recordings.mining.situation import Situation
    from foresee_recordings.mining.traffic import Traffic
    from foresee_recordings.recording import Recording

Others = Literal["follow", "drive", "diverge"]


def _list(wanted: bool) -> None:
    """Print the named situations and exit."""
    if not wanted:
        return
    from foresee_dsl.report.terminal.tables import plain_table
    from foresee_recordings.mining.named import SITUATIONS

    rows = ((name, named.what, named.condition) for name, named in SITUATIONS.items())
    console().print(plain_table(("situation", "what", "condition"), rows, align="<<<"))
    raise typer.Exit


def mine(
    recording: Annotated[
        Path, typer.Argument(metavar="RECORDING", help="A recording's file, or the folder of a data set.")
    ],
    find: Annotated[
        list[str] | None,
        typer.Option(
            "--find",
            metavar="CONDITION",
            help="A condition about `ego` and others, such as 'ttc(ego, other) < 1.5 s'; repeatable.",
        ),
    ] = None,
    situation: Annotated[
        list[str] | None,
        typer.Option(
            "--situation",
            metavar="NAME",
            help="A named situation, such as cut_in (see --list); repeatable. By default all but near_miss.",
        ),
    ] = None,
    from_s: Annotated[float | None, typer.Option("--from", help="First second of the recording to read.")] = None,
    to_s: Annotated[float | None, typer.Option("--to", help="Last second of the recording to read.")] = None,
    map_file: Annotated[
        Path | None, typer.Option("--map", metavar="FILE", help="The roads, if the recording does not hold them.")
    ] = None,
    reader: Annotated[
        str, typer.Option("--reader", metavar="NAME", help="Format of the recording; by default it is recognised.")
    ] = "",
    columns: Annotated[
        str, typer.Option("--columns", metavar="OURS=THEIRS,...", help="Names of a table's columns: time_s=t,x_m=x,...")
    ] = "",
    number: Annotated[
        list[str] | None,
        typer.Option("--number", metavar="NAME=NUMBER", help="A setting of the format, such as recording=3."),
    ] = None,
    ego: Annotated[
        str,
        typer.Option(
            "--ego",
            metavar="ID",
            help="Only situations of this ego; with --write, and without --find and --situation: one test case of all "
            "its seconds.",
        ),
    ] = "",
    within: Annotated[
        float, typer.Option("--within", min=1, max=1000, help="Actors farther from the ego, m, are not compared.")
    ] = 100.0,
    top: Annotated[int | None, typer.Option("--top", min=1, help="Only the most critical situations.")] = None,
    pictures: Annotated[
        Path | None, typer.Option("--pictures", metavar="DIR", help="Write a picture of each situation.")
    ] = None,
    png: Annotated[bool, typer.Option("--png", help="Pictures as PNG (needs resvg-py), not as SVG.")] = False,
    write: Annotated[
        Path | None, typer.Option("--write", metavar="DIR", help="Write each situation as a test case.")
    ] = None,
    before: Annotated[float, typer.Option("--before", min=0, max=60, help="Seconds before the moment.")] = 4.0,
    after: Annotated[float, typer.Option("--after", min=1, max=60, help="Seconds after the moment.")] = 6.0,
    radius: Annotated[
        float, typer.Option("--radius", min=5, max=1000, help="Actors that stay farther from the ego, m, are left out.")
    ] = 100.0,
    others: Annotated[
        Others,
        typer.Option(
            "--others",
            help="follow: others follow their tracks; drive: SUMO drives them from the beginning; diverge: they leave "
            "their tracks once the ego deviates from its own.",
        ),
    ] = "diverge",
    drive: Annotated[
        list[str] | None,
        typer.Option("--drive", metavar="ID", help="SUMO drives this actor from the beginning; repeatable."),
    ] = None,
    deviation: Annotated[
        float, typer.Option("--deviation", min=0.1, max=50, help="Deviation, m, at which others leave their tracks.")
    ] = 2.0,
    listed: Annotated[
        bool, typer.Option("--list", is_eager=True, callback=_list, help="List the named situations, and exit.")
    ] = False,
    json: JsonOption = False,
) -> None:
    """Find situations in recorded traffic by conditions or names, and write them as test cases.

    Exit code 1 if none of the situations could be written as a test case.

    [dim]foresee mine recording.xml --top 10
    foresee mine recording.xml --find 'ttc(ego, other) < 1.5 s and other ahead of ego'
    foresee mine recording.xml --situation cut_in --write mined[/dim]
    """
    del listed
    from foresee_recordings.listing import print_cases, print_recording, print_situations
    from foresee_recordings.mining.query import Query
    from foresee_recordings.mining.search import most_critical, search
    from foresee_recordings.mining.traffic import Traffic
    from foresee_recordings.reading import Request, read

    for text in find or ():
        Query.of(text)  # a mistake is reported before a large file is read
    request = Request(
        recording,
        begins_s=float("-inf") if from_s is None else from_s,
        ends_s=float("inf") if to_s is None else to_s,
        map_file=map_file,
        columns=_pairs(columns.split(",") if columns else (), "--columns"),
        numbers={key: _number(value) for key, value in _pairs(number or (), "--number").items()},
    )
    traffic = Traffic(read(request, reader))
    if ego:
        traffic.recording.track(ego)
    situations = search(traffic, find or (), situation or (), within_m=within)
    chosen = tuple(s for s in situations if ego in ("", s.ego))
    total = len(chosen)
    if top is not None:
        chosen = most_critical(chosen, top)
    drawn = _draw(traffic, chosen, pictures, png=png) if pictures is not None else ()
    cases: tuple[WrittenCase, ...] = ()
    if write is not None:
        from foresee_recordings.scenarios.writing import Choice, write_cases, write_seconds

        choice = Choice(before, after, radius, others, frozenset(drive or ()), deviation)
        seconds = ego and not find and not situation
        cases = (
            (write_seconds(traffic, ego, write, choice),) if seconds else write_cases(traffic, chosen, write, choice)
        )
    if json:
        print_json(_mined(traffic.recording, chosen, total, drawn, cases))
    else:
        screen = console()
        print_recording(screen, traffic.recording)
        print_situations(screen, chosen, total=total)
        print_cases(screen, cases)
    if cases and all(case.file is None for case in cases):
        raise typer.Exit(1)


def _mined(
    recording: Recording,
    situations: tuple[Situation, ...],
    total: int,
    pictures: tuple[Path, ...],
    cases: tuple[WrittenCase, ...],
) -> Mined:
    from foresee_recordings.mined import Mined

    return Mined(
        recording=recording.source,
        sha256=recording.sha256,
        reader=recording.format,
        actors=len(recording.tracks),
        begins_s=recording.begins_s,
        ends_s=recording.ends_s,
        left_out=dict(recording.left_out),
        notes=(*recording.notes, *(recording.roads.notes if recording.roads is not None else ())),
        situations=situations,
        total=total,
        pictures=pictures,
        cases=cases,
    )


def _pairs(texts: list[str] | tuple[str, ...], option: str) -> dict[str, str]:
    pairs = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if not equals or not key.strip() or not value.strip():
            raise typer.BadParameter(f"{text!r} is not NAME=VALUE", param_hint=option)
        pairs[key.strip()] = value.strip()
    return pairs


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError as err:
        raise typer.BadParameter(f"{text!r} is not a number", param_hint="--number") from err


def _draw(traffic: Traffic, situations: tuple[Situation, ...], folder: Path, *, png: bool) -> tuple[Path, ...]:
    """Write a picture of each situation; return the files."""
    from foresee_dsl.files import replacing, write_whole
    from foresee_dsl.report.drawing.svg import png_of_svg, svg_of
    from foresee_recordings.mining.pictures import picture
    from foresee_recordings.scenarios.naming import file_names

    files = []
    for name, situation in zip(file_names(situations), situations, strict=True):
        sheet = picture(traffic, situation)
        file = folder / f"{name}.{'png' if png else 'svg'}"
        if png:
            data = png_of_svg(svg_of(sheet, scheme="light"))
            folder.mkdir(parents=True, exist_ok=True)
            with replacing(file) as temporary:
                temporary.write_bytes(data)
        else:
            write_whole(file, svg_of(sheet))
        files.append(file)
    return tuple(files)
