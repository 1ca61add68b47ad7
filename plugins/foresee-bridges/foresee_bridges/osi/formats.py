"""The format `osi` of `foresee export`, as its entry point names it.

This module is imported for every help text, so heavy imports are inside the function.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from foresee_dsl.exchange.outcome import Imported
from foresee_dsl.exchange.protocol import AllowOutside, Option, OutFolder, RunAddresses, RunDriver, RunSeed, Tell

WHAT = ("ground-truth", "sensor-view", "traffic-update")
FILE_FORMATS = ("osi", "mcap")


@dataclass(frozen=True)
class OsiOptions:
    """Options of `foresee export osi`."""

    addresses: RunAddresses
    out: OutFolder
    what: Annotated[str, Option(f"The message of each step: {', '.join(WHAT)}.")] = "ground-truth"
    file_format: Annotated[str, Option("osi: messages with their lengths; or mcap.", ("--format",))] = "osi"
    driver: RunDriver = ""
    seed: RunSeed = None
    allow_outside: AllowOutside = False

    def __post_init__(self) -> None:
        for value, values, flag in ((self.what, WHAT, "--what"), (self.file_format, FILE_FORMATS, "--format")):
            if value not in values:
                raise ValueError(f"{flag} {value} does not exist; write one of {', '.join(values)}")


def to_osi(options: OsiOptions, tell: Tell) -> Imported:
    """Write runs as ASAM OSI 3.8 traces, a message for each 0.05 s.

    [dim]foresee export osi scenarios/scenario7.foresee::r01 --out traces
    foresee export osi out/children/scenario7/*.foresee --what sensor-view --format mcap --out traces[/dim]
    """
    from foresee_bridges.osi import exporter

    return exporter.run(
        options.addresses,
        out=options.out,
        what=options.what,
        file_format=options.file_format,
        driver=options.driver,
        seed=options.seed,
        allow_outside=options.allow_outside,
        tell=tell,
    )
