"""The cost of the learned drivers' pictures with 25 actors around the ego in the town."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec

import numpy as np

from benchmarks.figures import Figure, costs
from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.protocol import SignalColour
from foresee_dsl.files import data_folder
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.mission import mission_of

ACTORS = 25
"""Number of actors (required): a town's traffic."""
ROUNDS = 200
_AROUND_M = 45.0
"""Half the side of the square with the actors, m: all are in the picture from above, and a quarter before the
camera."""
_COPIES = 20
"""Number of copies of 192 x 192 x 19 bytes with which a picture is compared. They take about as long as a picture's
work on whole planes, and use memory in the same way."""
_MOST = 4.0
"""Target of a picture over the copies. Ours: 1 ms is required, and the copies took 0.25 to 0.35 ms on the measured
machine; pictures took 2.2 to 2.4 times as long."""


def figures() -> Iterator[Figure]:
    """Measure, and return the figures of the pictures; none without the plug-in that draws them."""
    if find_spec("foresee_learned") is None:
        return
    from foresee_learned.rasters import Canvas, stops_of
    from foresee_learned.rasters.ground import GroundMap

    bundle = compile_test_case(load_test_case(data_folder("scenarios") / "scenario9.foresee::r01"))
    mission, rng = mission_of(bundle), np.random.default_rng(1)
    canvas = Canvas.of_mission(bundle.network, mission, (4.5, 1.8))
    k = int(np.searchsorted(mission.s, mission.start_s + 30.0))
    (x, y), (east, north) = mission.centreline[k], mission.centreline[k + 1] - mission.centreline[k]
    pose = (float(x), float(y), math.atan2(north, east))
    places = np.array((x, y)) + rng.uniform(-_AROUND_M, _AROUND_M, (ACTORS, 2))
    moving = np.column_stack((rng.uniform(-3.0, 3.0, ACTORS), rng.uniform(0.0, 14.0, ACTORS)))
    sizes, groups = np.full((ACTORS, 2), (4.5, 1.8)), rng.integers(0, 4, ACTORS)
    actors = np.hstack((places, moving, sizes))
    bodies = np.column_stack((places, moving[:, 0], sizes, np.full(ACTORS, 1.6)))
    signals: dict[str, SignalColour] = {stop.signal: "red" for stop in stops_of(mission) if stop.signal is not None}
    source, target = np.zeros((19, 192, 192), np.uint8), np.zeros((19, 192, 192), np.uint8)

    def copies() -> None:
        for _ in range(_COPIES):
            np.copyto(target, source)

    works: dict[str, Callable[[], object]] = {
        "copies": copies,
        "birds_eye": lambda: canvas.birds_eye(pose, actors, groups, signals),
        "forward": lambda: canvas.forward(pose, bodies, groups, signals),
    }
    for work in works.values():  # draws the map
        work()
    samples = costs({name: partial(_seconds, work) for name, work in works.items()}, ROUNDS)
    middle = {name: float(np.median(kinds[0])) for name, kinds in samples.items()}
    size = GroundMap.of(bundle.network).bits.size / 1e6
    for name in ("birds_eye", "forward"):
        yield Figure(
            f"{name}_over_copies",
            middle[name] / middle["copies"],
            "ratio",
            f"one picture of {ACTORS} actors on a map of {size:.0f} MB ({1e3 * middle[name]:.2f} ms), over"
            f" {_COPIES} copies of 0.7 MB",
            _MOST,
        )


def _seconds(work: Callable[[], object]) -> float:
    """Return the wall time of a call, s; the clock of CPU time is too coarse for this."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start
