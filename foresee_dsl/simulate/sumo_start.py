"""How SUMO is started, and its empty state: every run begins by loading it, ten times faster than a restart."""

from __future__ import annotations

import math
import os
import re
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.simulate.moved_bodies import GHOST_TYPE
from foresee_dsl.simulate.trace import STEP_S

if TYPE_CHECKING:
    from types import ModuleType

_VEHICLE_TYPE = re.compile(r'^ *<vType id="([^"]+)"[^>]*/>\n', re.MULTILINE)
"""A vehicle type in a state that SUMO saved."""
_SUMO_SEED = 42
"""SUMO's own random numbers decide nothing here (sigma and speedDev are 0); fixed to be sure."""


def options(bundle: SumoBundle) -> list[str]:
    """Return the options for a bundle's network and vehicle types."""
    values = {
        "net-file": bundle.net_file,
        "additional-files": bundle.types_file,
        "step-length": STEP_S,
        "time-to-teleport": -1,
        "time-to-impatience": -1,  # impatience grows with the time waited, which no description holds
        "collision.action": "none",
        "pedestrian.striping.dawdling": 0,
        "save-state.precision": 17,
        "seed": _SUMO_SEED,
        "message-log": os.devnull,  # "Loading state from ..." would go to the standard output
    }
    flags = ["--no-step-log", "--no-warnings"]
    return [word for key, value in values.items() for word in (f"--{key}", str(value))] + flags


class EmptyState:
    """The state of a SUMO in which nobody drives yet, kept in memory-backed storage."""

    def __init__(self, sumo: ModuleType) -> None:
        """Save the state that SUMO is in; SUMO's own errors where it cannot."""
        self._sumo = sumo
        self._folder = tempfile.TemporaryDirectory(prefix="foresee-", dir=_memory_folder())
        self._file = Path(self._folder.name) / "empty.xml"
        try:
            sumo.simulation.saveState(str(self._file))
            # The state itself, without the comment in front of it that repeats SUMO's configuration.
            self._text = "<snapshot" + self._file.read_text("utf-8").partition("<snapshot")[2]
        except BaseException:
            self.close()
            raise

    def load(self, models: set[str]) -> float:
        """Load the state at a time that no earlier run of this process has come to; return that time, s.

        SUMO 1.28 remembers for each edge when vehicles last considered changing lanes on it, and skips the edge if that
        was at the present time. Loading a state does not clear this. With all runs beginning at 0, a vehicle that came
        to an edge at the very time at which an earlier run had ended there did not change lanes in that step (measured:
        2 of 1,212 children depended on what the process had run before). The fault is gone when `MSEdgeControl` forgets
        these times as it loads a state.

        Args:
            models: what the run has; the other vehicle types are left out, which halves the 2 ms of loading.
        """
        now_s = self._sumo.simulation.getTime()
        begins_s = math.ceil(now_s) + 1 if now_s > 0 else 0
        used = {*models, GHOST_TYPE}
        text = _VEHICLE_TYPE.sub(lambda found: found[0] if found[1] in used else "", self._text)
        text = re.sub(r'\btime="[^"]*"', f'time="{begins_s}.000"', text, count=1)
        text = re.sub(r' until="(\d+)"', lambda found: f' until="{int(found[1]) + begins_s * 1000}"', text)
        self._file.write_text(text, "utf-8")
        self._sumo.simulation.loadState(str(self._file))
        return float(begins_s)

    def close(self) -> None:
        """Remove what was saved."""
        self._folder.cleanup()


def _memory_folder() -> str | None:
    """Return a folder that is kept in memory; None (the usual one) where there is none."""
    shm = "/dev/shm"  # noqa: S108 - a private folder is made inside
    return shm if os.access(shm, os.W_OK) else None
