"""Limits of the wall time of a driver: for its reset, for a step, for a whole run.

A driver that takes longer is stopped, and its run ends as `timeout`. This must never happen to a driver that is only
slow because the machine is busy, so the defaults are hundreds of times the usual values. Measured on 14 cases of the
library with two busy cores: the slowest step was 6 ms (`pdm`), 14 ms (`idm`) and 37 ms (`frenetix`), the slowest reset
67 ms, the slowest run 0.17 s of wall time per simulated second (the last two: `frenetix`).
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

from foresee_dsl.errors import DriverError

STEP_WALL_S = 10.0
"""Wall time of a step, s. Ours: 270 times the slowest measured step. The driver `external` has a shorter limit."""
RESET_S = 60.0
"""Wall time of the reset and of the first step, in which a driver may load weights or compile functions, s. Ours: 900
times the slowest measured reset."""
STEADY_S = 60.0
"""Part of the limit of a run's wall time that does not depend on the run's length, s. Ours: a worker needs far less
time to start, build its network and import a framework for learned models.
"""
SLOWEST = 20.0
"""Limit of a run's wall time per simulated second, s. Ours: 20 steps of 0.05 s at one second each; 110 times the
slowest measured run."""
STEP_VARIABLE, RESET_VARIABLE = "FORESEE_STEP_DEADLINE_S", "FORESEE_RESET_DEADLINE_S"


@dataclass(frozen=True)
class Deadlines:
    """Limits of wall time.

    Attributes:
        step_s: limit of a step, s; None: FORESEE_STEP_DEADLINE_S, or `STEP_WALL_S`.
        run_s: limit of a whole run, s; None: `STEADY_S` plus `SLOWEST` times the simulated time.
    """

    step_s: float | None = None
    run_s: float | None = None

    @property
    def for_step_s(self) -> float:
        """Return the limit of a step, s."""
        return seconds_of(STEP_VARIABLE, STEP_WALL_S) if self.step_s is None else self.step_s

    @property
    def for_reset_s(self) -> float:
        """Return the limit of the reset, s."""
        return max(seconds_of(RESET_VARIABLE, RESET_S), self.for_step_s)

    @property
    def for_first_step_s(self) -> float:
        """Return the limit of the first step, s: that of the reset, unless `step_s` is set."""
        return self.for_reset_s if self.step_s is None else self.step_s

    def for_run_s(self, simulated_s: float) -> float:
        """Return the limit of a run with this simulated time, s."""
        return STEADY_S + SLOWEST * simulated_s if self.run_s is None else self.run_s


DEADLINES = Deadlines()
"""The default limits."""


def seconds_of(variable: str, default: float) -> float:
    """Return the time that an environment variable sets, s; `default` if it is not set.

    Raises:
        DriverError: the variable does not contain a time.
    """
    text = os.environ.get(variable)
    if not text:
        return default
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0 < seconds <= 3600:
        raise DriverError(f"{variable} is {text!r}, which must be a time in seconds, above 0 and up to 3600")
    return seconds
