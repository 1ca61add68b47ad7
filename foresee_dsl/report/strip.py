"""The strip of a run: its most important moments seen from above, side by side, as panels and as an SVG picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.templates import number
from foresee_dsl.files import rendered
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.report.safe_text import shortened
from foresee_dsl.report.show.drawing import GRASS, NAMES, STYLES, Drawn, drawing
from foresee_dsl.report.show.measures import FloatArray, measure
from foresee_dsl.report.show.moments import MOST, snapshots
from foresee_dsl.report.show.panels import Panel, Role, Strip, Up, strip_panels, windows_around
from foresee_dsl.simulate.results.near_misses import near_misses
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.story.story import Story

SIDE_PX = 220
"""Side of a panel in a picture, px. Ours: six panels, or three on a phone's page, fit a screen."""
_GAP_PX, _MARGIN_PX, _CAPTION_PX, _TITLE_PX, _LEGEND_PX = 14, 12, 38, 22, 30
_LETTER_PX = 7.0
"""Width reserved for a letter of the legend, px (12 px system-ui has 6.6 on average)."""
_CAPTION_LETTERS = 32
"""Maximum length of a caption, characters: what fits above a panel of `SIDE_PX`."""


def opponent_of(trace: Trace, story: Story | None = None) -> str:
    """Return the id of the actor that a run is about: the story's opponent, else the actor that was touched, else, in a
    run that passed, the actor that came nearest; "" if there is none."""
    if story is not None and story.opponent:
        return story.opponent
    hit = next((str(e.detail["with"]) for e in reversed(trace.events) if e.what == "collision"), "")
    if hit or trace.meta.get("verdict") != "pass":
        return hit
    near = near_misses(trace)
    nearest = near.ttc_s or near.distance_m
    return nearest.actor if nearest is not None else ""


def make_strip(
    trace: Trace,
    case: TestCase,
    story: Story | None = None,
    *,
    title: str = "",
    up: Up = "ego",
    most: int = MOST,
    ghost: Trace | None = None,
    like: Strip | None = None,
) -> Strip:
    """Return the panels of a run's most important moments.

    Args:
        trace: the run. case: its test case. story: the run's story, for its opponent. title: text above the strip.
        up: direction that is up in all panels: the ego's heading at the end, or north. most: maximum number of panels.
        ghost: the parent's run, whose ego and opponent are drawn as outlines.
        like: the strip of another run, whose moments, windows and opponent are used.
    """
    bundle = compile_test_case(case)
    opponent = like.opponent if like is not None else opponent_of(trace, story)
    if opponent not in {info.id for info in trace.actors}:
        opponent = ""
    measures = measure(trace, bundle, opponent)
    if like is not None:
        moments = tuple(replace(moment, text="") for moment in like.moments)  # their texts describe the other run
        windows = tuple(panel.window for panel in like.panels)
    else:
        moments = snapshots(trace, measures, opponent, most=most)
        windows = windows_around(trace, bundle, opponent, moments, up)
    panels = strip_panels(trace, bundle, measures, opponent, moments, windows=windows, ghost=ghost)
    kind = trace.actors[trace.index(opponent)].kind if opponent else ""
    return Strip(title, opponent, kind, panels)


def strip_svg(
    trace: Trace, case: TestCase, story: Story | None = None, *, ghost: Trace | None = None, per_row: int = 3
) -> str:
    """Return the strip of a run as a complete SVG document, which can also be inserted into HTML.

    Args:
        trace: the run. case: its test case. story: the run's story; its sentence is the picture's alternative text.
        ghost: the parent's run, drawn as outlines. per_row: number of panels side by side.
    """
    strip = make_strip(trace, case, story, ghost=ghost)
    return svg_of([strip], story.sentence if story is not None else case.id, per_row=per_row)


