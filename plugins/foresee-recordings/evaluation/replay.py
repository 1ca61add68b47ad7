"""Drives mined test cases as they were recorded: the recorded drive itself must pass.

python -m evaluation.replay FOLDER
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.tracks import read_tracks
from foresee_dsl.drivers.protocol import Mission, Observation, Trajectory, VehicleLimits
from foresee_dsl.language import model as m
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.simulate.runner import run

CONSOLE = Console(soft_wrap=True, highlight=False)


@dataclass
class AsRecorded:
    """A driver that answers the recorded trajectory of the ego."""

    plan: Trajectory
    name: str = "as_recorded"
    version: str = "1"

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Nothing has to be forgotten."""

    def step(self, observation: Observation) -> Trajectory:
        """Return the same trajectory at each step."""
        return self.plan


def trajectory_of(case: TestCase) -> Trajectory:
    """Return the ego's recorded track as a trajectory."""
    ego = case.scenario.first(m.Ego)
    assert ego is not None and case.tracks is not None
    (name,) = (item.name for item in ego.body if isinstance(item, m.Track))
    track = read_tracks(case.tracks)[name]
    points = np.column_stack([track.x, track.y])
    times, heading, speed = (np.array(values) for values in (track.time_s, track.heading_rad, track.speed_mps))
    return Trajectory(times, points, heading, np.maximum(speed, 0.0))


def drive_as_recorded(case: TestCase) -> RunResult:
    """Run a test case with the recorded drive of its ego, without traffic rules."""
    return run(compile_test_case(case), AsRecorded(trajectory_of(case)), seed=0, rules="off")


def main() -> None:
    """Print how each test case ends, and how far the ego was from its track."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    for case in load_test_cases([str(parser.parse_args().folder)]):
        result = drive_as_recorded(case)
        tracking = "" if result.tracking is None else result.tracking.sentence
        CONSOLE.print(
            f"{Path(case.id).stem:45} {result.verdict.value:8} {result.time_s:6.2f} s  {result.reason}  {tracking}"
        )


if __name__ == "__main__":
    main()
