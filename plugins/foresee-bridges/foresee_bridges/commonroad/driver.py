"""The driver `commonroad`: starts this bridge's program in foresee's own environment, `--driver commonroad:idm`."""

from __future__ import annotations

import importlib.util
import shlex
import sys
from typing import Self

from foresee_dsl.drivers.deadlines import RESET_VARIABLE, STEP_VARIABLE, seconds_of
from foresee_dsl.drivers.external import ExternalDriver
from foresee_dsl.errors import DriverError, DriverUnavailableError

RESET_DEADLINE_S = 60.0
"""Limit of the wall time from the start of the program to its first line, s. Ours: the import of the planners and the
borders of the road take up to 10 s on a busy machine."""
STEP_DEADLINE_S = 10.0
"""Limit of the wall time of a step, s. Ours: a plan of the slowest planner takes 0.3 s on a busy machine."""


class CommonRoadDriver(ExternalDriver):
    """A CommonRoad planner: --driver commonroad:reactive, commonroad:idm, commonroad:fiss, commonroad:FILE.py:NAME."""

    name, version = "commonroad", "1"

    def __init__(self, argument: str) -> None:
        """Prepare the program; it starts at the first reset.

        Raises:
            DriverError: there is no argument. DriverUnavailableError: commonroad-io is not installed.
        """
        if not argument:
            raise DriverError("commonroad names no planner; write commonroad:reactive, commonroad:idm, commonroad:fiss "
                              "or commonroad:FILE.py:FUNCTION")  # fmt: skip
        if importlib.util.find_spec("commonroad") is None:
            raise DriverUnavailableError(
                f"commonroad:{argument} needs commonroad-io: pip install 'foresee-bridges[commonroad]', or keep the "
                "planner in an environment of its own (docs/guide/commonroad.md)"
            )
        super().__init__(f"{shlex.quote(sys.executable)} -m foresee_bridges.commonroad {argument}")
        self.step_deadline_s = seconds_of(STEP_VARIABLE, STEP_DEADLINE_S)
        self._reset_s = seconds_of(RESET_VARIABLE, RESET_DEADLINE_S)
        self.name = f"commonroad:{argument}"

    @classmethod
    def from_argument(cls, argument: str) -> Self:
        """Create the driver of the address `commonroad:ARGUMENT`."""
        return cls(argument)
