"""Adds the plug-in with the faulty drivers to the import path of this process and of the processes that it starts."""

from __future__ import annotations

import importlib
import os
import sys
from pathlib import Path

from foresee_dsl.drivers.consent import allow

PLUG_IN = Path(__file__).parent / "plug_in"


def add_plug_in() -> None:
    """Add the plug-in's folder to the path, unless it is there already."""
    place = str(PLUG_IN)
    if place not in sys.path:
        sys.path.append(place)
        importlib.invalidate_caches()
    paths = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    if place not in paths:
        os.environ["PYTHONPATH"] = os.pathsep.join([*(part for part in paths if part), place])


def address(fault: str, strength: float) -> str:
    """Return the address of a faulty driver, `fault:pdm/late_objects@0.4`, and allow it to start."""
    text = f"fault:{fault}@{strength:g}"
    allow(text)  # `drivers.consent` treats an address with a colon as a program
    return text


def healthy(fault: str) -> str:
    """Return the driver into which a fault is seeded: `pdm` for `pdm/late_objects`."""
    return fault.partition("/")[0]
