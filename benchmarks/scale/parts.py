"""What a step of a clip of the bundled library costs by part, with `pdm`: the least of some runs of each of 20 clips.

As a program it prints JSON, so that two versions of this project can be measured in turns.
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
    """Return the microseconds of each part for a step, and the milliseconds before the first frame of a run."""
    found: Measurement = added(measured(clip, ROUNDS) for clip in library.clips())
    return microseconds_a_step(found), found.spent[Part.PLACING].cpu_ns / found.runs / 1e6


def text() -> str:
    """Measure, and return the table."""
    steps, placing_ms = costs()
    whole = sum(steps.values())
    rows = [
        (part.title, f"{us:.1f}", f"{us / whole:.0%}") for part, us in sorted(steps.items(), key=lambda one: -one[1])
    ]
    rows += [("a step", f"{whole:.1f}", "100%"), (f"{Part.PLACING.title} (ms a run)", f"{placing_ms:.1f}", "")]
    return table(("20 clips of the library", "us of CPU a step", "share"), rows)


if __name__ == "__main__":
    found, placing_ms = costs()
    sys.stdout.write(json.dumps({**{part.value: us for part, us in found.items()}, "placing_ms": placing_ms}))
