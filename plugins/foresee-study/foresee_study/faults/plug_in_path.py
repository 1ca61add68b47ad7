"""Makes the plug-in with the faulty drivers known to this process and to those that it starts."""

from __future__ import annotations

import importlib
import os
import sys
from pathlib import Path

from foresee_dsl.drivers.consent import allow

PLUG_IN = Path(__file__).parent / "plug_in"


def add_plug_in() -> None:
    """Put the plug-in's folder on the path; doing so twice changes nothing."""
    place = str(PLUG_IN)
    if place not in sys.path:
        sys.path.append(place)
        importlib.invalidate_caches()
    known = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    if place not in known:
        os.environ["PYTHONPATH"] = os.pathsep.join([*(part for part in known if part), place])


def address(fault: str, strength: float) -> str:
    """Return the address of a faulty driver, `fault:pdm/late_objects@0.4`, which is allowed from here on."""
    text = f"fault:{fault}@{strength:g}"
    allow(text)  # an address with a colon is a program to `drivers.consent`
    return text


def healthy(fault: str) -> str:
    """Return the driver that a fault is seeded into: `pdm` of `pdm/late_objects`."""
    return fault.partition("/")[0]
