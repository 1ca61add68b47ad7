"""What runs cost by part of the tool, measured in this process with what `foresee run --profile` measures with."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from foresee_dsl import measuring
from foresee_dsl.campaign.profiling.clock import Clock, Measurement
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.drivers.pdm import PdmDriver
from foresee_dsl.measuring import Part
from foresee_dsl.simulate.runner import run

OF_STEPS = tuple(part for part in Part if part.simulates and part is not Part.DRIVER_BEGINS)
"""The parts that are at work in every step."""


def measured(bundle: SumoBundle, rounds: int) -> Measurement:
    """Return the cheapest of some runs with `pdm`, after one that is not counted."""
    run(bundle, PdmDriver(), seed=0)
    clock = Clock(exactly=True)
    found = []
    measuring.start(clock)
    try:
        for _ in range(rounds):
            clock.take()
            run(bundle, PdmDriver(), seed=0)
            found.append(clock.take())
    finally:
        measuring.start(None)
    return min(found, key=lambda one: sum(one.spent[part].cpu_ns for part in OF_STEPS if part in one.spent))


def microseconds_a_step(found: Measurement) -> Mapping[Part, float]:
    """Return the CPU time of each part for a step, in microseconds."""
    steps = found.decisions + 1
    return MappingProxyType({p: found.spent[p].cpu_ns / steps / 1000 for p in OF_STEPS if p in found.spent})


def added(found: Iterable[Measurement]) -> Measurement:
    """Return several together."""
    return sum(found, Measurement())
