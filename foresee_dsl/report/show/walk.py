"""Walking through a run by keys: the panel of a moment, what the driver saw and answered, and why."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property

from rich.console import Console
from rich.text import Text

from foresee_dsl.report.safe_text import shortened
from foresee_dsl.report.show.characters import panel_lines
from foresee_dsl.report.show.measures import Measures, measure
from foresee_dsl.report.show.moments import Snapshot
from foresee_dsl.report.show.page import Page
from foresee_dsl.report.show.panels import Panel, strip_panels, windows_around
from foresee_dsl.report.show.steps import Step, step_lines
from foresee_dsl.simulate.trace import STEP_S

HELP = "→ space: on   ←: back   ↓ ↑: a second   home end   q: leave"
_SECOND = round(1.0 / STEP_S)
_WIDE = 44
"""Columns of the panel. Ours: it leaves room for the driver's words beside it on 120 columns, below it on 80."""
_BESIDE = 110
"""From so many columns on, the words stand beside the panel."""
MOVES = {
    b"\x1b[C": 1, b"\x1bOC": 1, b" ": 1, b"l": 1, b"\x1b[D": -1, b"\x1bOD": -1, b"h": -1,
    b"\x1b[B": _SECOND, b"\x1bOB": _SECOND, b"j": _SECOND, b"\x1b[A": -_SECOND, b"\x1bOA": -_SECOND, b"k": -_SECOND,
    b"\x1b[H": -1_000_000, b"\x1bOH": -1_000_000, b"g": -1_000_000,
    b"\x1b[F": 1_000_000, b"\x1bOF": 1_000_000, b"G": 1_000_000,
}  # fmt: skip
"""How far each key goes, in steps."""
LEAVES = (b"q", b"\x1b", b"\x03", b"\x04", b"")


class Walk:
    """The screens of a walk, one for each step."""

    def __init__(self, page: Page, steps: Sequence[Step]) -> None:
        self._page, self._steps = page, tuple(steps)

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self._steps)

    def after(self, index: int, key: bytes) -> int | None:
        """Return where a key leads from a step; None: it leaves."""
        if key in LEAVES:
            return None
        return min(max(index + MOVES.get(key, 0), 0), len(self._steps) - 1)

    def screen(self, index: int, width: int, height: int) -> list[Text]:
        """Return what is shown at a step."""
        step, shown = self._steps[index], self._page.shown
        beside = width >= _BESIDE
        wide = min(_WIDE, width, max(2 * (height - 4 if beside else height - 16), 20))
        opponent = self._page.strips[-1].opponent
        words = list(step_lines(step, shown.trace, opponent, width - wide - 2 if beside else width))
        picture = panel_lines(self._panel(step), wide)
        if beside:
            rows = max(len(picture), len(words))
            picture += [Text(" " * wide)] * (rows - len(picture))
            words += [Text()] * (rows - len(words))
            lines = [Text("  ").join(parts) for parts in zip(picture, words, strict=True)]
        else:
            lines = [*picture, *words]
        return [
            *lines[: max(height - 2, 1)],
            Text(shortened(f"{index + 1}/{len(self._steps)}   {HELP}", width), style="dim"),
        ]

    def _panel(self, step: Step) -> Panel:
        shown, strip = self._page.shown, self._page.strips[-1]
        frame = shown.trace.frame_at(step.time_s)
        near = [moment.text for moment in strip.moments if moment.frame == frame]
        moment = Snapshot("·", frame, step.time_s, near[0] if near else "")
        windows = windows_around(shown.trace, shown.bundle, strip.opponent, (moment,), self._page.up)
        (panel,) = strip_panels(shown.trace, shown.bundle, self._found, strip.opponent, (moment,), windows=windows)
        return panel

    @cached_property
    def _found(self) -> Measures:
        shown = self._page.shown
        return measure(shown.trace, shown.bundle, self._page.strips[-1].opponent)


def walk(console: Console, tour: Walk) -> None:
    """Show the steps one at a time, as keys say, until the user leaves."""
    index: int | None = 0
    with console.screen(), _keys() as pressed:
        while index is not None and len(tour):
            console.clear()
            for line in tour.screen(index, console.width, console.height):
                console.print(line, no_wrap=True, overflow="crop")
            index = tour.after(index, next(pressed))


@contextmanager
def _keys() -> Iterator[Iterator[bytes]]:
    """Give the keys that are pressed, each when it is pressed, without echo."""
    import termios
    import tty

    keyboard = sys.stdin.fileno()
    before = termios.tcgetattr(keyboard)
    try:
        tty.setcbreak(keyboard)
        yield iter(lambda: os.read(keyboard, 8), None)
    finally:
        termios.tcsetattr(keyboard, termios.TCSADRAIN, before)
