"""Runs as SUMO's floating car data: `NAME.fcd.xml`, and the vehicle types in `NAME.add.xml`.

Positions are those of the middle of the front bumper, angles are degrees clockwise from north, as SUMO writes them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from foresee_recordings.exporting.runs import Run, lost_in_all, render
from foresee_recordings.recording import Track

_CLASSES: Mapping[str, str] = {
    "car": "passenger", "van": "delivery", "truck": "truck", "bus": "bus", "motorcycle": "motorcycle",
    "bicycle": "bicycle", "pedestrian": "pedestrian", "obstacle": "ignoring",
}  # fmt: skip
"""SUMO's classes of our kinds; `ignoring` is the one of things that may be anywhere."""


class _Sample(NamedTuple):
    """An actor at a time: what SUMO writes of it."""

    id: str
    x: float
    y: float
    angle: float
    type: str
    speed: float


class _Step(NamedTuple):
    """A timestep: vehicles (obstacles too) come before persons, as in SUMO's schema."""

    time_s: float
    vehicles: list[_Sample]
    persons: list[_Sample]


def write(folder: Path, run: Run) -> None:
    """Write the files of a run."""
    types = {run.models[track.id]: track for track in run.recording.tracks}
    rows = [(name, _CLASSES[track.kind], track.length_m, track.width_m) for name, track in sorted(types.items())]
    render(folder / f"{run.name}.add.xml", "vehicle_types.add.xml", types=rows)
    render(folder / f"{run.name}.fcd.xml", "fcd.xml", steps=_steps(run))


def left_out(run: Run) -> Counter[str]:
    """Return counts of what FCD does not express."""
    return lost_in_all(run) + Counter({"signals": len(run.bundle.signals)})


def _steps(run: Run) -> Iterator[_Step]:
    samples: dict[float, _Step] = {float(time): _Step(float(time), [], []) for time in run.trace.time_s}
    for track in run.recording.tracks:
        for time_s, sample in zip(track.time_s.tolist(), _samples(track, run.models[track.id]), strict=True):
            step = samples[time_s]
            (step.persons if track.kind == "pedestrian" else step.vehicles).append(sample)
    return iter(samples.values())


def _samples(track: Track, type_: str) -> Iterator[_Sample]:
    half = track.length_m / 2
    for x, y, heading, speed in track.states.tolist():
        front = x + half * math.cos(heading), y + half * math.sin(heading)
        yield _Sample(track.id, *front, (90.0 - math.degrees(heading)) % 360.0, type_, abs(speed))
