"""Measures the cost of a step by part with `pdm`: the cheapest of some runs of each of 20 clips of the bundled library.

As a program it prints JSON, so that two versions of this project can be measured alternately.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping

from benchmarks import library
from benchmarks.by_part import added, measured, microseconds_a_step
from benchmarks.sections import table
from foresee_dsl.campaign.profiling.clock import Measurement
from foresee_dsl.measuring import Part

ROUNDS = 3


def costs() -> tuple[Mapping[Part, float], float]:
    """Return the cost of a step by part, us, and the time before the first frame of a run, ms."""
    measurement: Measurement = added(measured(clip, ROUNDS) for clip in library.clips())
    return microseconds_a_step(measurement), measurement.spent[Part.PLACING].cpu_ns / measurement.runs / 1e6


def text() -> str:
    """Measure, and return the table."""
    steps, placing_ms = costs()
    whole = sum(steps.values())
    rows = [
        (part.title, f"{us:.1f}", f"{us / whole:.0%}") for part, us in sorted(steps.items(), key=lambda item: -item[1])
    ]
    rows += [("a step", f"{whole:.1f}", "100%"), (f"{Part.PLACING.title} (ms a run)", f"{placing_ms:.1f}", "")]
    return table(("20 clips of the library", "us of CPU a step", "share"), rows)


if __name__ == "__main__":
    part_costs, placing_ms = costs()
    sys.stdout.write(json.dumps({**{part.value: us for part, us in part_costs.items()}, "placing_ms": placing_ms}))
