"""The cost of a scan of a busy street per step (every second step has a scan), and in units of numpy operations."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable, Iterator
from statistics import median

import numpy as np

from benchmarks.figures import Figure, costs
from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.simulate.sensing import STANDARD
from foresee_dsl.simulate.sensing.objects import ObjectList
from foresee_dsl.simulate.sensing.sight import Bodies, Sight
from foresee_dsl.simulate.trace import STEP_S

ACTORS, BUILDINGS = 25, 40
"""Numbers of actors and buildings within 90 m of the ego (required)."""
SCANS, ROUNDS = 200, 9
_MOST_S = 150e-6
"""Target of the cost of a step, s (required)."""
_OVER_NUMPY = 8.0
"""Target of a scan over 100 small numpy operations. Ours: measured 6.6 on a busy machine of two cores."""
_BLOCK_M, _STREET_M = 30.0, 20.0
_CAR = (4.4, 1.8, 1.5)


def figures() -> Iterator[Figure]:
    """Measure, and return the figures of the sensors."""
    taken = costs({"scan": _scanner(), "numpy": _yardstick}, ROUNDS)
    scan, yardstick = (median(taken[name][0]) for name in ("scan", "numpy"))
    a_step = scan * STEP_S / STANDARD.scan_s
    yield Figure("sensing_step_s", a_step, "s", "sensing 25 actors among 40 buildings, a step", _MOST_S)
    yield Figure("sensing_over_numpy", scan / yardstick, "ratio", "a scan over 100 small numpy operations", _OVER_NUMPY)


def _scanner() -> Callable[[], float]:
    """Return a function that measures scans of objects on a grid of streets, along one of which the ego drives."""
    rng = random.Random(1)
    pitch = _BLOCK_M + _STREET_M
    half = _BLOCK_M / 2
    middles = [((i + 0.5) * pitch, (j + 0.5) * pitch) for i in range(-4, 4) for j in range(-3, 2)][:BUILDINGS]
    blocks = [
        ((x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half)) for x, y in middles
    ]
    length, width, height = _CAR
    car = ModelSpec("car", "car", length, width, 2.6, 0.9, 1500, 50, 2.6, 4.5, 9, 0.6, 0.7, height_m=height)
    rows: list[tuple[float, float, float, float]] = []
    while len(rows) < ACTORS:
        street, along = rng.choice((-1, 0, 0, 1)) * pitch, rng.uniform(-70, 70)
        rows.append((along, street + rng.choice((-3.5, 3.5)), rng.choice((0.0, math.pi)), rng.uniform(0, 14)))
    states = np.array(rows)
    bodies = Bodies.of([car] * ACTORS)
    sight = Sight(bodies, blocks, STANDARD)
    objects = ObjectList(bodies, [f"a{k}" for k in range(ACTORS)], sight, STANDARD, seed=1)

    def scans() -> float:
        spent = []
        for frame in range(SCANS):
            pose = (0.04 * frame, 0.0, 0.0)
            began = time.perf_counter()
            objects.measure(frame, pose, pose, states)
            spent.append(time.perf_counter() - began)
        return median(spent)  # other programs may use the machine meanwhile

    return scans


def _yardstick() -> float:
    """Return the time of 100 numpy operations on arrays of the size of a scan, s."""
    values = np.linspace(0.0, 1.0, 500)
    spent = []
    for _ in range(SCANS):
        began = time.perf_counter()
        for _ in range(100):
            np.multiply(values, values)
        spent.append(time.perf_counter() - began)
    return median(spent)
