"""Shows the progress of a command in steps: a spinner on a terminal, a line every few seconds elsewhere."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console

EVERY_S = 5.0
"""Time between two lines without a terminal, s. Ours: twelve lines a minute can be read in a CI log."""


@contextmanager
def steps(console: Console) -> Iterator[Callable[[str], None]]:
    """Yield a function to call at the beginning of each step, with the step's description.

    A terminal shows a step at once. Elsewhere the current step is checked every `EVERY_S` and printed if it has
    changed; a command that ends sooner prints nothing.
    """
    if console.is_terminal:
        from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        columns = SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn()
        with Progress(*columns, console=console, transient=True) as progress:
            task = progress.add_task("beginning", total=None)
            yield lambda step: progress.update(task, description=step)
        return
    lines = _Lines(lambda line: console.print(line, highlight=False, markup=False, soft_wrap=True))
    lines.start()
    try:
        yield lines.tell
    finally:
        lines.end()


class _Lines(threading.Thread):
    """Prints the current step from a thread of its own, because most steps are a single long call."""

    def __init__(self, print_line: Callable[[str], None]) -> None:
        super().__init__(daemon=True)
        self._print_line = print_line
        self._began_s = time.monotonic()
        self._over = threading.Event()
        self._step = self._printed = ""

    def tell(self, step: str) -> None:
        """Remember the step that begins, in words."""
        self._step = step

    def run(self) -> None:
        """Print the current step every `EVERY_S` if it has changed, until `end`."""
        while not self._over.wait(EVERY_S):
            step = self._step
            if step != self._printed:
                self._printed = step
                self._print_line(f"{time.monotonic() - self._began_s:.0f} s: {step}")

    def end(self) -> None:
        """Stop the thread and wait for its end."""
        self._over.set()
        self.join()
