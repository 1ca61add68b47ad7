"""The signal to stop of long commands: Ctrl-C or SIGTERM ends them after the runs that have begun."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

import typer


class StopSignal:
    """Counts Ctrl-C and SIGTERM while a campaign runs: the first signal asks it to stop, a second Ctrl-C ends it at
    once."""

    def __init__(self) -> None:
        self.number = 0

    def __call__(self) -> bool:
        """Return whether a signal arrived."""
        return self.number != 0

    @property
    def exit_code(self) -> int:
        """Exit code of a stopped process: 130 after Ctrl-C, 143 after SIGTERM."""
        return 128 + self.number

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Record signals inside this context, instead of letting them end the process."""
        before = {number: signal.signal(number, self._receive) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _receive(self, number: int, _: FrameType | None) -> None:
        if self.number and number == signal.SIGINT:
            raise KeyboardInterrupt
        if not self.number:
            self.number = number
            typer.echo(
                "stopping; finished results are kept (press Ctrl-C again to end at once)",
                err=True,
            )
