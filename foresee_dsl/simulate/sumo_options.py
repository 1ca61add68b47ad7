"""How SUMO is started."""

from __future__ import annotations

import os

from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.simulate.trace import STEP_S

_SEED = 42
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
        "seed": _SEED,
        "message-log": os.devnull,  # "Loading state from ..." would go to the standard output
    }
    flags = ["--no-step-log", "--no-warnings"]
    return [word for key, value in values.items() for word in (f"--{key}", str(value))] + flags


def memory_folder() -> str | None:
    """Return a folder that is kept in memory; None (the usual one) where there is none."""
    shm = "/dev/shm"  # noqa: S108 - a private folder is made inside
    return shm if os.access(shm, os.W_OK) else None
