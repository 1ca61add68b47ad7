"""Panels in characters with their frames and captions, side by side, and the legend of their signs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rich.text import Text

from foresee_dsl.report.drawing.characters import POINTS, Screen
from foresee_dsl.report.drawing.ground import Layer
from foresee_dsl.report.drawing.palette import PAINTS
from foresee_dsl.report.safe_text import shortened
from foresee_dsl.report.show.panels import Panel, Role, Strip, panel_parts
from foresee_dsl.report.show.strip import caption_of, legend_of

WIDEST, NARROWEST = 40, 26
"""Largest and smallest width of a panel with its frame, columns. Ours: in a window of 24 m, a road of two lanes is then
at least six dots wide."""
PAIR_WIDEST = 32
"""Largest width of a panel that is beside the parent's panel, columns. Ours: with wider panels, two moments do not fit
on a screen."""
_GAP = 1
"""Number of columns between two panels."""


def strip_lines(strip: Strip, width: int) -> Iterator[Text]:
    """Yield the lines of a strip for a screen `width` columns wide."""
    if not strip.panels:
        return
    per_row, wide = layout(len(strip.panels), width)
    for start in range(0, len(strip.panels), per_row):
        yield from _row(strip.panels[start : start + per_row], wide)


def pair_lines(parent: Strip, child: Strip, width: int) -> Iterator[Text]:
    """Yield two strips of the same moments side by side: at each moment the parent's panel, then the child's."""
    pairs = [(was, now) for now in child.panels for was in parent.panels if was.snapshot.letter == now.snapshot.letter]
    if not pairs:
        return
    per_row = max(1, min((width + _GAP) // (2 * (NARROWEST + _GAP)), len(pairs)))
    wide = min((width + _GAP) // (2 * per_row) - _GAP, PAIR_WIDEST)
    titles = [f"{shortened(title, wide):<{wide}}" for title in (parent.title, child.title)]
    for start in range(0, len(pairs), per_row):
        row = pairs[start : start + per_row]
        yield Text((" " * _GAP).join(titles * len(row)).rstrip(), style="bold")
        yield from _row([panel for pair in row for panel in pair], wide)


def _row(panels: Sequence[Panel], wide: int) -> Iterator[Text]:
    for parts in zip(*(panel_lines(panel, wide) for panel in panels), strict=True):
        yield Text(" " * _GAP).join(parts)


def layout(count: int, width: int) -> tuple[int, int]:
    """Return how many panels are in a row and how many columns each has, for a number of panels and the width of a
    screen.
    """
    fit = max(1, min((width + _GAP) // (NARROWEST + _GAP), count))
    rows = math.ceil(count / fit)
    per_row = math.ceil(count / rows)
    return per_row, max(min((width + _GAP) // per_row - _GAP, WIDEST), min(width, NARROWEST))


def panel_lines(panel: Panel, width: int) -> list[Text]:
    """Return a panel with its frame: above it the moment; below it the ego's speed, the gap and the side of
    the window.
    """
    columns = max(width - 2, 4)
    caption, figures = caption_of(panel)
    letter, side = panel.snapshot.letter, f" ↔{panel.side_m:g} m"
    caption = shortened(caption, columns - 4)
    figures = shortened(figures, columns - len(side))
    top = Text.assemble("┌", (letter, "bold"), " ", caption, " ", "─" * (columns - len(letter) - 2 - len(caption)), "┐")
    rest = columns - len(figures) - len(side)
    bottom = Text.assemble("└", figures, " " if rest else "", "─" * (rest - 1), side, "┘")
    rows = [Text.assemble("│", row, "│") for row in canvas(panel, columns, columns // 2)]
    return [top, *rows, bottom]


def canvas(panel: Panel, columns: int, rows: int) -> list[Text]:
    """Return the rows of characters inside a panel's frame."""
    screen = Screen(panel.side_m, columns, rows)
    screen.draw(panel_parts(panel, bars=False))
    return screen.text()


_SWATCHES = {Role.EGO: "█▲", Role.OPPONENT: "⣿", Role.OTHER: "⣏⣹", Role.PARKED: "⣏⣹", Role.GHOST: "⣏⣹"}


def legend_lines(strips: Sequence[Strip], width: int) -> Iterator[Text]:
    """Yield the legend of the signs, in lines of at most `width` columns."""
    entries: list[Text] = []
    for role, name in legend_of(strips):
        entries.append(Text.assemble((f"{_SWATCHES[role]} {POINTS[role]}", PAINTS[role].terminal), f" {name}"))
    layers = {layer for strip in strips for panel in strip.panels for layer in panel.ground}
    if Layer.BUILDING in layers:
        entries.append(Text.assemble(("░", PAINTS[Layer.BUILDING].terminal), " building"))
    if Layer.CROSSING in layers:
        entries.append(Text("⢕ crossing"))
    if Layer.SLIPPERY in layers:
        entries.append(Text.assemble(("⢕", PAINTS[Layer.SLIPPERY].terminal), " slippery"))
    line = Text()
    for entry in entries:
        if line and len(line) + 3 + len(entry) > width:
            yield line
            line = Text()
        line = Text.assemble(line, "   ", entry) if line else entry
    yield line
