"""Measures the cost of a step by part with 10, 100 and 1,000 actors, and the power of their number with which it
grows."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

from benchmarks.by_part import measured, microseconds_a_step
from benchmarks.sections import table
from foresee_dsl.compile import compile_test_case
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.measuring import Part

NUMBERS = (10, 100, 1000)
A_BLOCK = 10
"""Number of actors per block of the row, so that the density does not depend on their number."""
BLOCK_M = 200
MOST = 500
"""Maximum number of actors of one `traffic` statement."""
SIMULATED_S = 5.0
LINEAR = 1.1
"""A part grows faster than the number of actors if its power is above this (ours: repeats differ by 0.1)."""
ROUNDS = 3


def scene(actors: int) -> str:
    """Return a scenario with a number of actors on a row of crossings: of ten, seven drive in traffic, two walk, and
    one brakes when the ego approaches."""
    blocks = max(1, round(actors / A_BLOCK))
    joints, roads = [], []
    for k in range(blocks + 2):
        joints.append(f"    junction c{k} at ({k * BLOCK_M} m, 0 m)")
        if k <= blocks:
            roads.append(f"    road main{k} from c{k} to c{k + 1} {{ lanes 2; back 2; sidewalk 2 m }}")
        if 0 < k <= blocks:
            joints += [
                f"    junction n{k} at ({k * BLOCK_M} m, 90 m)",
                f"    junction s{k} at ({k * BLOCK_M} m, -90 m)",
            ]
            roads += [f"    road up{k} from s{k} to c{k} {{ lanes 1; back 1; sidewalk 2 m }}",
                      f"    road on{k} from c{k} to n{k} {{ lanes 1; back 1; sidewalk 2 m }}"]  # fmt: skip
    route = ", ".join(f"main{k}" for k in range(blocks + 1))
    body = [
        "foresee 1", "", "scenario row {", "  network row {", *joints, *roads, "  }", "",
        f"  ego: car.sedan {{ route [{route}]; start at 100 m along main0; start speed 36 km/h; speed 40 km/h }}",
    ]  # fmt: skip
    for k in range(blocks):
        body += [
            f"  vehicle v{k}: car.compact {{",
            f"    route [main{k}, main{k + 1}]; start at 150 m along main{k}; speed 30 km/h",
            "  }",
            f"  when distance(ego, v{k}) < 12 m and ego.speed > 5 m/s {{ v{k} stops for 1 s }}",
        ]
    rest = actors - 1 - blocks
    walkers = round(rest * 2 / 9)
    for name, count, models in (("cars", rest - walkers, "car.compact, car.suv, van.delivery"),
                                ("people", walkers, "pedestrian.adult, pedestrian.jogger")):  # fmt: skip
        for part, begins in enumerate(range(0, count, MOST)):
            body.append(f"  traffic {name}{part} {{ count {min(MOST, count - begins)}; models [{models}]; "
                        f"within 90 m of ego.route; seed {part + 1} }}")  # fmt: skip
    return "\n".join([*body, f"  end after {SIMULATED_S:g} s", "}", ""])


def costs(actors: int) -> tuple[int, float, Mapping[Part, float]]:
    """Return the number of actors, the CPU time before the first frame, ms, and the cost of a step by part, us."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "row.foresee"
        file.write_text(scene(actors), encoding="utf-8")
        bundle = compile_test_case(load_test_case(str(file)))
        measurement = measured(bundle, ROUNDS)
    return len(bundle.scene.actors), measurement.spent[Part.PLACING].cpu_ns / 1e6, microseconds_a_step(measurement)


def power(few: float, many: float, times: float) -> float:
    """Return the power with which a cost grew when a quantity grew by the factor `times`."""
    return math.log(many / few) / math.log(times) if few > 0 and many > 0 else math.nan


def text() -> str:
    """Measure, and return the table."""
    results = [costs(number) for number in NUMBERS]
    counts = [count for count, _, _ in results]
    rows = []
    worse = []
    parts = [part for part in results[-1][2] if part in results[0][2]]
    named = [(part.title, [steps[part] for _, _, steps in results]) for part in parts]
    named.append(("a step", [sum(steps.values()) for _, _, steps in results]))
    named.append(("placing all actors (ms a run)", [before for _, before, _ in results]))
    for title, each in named:
        powers = [power(a, b, m / n) for (a, b), (n, m) in zip(pairwise(each), pairwise(counts), strict=True)]
        rows.append((title, *(f"{value:.1f}" for value in each), *(f"{value:.2f}" for value in powers)))
        if powers[-1] > LINEAR and title != Part.SUMO.title:
            worse.append(title)
    headings = ("us of CPU a step", *(f"{count} actors" for count in counts),
                *(f"power {a} to {b}" for a, b in pairwise(counts)))  # fmt: skip
    faster = f"Grows faster than the number of actors: {', '.join(worse)}." if worse else (
        "No part but SUMO's step grows faster than the number of actors."
    )  # fmt: skip
    return f"{table(headings, rows)}\n{faster}\n"
