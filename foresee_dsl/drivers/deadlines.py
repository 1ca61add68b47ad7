"""How much wall time a driver may take: for its reset, for a step, for a whole run.

A driver that takes longer hangs, and its run ends as `timeout`. That must never happen to a driver that is only slow on
a busy machine, so the defaults are hundreds of times what drivers take. Measured on 14 cases of the library with two
cores, both busy: the slowest step was 6 ms (`pdm`), 14 ms (`idm`) and 37 ms (`frenetix`), the slowest reset 67 ms, the
slowest run 0.17 s of wall time for a simulated second (all `frenetix`).
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

from foresee_dsl.errors import DriverError

STEP_S = 10.0
"""Ours: 270 times the slowest step that was measured. The driver `external` has a shorter one of its own."""
RESET_S = 60.0
"""Ours: of the reset and the first step, in which a driver may load its weights or compile its functions; 900 times the
slowest that was measured."""
STEADY_S = 60.0
"""Ours: a worker starts, builds its network and imports a framework for learned models in far less."""
SLOWEST = 20.0
"""So much slower than real time may a driver be. Ours: a second of wall time for a step; 110 times the slowest run that
was measured."""
STEP_VARIABLE, RESET_VARIABLE = "FORESEE_STEP_DEADLINE_S", "FORESEE_RESET_DEADLINE_S"


@dataclass(frozen=True)
class Deadlines:
    """Wall times.

    Attributes:
        step_s: for an answer; None: FORESEE_STEP_DEADLINE_S, or `STEP_S`.
        run_s: for a whole run; None: `STEADY_S` and `SLOWEST` times what is simulated.
    """

    step_s: float | None = None
    run_s: float | None = None

    @property
    def for_step_s(self) -> float:
        """The wall time for a step."""
        return seconds_of(STEP_VARIABLE, STEP_S) if self.step_s is None else self.step_s

    @property
    def for_reset_s(self) -> float:
        """The wall time for the reset."""
        return max(seconds_of(RESET_VARIABLE, RESET_S), self.for_step_s)

    @property
    def for_first_step_s(self) -> float:
        """The wall time for the first step: that of the reset, unless one for a step was given."""
        return self.for_reset_s if self.step_s is None else self.step_s

    def for_run_s(self, simulated_s: float) -> float:
        """The wall time of a run of so many simulated seconds."""
        return STEADY_S + SLOWEST * simulated_s if self.run_s is None else self.run_s


DEADLINES = Deadlines()
"""Those of a driver of which nothing else is known."""


def seconds_of(variable: str, default: float) -> float:
    """Return the time that an environment variable sets.

    Raises:
        DriverError: it is no time.
    """
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
