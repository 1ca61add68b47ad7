"""Ctrl-C and SIGTERM while a campaign runs: the first asks it to stop, a second Ctrl-C ends it at once."""

from __future__ import annotations

import signal
from types import FrameType, TracebackType
from typing import Any

import typer

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Stopping:
    """Within it, a signal is remembered instead of ending the process; call it to hear whether there was one."""

    def __init__(self) -> None:
        self.signal = 0
        self._before: dict[int, Any] = {}

    def __call__(self) -> bool:
        """Say whether to stop."""
        return self.signal != 0

    @property
    def exit_code(self) -> int:
        """What a process that was stopped leaves with: 130 after Ctrl-C, 143 after SIGTERM."""
        return 128 + self.signal

    def __enter__(self) -> Stopping:
        self._before = {number: signal.signal(number, self._hear) for number in _SIGNALS}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _hear(self, number: int, frame: FrameType | None) -> None:
        del frame
        if self.signal and number == signal.SIGINT:
            raise KeyboardInterrupt
        if not self.signal:
            self.signal = number
            typer.echo("stopping: what was finished is kept (again to end at once)", err=True)
