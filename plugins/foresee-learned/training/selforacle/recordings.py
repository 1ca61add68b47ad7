"""Pictures from what `training.record` and `training.dagger` recorded: runs in the bundled town that a driver passed.

    python -m training.selforacle.recordings --folder FOLDER --driver fusion --out FOLDER

Driving with a learned driver takes long, and DAgger has done it already. These runs are drawn cases of the library's
scenarios, some with noise in the controls, so that they are less nominal than rides. Only whole runs without a failure
are taken; of each, the frames that were kept for training, which are denser where something happens.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from foresee_study.selforacle.pictures import PALETTE, classes_of
from numpy.typing import NDArray

from training.samples import RecordedRun, read
from training.selforacle.packing import Rides, save

IN_TOWN = "scenario"
"""Beginning of the names of the library's cases; all others are on other networks."""


def pictures_of_run(run: RecordedRun, number: int) -> Rides:
    """Return the pictures of a run; each is a segment of its own."""
    frames = run.labelled.tolist()
    classes = np.stack([classes_of(forward_view(run, k)) for k in frames])
    run.forget_views()
    ride = np.full(len(frames), number, np.int32)
    return Rides(classes, ride, np.arange(len(frames), dtype=np.int32), PALETTE)


def forward_view(run: RecordedRun, frame: int) -> NDArray[np.uint8]:
    """Return the camera's picture in a frame."""
    views = run.observation(frame).views
    if views is None:
        raise ValueError("a recorded observation has pictures")
    return views.forward()


def main() -> None:
    """Draw the pictures of all runs of a driver."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--driver", default="fusion")
    parser.add_argument("--first", type=int, default=100_000, help="number of the first run")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    number = options.first
    for file in sorted(options.folder.glob(f"*_{options.driver}_[0-9]*.npz")):
        runs = [run for run in read(file) if run.about["driver"] == options.driver]
        runs = [run for run in runs if run.about["verdict"] == "pass" and str(run.about["name"]).startswith(IN_TOWN)]
        kept = [pictures_of_run(run, number + k) for k, run in enumerate(runs)]
        if kept:
            save(Rides.joined(kept), options.out / f"{options.driver}_{number:06d}.npz")
        number += len(kept)
        print(f"{file.name}: {len(kept)} runs, {sum(map(len, kept))} pictures", flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