def svg_of(strips: Sequence[Strip], label: str, *, per_row: int = 3) -> str:
    """Return strips, one below the other, as one SVG document with the alternative text `label`."""
    rows: list[dict[str, Any]] = []
    y = float(_MARGIN_PX)
    for strip in strips:
        step = balanced(len(strip.panels), per_row)
        for start in range(0, len(strip.panels), step):
            title = shortened(strip.title, 120) if start == 0 else ""
            y += _TITLE_PX if title else 0
            cells = [
                _cell(panel, _MARGIN_PX + k * (SIDE_PX + _GAP_PX), y + _CAPTION_PX)
                for k, panel in enumerate(strip.panels[start : start + step])
            ]
            rows.append({"title": title, "title_y": y - 6, "cells": cells})
            y += _CAPTION_PX + SIDE_PX + _GAP_PX
    legend = _legend(strips)
    most = max((len(row["cells"]) for row in rows), default=1)
    wide = max(most * (SIDE_PX + _GAP_PX) - _GAP_PX, int(legend[-1]["end"]) if legend else 0)
    return rendered(
        "report/strip.svg",
        width=2 * _MARGIN_PX + wide,
        height=int(y) + _LEGEND_PX,
        margin=_MARGIN_PX,
        side=SIDE_PX,
        grass=GRASS,
        label=shortened(label, 300),
        rows=rows,
        legend=legend,
    )


def balanced(count: int, most: int) -> int:
    """Return the number of panels per row, at most `most`, for which the rows of `count` panels are equally long."""
    return math.ceil(count / math.ceil(count / most)) if count else 1


def caption_of(panel: Panel) -> tuple[str, str]:
    """Return the two lines above a panel: time and event; the ego's speed and the gap to the opponent."""
    snapshot = panel.snapshot
    gap = f" gap {panel.gap_m:.1f} m" if math.isfinite(panel.gap_m) else ""
    return f"{snapshot.time_s:.2f} s {snapshot.text}".rstrip(), f"{panel.ego_mps * 3.6:.0f} km/h{gap}"


def scale_bar(side_m: float) -> int:
    """Return the length of the scale bar in a window, m: a round number, at most a third of the side (or 2 m)."""
    return max((bar for bar in (2, 5, 10, 20) if bar <= side_m / 3), default=2)


def legend_of(strips: Sequence[Strip]) -> list[tuple[Role, str]]:
    """Return the roles that occur in strips with their names; the ego and the opponent come first."""
    roles = {role for strip in strips for role in strip.roles}
    named = next((strip for strip in strips if strip.opponent), None)
    names = NAMES | ({Role.OPPONENT: f"{named.opponent} ({named.opponent_kind})"} if named is not None else {})
    return [(role, shortened(names[role], 40)) for role in reversed(Role) if role in roles]


def _cell(panel: Panel, x: float, y: float) -> dict[str, Any]:
    caption, figures = caption_of(panel)
    half, bar = panel.side_m / 2, scale_bar(panel.side_m)
    return {
        "x": number(x),
        "y": number(y),
        "letter": panel.snapshot.letter,
        "caption": shortened(caption, _CAPTION_LETTERS),
        "figures": shortened(figures, _CAPTION_LETTERS),
        "view": f"{number(-half)} {number(-half)} {number(panel.side_m)} {number(panel.side_m)}",
        "left": number(-half),
        "top": number(-half),
        "side_m": number(panel.side_m),
        "north_deg": number(90.0 - math.degrees(panel.north_rad), 1),
        "bar_m": bar,
        "bar_px": number(bar / panel.side_m * SIDE_PX),
        "shapes": [_shape(shape) for shape in drawing(panel)],
    }


def _shape(drawn: Drawn) -> dict[str, Any]:
    return {
        "name": drawn.name.value,
        "path": "".join(_path(ring, closed=drawn.closed) for ring in drawn.rings),
        "fill": (drawn.style.fill if drawn.closed else "") or "none",
        "line": drawn.style.line or "none",
        "width_m": drawn.style.width_m,
        "dashed": drawn.style.dashed,
        "title": shortened(drawn.title, 60),
    }


def _path(points: FloatArray, *, closed: bool) -> str:
    """Return points as an SVG path; in SVG, y grows downwards."""
    places = " ".join(f"{number(x, 2)} {number(-y, 2)}" for x, y in points.tolist())
    return f"M{places}{'Z' if closed else ''}"


def _legend(strips: Sequence[Strip]) -> list[dict[str, Any]]:
    entries: list[dict[str, Any]] = []
    x = 0.0
    for role, text in legend_of(strips):
        style, end = STYLES[role], x + 22 + _LETTER_PX * len(text)
        entries.append({"x": x, "end": end, "text": text, "fill": style.fill or "none", "line": style.line,
                        "dashed": style.dashed})  # fmt: skip
        x = end + 14
    return entries
