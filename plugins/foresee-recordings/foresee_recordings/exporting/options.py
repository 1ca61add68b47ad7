"""The options of the exporters of runs."""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl.exchange.protocol import AllowOutside, OutFolder, RunAddresses, RunDriver, RunSeed


@dataclass(frozen=True)
class RunOptions:
    """Options of the exporters of runs."""

    addresses: RunAddresses
    out: OutFolder
    driver: RunDriver = ""
    seed: RunSeed = None
    allow_outside: AllowOutside = False
