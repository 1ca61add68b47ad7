"""The steps of a command that may take long: a spinner on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console

EVERY_S = 5.0
"""Between two lines where there is no terminal. Ours: twelve a minute can be read in a CI log."""


@contextmanager
def steps(console: Console) -> Iterator[Callable[[str], None]]:
    """Yield what is to be called at the beginning of each step, with what the step does.

    A step is shown at once on a terminal. Elsewhere a line is printed every few seconds, where the step is not that of
    the line before: a command that ends within that time prints nothing.
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
    """Prints the step that runs, in a thread of its own: most steps are one call that takes long."""

    def __init__(self, print_line: Callable[[str], None]) -> None:
        super().__init__(daemon=True)
        self._print_line = print_line
        self._began_s = time.monotonic()
        self._over = threading.Event()
        self._step = self._printed = ""

    def tell(self, step: str) -> None:
        """Remember the step that begins."""
        self._step = step

    def run(self) -> None:
        """Print what is new."""
        while not self._over.wait(EVERY_S):
            step = self._step
            if step != self._printed:
                self._printed = step
                self._print_line(f"{time.monotonic() - self._began_s:.0f} s: {step}")

    def end(self) -> None:
        """Stop."""
        self._over.set()
        self.join()
