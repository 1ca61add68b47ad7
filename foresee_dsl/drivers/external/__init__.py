"""The driver `external`: any program in any language that speaks JSON lines over its standard input and output.

docs/external.md describes the protocol. The program is started at `reset` and ended at `close`: a fresh process for
each run, so that nothing of one run can reach the next.
"""

from __future__ import annotations

import contextlib
import math
import os
import shlex
import shutil
import weakref
from collections.abc import Iterator
from pathlib import Path

from foresee_dsl.drivers.external.messages import end_line, read_control, read_ready, reset_line, step_line
from foresee_dsl.drivers.external.process import Program
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.errors import DriverError

STEP_DEADLINE_S = 1.0
"""Wall time for an answer, unless FORESEE_STEP_DEADLINE_S says otherwise. Ours: twenty times real time, so that a busy
machine changes no verdict."""
RESET_DEADLINE_S = 10.0
"""Wall time from the start of the program to its first line, unless FORESEE_RESET_DEADLINE_S says otherwise. Ours: an
interpreter that imports a framework for learned models takes some seconds."""
USAGE = 'write external:COMMAND, such as --driver "external:python3 my_driver.py"'


class ExternalDriver:
    """Any program over stdio, one JSON line a step: --driver "external:python3 my_driver.py"."""

    name = "external"
    version = "1"

    def __init__(self, command_line: str) -> None:
        """Take up a command line; nothing is started yet.

        Args:
            command_line: split as a shell would split it; no shell runs.

        Raises:
            DriverError: it is empty or cannot be split, there is no such program, or a deadline's setting is no time.
        """
        if os.name != "posix":
            raise DriverError("external drivers need process groups, which this system has not")
        self._command = _split(command_line)
        self._step_s = _seconds("FORESEE_STEP_DEADLINE_S", STEP_DEADLINE_S)
        self._reset_s = _seconds("FORESEE_RESET_DEADLINE_S", RESET_DEADLINE_S)
        self._program: Program | None = None
        self._last_resort: weakref.finalize[[], ExternalDriver] | None = None
        self.name = f"external:{command_line}"
        self.version = ""  # the program says it in its first line

    @classmethod
    def from_argument(cls, argument: str) -> ExternalDriver:
        """Make the driver that `external:ARGUMENT` names.

        Raises:
            DriverError: the argument is no command.
        """
        return cls(argument)

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Start the program and give it its mission; `version` is then its name and version.

        Raises:
            DriverError: it cannot be started, or does not answer as it must.
        """
        self.close()
        self._program = Program(self._command)
        self._last_resort = weakref.finalize(self, self._program.kill)
        line = self._exchange(reset_line(mission, vehicle, seed), self._reset_s)
        with self._blaming():
            self.version = " ".join(read_ready(line))

    def step(self, observation: Observation) -> Control:
        """Send one observation and return the program's answer.

        Raises:
            DriverError: `reset` was not called, or the program does not answer as it must.
        """
        line = self._exchange(step_line(observation), self._step_s)
        with self._blaming():
            return read_control(line)

    def close(self) -> None:
        """Tell the program that the run is over, and see to it that it ends."""
        if self._program is not None:
            self._program.end(end_line())
        self._forget()

    def _exchange(self, line: bytes, deadline_s: float) -> bytes:
        if self._program is None:
            raise DriverError("an external driver was stepped before reset, or after it broke")
        with self._blaming():
            return self._program.exchange(line, deadline_s)

    @contextlib.contextmanager
    def _blaming(self) -> Iterator[None]:
        """End the program when it breaks the protocol, and say which it was."""
        try:
            yield
        except DriverError as err:
            if self._program is not None:
                self._program.kill()
            self._forget()
            raise DriverError(f"{shlex.join(self._command)}: {err}") from err
        except BaseException:  # such as Ctrl-C: the run is over, close will not be polite to a program out of step
            if self._program is not None:
                self._program.kill()
            self._forget()
            raise

    def _forget(self) -> None:
        if self._last_resort is not None:
            self._last_resort.detach()
        self._program = self._last_resort = None


def _split(command_line: str) -> list[str]:
    try:
        command = shlex.split(command_line)
    except ValueError as err:
        raise DriverError(f"external:{command_line} cannot be split into words: {err}".rstrip(".")) from err
    if not command:
        raise DriverError(f"external names no program; {USAGE}")
    if shutil.which(command[0]) is None:
        raise DriverError(f"external:{command_line}: there is no program {command[0]!r} (seen from {Path.cwd()})")
    return command


def _seconds(variable: str, default: float) -> float:
    text = os.environ.get(variable)
    if not text:
        return default
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0 < seconds <= 3600:
        raise DriverError(f"{variable} is {text!r}, not a time in seconds above 0 and up to 3600")
    return seconds
