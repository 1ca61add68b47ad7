"""The strip of a run: its most important moments from above, side by side, as panels and as an SVG picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from foresee_dsl.compile import compile_test_case
from foresee_dsl.language.document import TestCase
from foresee_dsl.report.drawing import svg
from foresee_dsl.report.drawing.sheet import (
    PAD,
    DrawnPart,
    Key,
    Map,
    MapFrame,
    Sheet,
    Sizes,
    Words,
    legend,
    scale_and_north,
)
from foresee_dsl.report.safe_text import shortened
from foresee_dsl.report.show.measures import measure
from foresee_dsl.report.show.moments import MOST, snapshots
from foresee_dsl.report.show.panels import Panel, Role, Strip, Up, panel_parts, strip_panels, windows_around
from foresee_dsl.simulate.results.near_misses import near_misses
from foresee_dsl.simulate.trace import Trace

if TYPE_CHECKING:
    from foresee_dsl.story.story import Story

SIDE_PX = 220.0
"""Side of a panel in a picture, px. Ours: six panels fit a screen, and three fit the page on a phone."""
_GAP_PX, _CAPTION_PX, _TITLE_PX = 14, 34, 22
SIZES = Sizes(text=12.0, small=11.0, title=13.0, room=1.0)
"""Sizes of the letters, px. Ours: two lines of `_CAPTION_LETTERS` fit above a panel."""
_LETTER_PX = 9.0
"""Width that is reserved for a bold letter, px; at 12 px, letters of system-ui are at most 9 px wide."""
NAMES = {
    Role.EGO: "ego",
    Role.OPPONENT: "opponent",
    Role.OTHER: "others",
    Role.PARKED: "parked, obstacles",
    Role.GHOST: "in the parent's run",
}
_CAPTION_LETTERS = 32
"""Maximum length of a caption, characters: as much as fits above a panel of `SIDE_PX`."""


def opponent_of(trace: Trace, story: Story | None = None) -> str:
    """Return the id of the actor that a run is about; "" if there is none.

    It is the story's opponent, or else the actor that was touched, or else, in a run that passed, the actor that came
    nearest.
    """
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
        up: the direction that points upwards in all panels: the ego's heading at the end, or north. most: maximum
            number of panels.
        ghost: the parent's run, whose ego and opponent are drawn as outlines.
        like: the strip of another run, whose moments, windows and opponent are used.
    """
    bundle = compile_test_case(case)
    opponent = like.opponent if like is not None else opponent_of(trace, story)
    if opponent not in {info.id for info in trace.actors}:
        opponent = ""
    measures = measure(trace, bundle, opponent)
    if like is not None:
        # Their texts describe the other run, so they are left out.
        moments = tuple(replace(moment, text="") for moment in like.moments)
        windows = tuple(panel.window for panel in like.panels)
    else:
        moments = snapshots(trace, measures, opponent, most=most)
        windows = windows_around(trace, bundle, opponent, moments, up)
    panels = strip_panels(trace, bundle, measures, opponent, moments, windows=windows, ghost=ghost)
    kind = trace.actors[trace.index(opponent)].kind if opponent else ""
    return Strip(title, opponent, kind, panels)


def strip_svg(trace: Trace, case: TestCase, story: Story | None = None, *, ghost: Trace | None = None) -> str:
    """Return the strip of a run as a complete SVG document, which can also be inserted into HTML.

    Args:
        trace: the run. case: its test case. story: the run's story; its sentence is the picture's alternative text.
        ghost: the parent's run, drawn as outlines.
    """
    strip = make_strip(trace, case, story, ghost=ghost)
    return svg_of([strip], story.sentence if story is not None else case.id)


def svg_of(strips: Sequence[Strip], label: str, *, per_row: int = 3) -> str:
    """Return strips, one below the other, as one SVG document with the alternative text `label`."""
    return svg.svg_of(sheet_of(strips, label, per_row=per_row), scheme="light")


def sheet_of(strips: Sequence[Strip], label: str, *, per_row: int = 3) -> Sheet:
    """Return strips as a sheet: a map for each panel with its caption above, and a legend below."""
    maps: list[Map] = []
    around: list[DrawnPart] = []
    y = PAD
    for strip in strips:
        step = balanced(len(strip.panels), per_row)
        if title := shortened(strip.title, 120):
            around.append(DrawnPart("title", words=(Words("title", title, PAD, y + 6, "title", bold=True),)))
            y += _TITLE_PX
        for start in range(0, len(strip.panels), step):
            y += _CAPTION_PX
            for k, panel in enumerate(strip.panels[start : start + step]):
                x = PAD + k * (SIDE_PX + _GAP_PX)
                around.append(_caption(panel, x, y))
                maps.append(map_of(panel, x, y))
            y += SIDE_PX + _GAP_PX
    width = max((map_.x for map_ in maps), default=PAD) + SIDE_PX + PAD
    below, height = legend([_key(role, text) for role, text in legend_of(strips)], width, y, SIZES)
    return Sheet(width, height, tuple(maps), (*around, *below), shortened(label, 300), SIZES)


def balanced(count: int, most: int) -> int:
    """Return the number of panels per row, at most `most`, for which all rows of `count` panels are about
    equally long.
    """
    return math.ceil(count / math.ceil(count / most)) if count else 1


def caption_of(panel: Panel) -> tuple[str, str]:
    """Return the two lines above a panel: time and event; then the ego's speed and the gap to the opponent."""
    snapshot = panel.snapshot
    gap = f" gap {panel.gap_m:.1f} m" if math.isfinite(panel.gap_m) else ""
    return f"{snapshot.time_s:.2f} s {snapshot.text}".rstrip(), f"{panel.ego_mps * 3.6:.0f} km/h{gap}"


def legend_of(strips: Sequence[Strip]) -> list[tuple[Role, str]]:
    """Return the roles that occur in strips with their names; the ego and the opponent come first."""
    roles = {role for strip in strips for role in strip.roles}
    named = next((strip for strip in strips if strip.opponent), None)
    names = NAMES | ({Role.OPPONENT: f"{named.opponent} ({named.opponent_kind})"} if named is not None else {})
    return [(role, shortened(names[role], 40)) for role in reversed(Role) if role in roles]


def _caption(panel: Panel, x: float, y: float) -> DrawnPart:
    caption, figures = (shortened(text, _CAPTION_LETTERS) for text in caption_of(panel))
    letter = panel.snapshot.letter
    words = (
        Words("title", letter, x, y - 24, bold=True),
        Words("title", caption, x + _LETTER_PX * (len(letter) + 1), y - 24),
        Words("quiet", figures, x, y - 10),
    )
    return DrawnPart("caption", words=words)


def map_of(panel: Panel, x: float, y: float, side_px: float = SIDE_PX) -> Map:
    """Return a panel as a square map with its upper left corner at x and y, px."""
    half, scale = panel.side_m / 2, side_px / panel.side_m
    frame = MapFrame(side_px, side_px, -half, half, scale)
    corner, _ = scale_and_north(frame, SIZES, panel.north_rad)
    return Map(x, y, frame, (*panel_parts(panel, scale), corner))


def _key(role: Role, text: str) -> Key:
    return Key(role.value, text, line=True, dash=(3.0, 3.0)) if role is Role.GHOST else Key(role.value, text)
