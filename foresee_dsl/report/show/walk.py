"""Steps through a run by keys: it shows the panel of a moment, and the driver's observation, answer and reasons."""

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
from foresee_dsl.report.show.steps import ShownStep, step_lines
from foresee_dsl.simulate.trace import STEP_S

HELP = "→ space: on   ←: back   ↓ ↑: a second   home end   q: leave"
_SECOND = round(1.0 / STEP_S)
_WIDE = 44
"""Width of the panel, columns. Ours: on 120 columns it leaves room for the driver's words beside it, on 80 columns
below it."""
_BESIDE = 110
"""If the screen has at least this many columns, the words are beside the panel."""
MOVES = {
    b"\x1b[C": 1, b"\x1bOC": 1, b" ": 1, b"l": 1, b"\x1b[D": -1, b"\x1bOD": -1, b"h": -1,
    b"\x1b[B": _SECOND, b"\x1bOB": _SECOND, b"j": _SECOND, b"\x1b[A": -_SECOND, b"\x1bOA": -_SECOND, b"k": -_SECOND,
    b"\x1b[H": -1_000_000, b"\x1bOH": -1_000_000, b"g": -1_000_000,
    b"\x1b[F": 1_000_000, b"\x1bOF": 1_000_000, b"G": 1_000_000,
}  # fmt: skip
"""Number of steps by which each key moves in the run."""
LEAVES = (b"q", b"\x1b", b"\x03", b"\x04", b"")


class RunWalk:
    """The screens that a user walks through, one for each step."""

    def __init__(self, page: Page, steps: Sequence[ShownStep]) -> None:
        self._page, self._steps = page, tuple(steps)

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self._steps)

    def after(self, index: int, key: bytes) -> int | None:
        """Return the index of the step to which a key leads; None if it ends the walk."""
        if key in LEAVES:
            return None
        return min(max(index + MOVES.get(key, 0), 0), len(self._steps) - 1)

    def screen(self, index: int, width: int, height: int) -> list[Text]:
        """Return the lines of the screen at a step."""
        step, run = self._steps[index], self._page.run
        beside = width >= _BESIDE
        wide = min(_WIDE, width, max(2 * (height - 4 if beside else height - 16), 20))
        opponent = self._page.strips[-1].opponent
        words = list(step_lines(step, run.trace, opponent, width - wide - 2 if beside else width))
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

    def _panel(self, step: ShownStep) -> Panel:
        run, strip = self._page.run, self._page.strips[-1]
        frame = run.trace.frame_at(step.time_s)
        near = [moment.text for moment in strip.moments if moment.frame == frame]
        moment = Snapshot("·", frame, step.time_s, near[0] if near else "")
        windows = windows_around(run.trace, run.bundle, strip.opponent, (moment,), self._page.up)
        (panel,) = strip_panels(run.trace, run.bundle, self._measures, strip.opponent, (moment,), windows=windows)
        return panel

    @cached_property
    def _measures(self) -> Measures:
        run = self._page.run
        return measure(run.trace, run.bundle, self._page.strips[-1].opponent)


def walk(console: Console, tour: RunWalk) -> None:
    """Show the steps one at a time, controlled by keys, until the user ends the walk."""
    index: int | None = 0
    with console.screen(), _keys() as pressed:
        while index is not None and len(tour):
            console.clear()
            for line in tour.screen(index, console.width, console.height):
                console.print(line, no_wrap=True, overflow="crop")
            index = tour.after(index, next(pressed))


@contextmanager
def _keys() -> Iterator[Iterator[bytes]]:
    """Yield an iterator over the keys that the user presses; the terminal does not show them."""
    import termios
    import tty

    keyboard = sys.stdin.fileno()
    before = termios.tcgetattr(keyboard)
    try:
        tty.setcbreak(keyboard)
        yield iter(lambda: os.read(keyboard, 8), None)
    finally:
        termios.tcsetattr(keyboard, termios.TCSADRAIN, before)
