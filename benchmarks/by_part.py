"""Measures the cost of runs by part of the tool, in this process, with the clock of `foresee run --profile`."""

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
"""The parts of the tool that run in every step."""


def measured(bundle: SumoBundle, rounds: int) -> Measurement:
    """Return the cheapest of some runs with `pdm`, after a first run that does not count."""
    run(bundle, PdmDriver(), seed=0)
    clock = Clock(exactly=True)
    measurements = []
    measuring.start(clock)
    try:
        for _ in range(rounds):
            clock.take()
            run(bundle, PdmDriver(), seed=0)
            measurements.append(clock.take())
    finally:
        measuring.start(None)
    return min(
        measurements,
        key=lambda measurement: sum(measurement.spent[part].cpu_ns for part in OF_STEPS if part in measurement.spent),
    )


def microseconds_a_step(measurement: Measurement) -> Mapping[Part, float]:
    """Return the CPU time of a step by part, us."""
    steps = measurement.decisions + 1
    return MappingProxyType({p: measurement.spent[p].cpu_ns / steps / 1000 for p in OF_STEPS if p in measurement.spent})


def added(measurements: Iterable[Measurement]) -> Measurement:
    """Return the sum of measurements."""
    return sum(measurements, Measurement())
