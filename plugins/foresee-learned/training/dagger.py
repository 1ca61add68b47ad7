"""Records the expert's labels in runs that a learned driver drives (DAgger, Ross et al. 2011).

    python -m training.dagger --driver fusion --weights weights/round1 --round 1 --hours 1.5 --out FOLDER --jobs 2

A run ends when the ego has hit an actor or left the road. If the pupil stands although the expert would drive, the
expert drives for some seconds. It also drives in a random share (`--share`) of all stretches of 4 s, so that situations
behind an obstacle to the pupil are recorded too.
"""

from __future__ import annotations

import argparse
import os
import random
from functools import partial
from pathlib import Path

from foresee_dsl.drivers.registry import load_driver
from training.plan import TOWN_SHARE, bundled_meanings, plan
from training.record import CARLA, Job, record_all

SHARE = 0.15
_BURSTS = 0.3
_CHUNK = 8


def seed_of(number: int, driver: str) -> int:
    """Return the seed of a round of a driver; every round has its own cases and drives."""
    return 1000 * number + sum(driver.encode()) % 997


def main() -> None:
    """Read the command line and record."""
    parser = argparse.ArgumentParser(prog="python -m training.dagger", description="Record where a driver goes.")
    parser.add_argument("--driver", required=True, help="name of an installed driver")
    parser.add_argument("--weights", type=Path, help="folder of its weights (FORESEE_WEIGHTS)")
    parser.add_argument("--round", type=int, required=True, help="number of the round, from 1 on")
    parser.add_argument("--hours", type=float, required=True, help="how long is driven, in simulated time")
    parser.add_argument("--out", type=Path, required=True, help="folder of the files")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--share", type=float, default=SHARE, help="share of the time that the expert drives")
    parser.add_argument("--focus", action="append", default=[], help="file name of a scenario to draw more cases of")
    parser.add_argument("--towns", type=float, default=TOWN_SHARE, help="share of the time that is driven in towns")
    parser.add_argument("--carla", type=Path, default=CARLA, help="folder of CARLA's maps")
    options = parser.parse_args()
    if options.weights is not None:
        os.environ["FORESEE_WEIGHTS"] = str(options.weights.resolve())
    carla = options.carla if options.carla.is_dir() else None
    name = f"round{options.round}_{options.driver}"
    seed = seed_of(options.round, options.driver)
    pieces = plan(
        options.hours, seed, options.out / f"work_{name}", carla=carla, bursts=_BURSTS,
        focus=options.focus, chunk=_CHUNK, towns=options.towns,
    )  # fmt: skip
    bundled = bundled_meanings()
    jobs = [
        Job(items, options.out / f"{name}_{k:03d}.npz", bundled, partial(load_driver, options.driver),
            options.share)
        for k, items in enumerate(pieces)
    ]  # fmt: skip
    random.Random(seed).shuffle(jobs)  # so that an interrupted recording has some runs of each kind
    record_all(jobs, options.jobs)


if __name__ == "__main__":
    main()
