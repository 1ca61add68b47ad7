"""Starts SUMO: its options, and its empty state, which every run loads because that is ten times faster than a
restart.
"""

from __future__ import annotations

import math
import os
import re
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.compile.sumo_files import LATERAL_RESOLUTION_M
from foresee_dsl.simulate.moved_bodies import GHOST_TYPE
from foresee_dsl.simulate.trace import STEP_S

if TYPE_CHECKING:
    from types import ModuleType

_VEHICLE_TYPE = re.compile(r'^ *<vType id="([^"]+)"[^>]*/>\n', re.MULTILINE)
"""Matches a vehicle type in a state file of SUMO."""
_SUMO_SEED = 42
"""Seed of SUMO's random numbers. They have no effect here (sigma and speedDev are 0); the seed is fixed to be safe."""


def options(bundle: SumoBundle) -> list[str]:
    """Return the options for a bundle's network and vehicle types."""
    values = {
        "net-file": bundle.net_file,
        "additional-files": bundle.types_file,
        "step-length": STEP_S,
        # SUMO 1.28 would remove a blocked vehicle after 300 s and put it back elsewhere on its route.
        "time-to-teleport": -1,
        # A driver in SUMO that has waited long becomes impatient and forces its way; a scene does not contain the
        # waiting time.
        "time-to-impatience": -1,
        # SUMO would teleport vehicles that collide; here `Judging` decides what a contact means, and the run ends.
        "collision.action": "none",
        "pedestrian.striping.dawdling": 0,
        "save-state.precision": 17,
        "seed": _SUMO_SEED,
        "message-log": os.devnull,  # "Loading state from ..." would be written to the standard output otherwise
    }
    if bundle.scene.has_sublanes:
        values["lateral-resolution"] = LATERAL_RESOLUTION_M
    flags = ["--no-step-log", "--no-warnings"]
    return [word for key, value in values.items() for word in (f"--{key}", str(value))] + flags


class EmptyState:
    """The state of SUMO without vehicles, saved in a folder in memory."""

    def __init__(self, sumo: ModuleType) -> None:
        """Save the current state of SUMO; raises SUMO's own exceptions."""
        self._sumo = sumo
        self._folder = tempfile.TemporaryDirectory(prefix="foresee-", dir=_memory_folder())
        self._file = Path(self._folder.name) / "empty.xml"
        try:
            sumo.simulation.saveState(str(self._file))
            # Remove the comment before the state; it repeats SUMO's configuration, and would be read again in every
            # run.
            self._text = "<snapshot" + self._file.read_text("utf-8").partition("<snapshot")[2]
        except BaseException:
            self.close()
            raise

    def load(self, models: set[str]) -> float:
        """Load the state with a time that is later than all earlier runs of this process; return that time, s.

        SUMO 1.28 stores for each edge when vehicles last considered changing lanes on it, and skips the edge if that
        was at the current time. Loading a state does not clear this. If all runs began at 0, a vehicle that reached an
        edge at the very time at which an earlier run had ended there would not change lanes in that step (measured: 2
        of 1,212 children depended on earlier runs of the process). Times can begin at 0 again once SUMO's
        `MSEdgeControl` clears these times when it loads a state.

        Args:
            models: vehicle types of the run. The other types are left out, which halves the 2 ms of loading.
        """
        now_s = self._sumo.simulation.getTime()
        begins_s = math.ceil(now_s) + 1 if now_s > 0 else 0
        used = {*models, GHOST_TYPE}
        text = _VEHICLE_TYPE.sub(lambda match: match[0] if match[1] in used else "", self._text)
        text = re.sub(r'\btime="[^"]*"', f'time="{begins_s}.000"', text, count=1)
        # In the state, `until` is a time in SUMO's clock (ms), so it moves with the beginning of the run.
        text = re.sub(r' until="(\d+)"', lambda match: f' until="{int(match[1]) + begins_s * 1000}"', text)
        self._file.write_text(text, "utf-8")
        self._sumo.simulation.loadState(str(self._file))
        return float(begins_s)

    def close(self) -> None:
        """Remove the saved state."""
        self._folder.cleanup()


def _memory_folder() -> str | None:
    """Return a folder that is kept in memory; None without one, which means the usual folder for temporary files."""
    shm = "/dev/shm"  # noqa: S108 - a private folder is made inside
    return shm if os.access(shm, os.W_OK) else None
