"""Samples: training makes its inputs from recordings as the drivers make theirs, and labels mean what outputs say."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foresee_learned.inputs import CHANNELS, GOALS_M, VECTOR, InputMaker, LearnedInputs
from foresee_learned.outputs import DENSITY_CHANNELS, DENSITY_ROWS, Occupied, road_users, target_speed
from foresee_learned.rasters.layout import GROUPS
from training.dataset import BOXES, PLANES, SAMPLE, Job, _drawn, density_labels, importance, inputs_of
from training.driving import record
from training.samples import Labels, RecordedRun
from training.shards import write_shard

from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.pdm import PdmDriver
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.language.project.loading import load_test_case

SECONDS = 7.0


class _Pupil:
    """Drives as `pdm` does and makes inputs ten times a second, as the learned drivers do."""

    name, version = "pupil", "1"

    def __init__(self) -> None:
        self.seen: dict[float, LearnedInputs] = {}
        self._driver = PdmDriver()

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        self._driver.reset(mission, vehicle, seed)
        self._maker = InputMaker(mission, vehicle)

    def step(self, observation: Observation) -> Control:
        if round(observation.time_s * 20) % 2 == 0:
            self.seen[observation.time_s] = self._maker.make(observation)
        return self._driver.step(observation)


@pytest.fixture(scope="module")
def driven(scenarios: Path) -> tuple[_Pupil, RecordedRun]:
    bundle = compile_test_case(load_test_case(f"{scenarios}/scenario3/behind_the_bus.foresee::commuter"))
    bundle = replace(bundle, scene=replace(bundle.scene, end_s=SECONDS))
    pupil = _Pupil()
    run, _ = record(bundle, 3, {"family": "3", "hash": "some case"}, pupil=pupil, easy=100.0)
    assert run is not None
    return pupil, run


def test_training_sees_what_the_driver_saw(driven: tuple[_Pupil, RecordedRun]) -> None:
    pupil, run = driven
    compared = moved = 0
    for k, inputs in inputs_of(run):
        seen = pupil.seen[run.time_s(k)]
        assert inputs.birds_eye.tobytes() == seen.birds_eye.tobytes()
        assert inputs.forward.tobytes() == seen.forward.tobytes()
        np.testing.assert_allclose(inputs.vector, seen.vector, atol=1e-4)
        past, now = seen.birds_eye[-2:].any(axis=0), seen.birds_eye[[CHANNELS.index(g) for g in GROUPS]].any(axis=0)
        moved += int((past & ~now).sum())
        compared += 1
    assert compared > 12
    assert moved > 0


def test_goal_points_lie_on_the_route_ahead(driven: tuple[_Pupil, RecordedRun]) -> None:
    pupil, _ = driven
    for inputs in pupil.seen.values():
        vector = dict(zip(VECTOR, inputs.vector.tolist(), strict=True))
        for distance in GOALS_M:
            ahead, left = (vector[f"goal_{distance:.0f}_m_{axis}"] for axis in ("ahead_m", "left_m"))
            assert math.hypot(ahead, left) <= distance + 1.0
            row, column = math.floor((48 - ahead) / 0.5), math.floor((32 - left) / 0.5)
            route = inputs.birds_eye[CHANNELS.index("route"), row - 1 : row + 2, column - 1 : column + 2]
            assert route.any()


def test_drawn_files_hold_the_pictures_as_bits(driven: tuple[_Pupil, RecordedRun], tmp_path: Path) -> None:
    pupil, run = driven
    write_shard(tmp_path / "runs.npz", [run], exact=True)
    count = _drawn(Job(tmp_path / "runs.npz", 0, 1, tmp_path / "0000_00"))
    drawn = {name: np.load(tmp_path / f"0000_00_{name}.npy") for name in SAMPLE.names or ()}
    assert count == len(run.labelled) == len(drawn["planes"])
    for j, k in enumerate(run.labelled.tolist()):
        seen = pupil.seen[run.time_s(k)]
        planes = np.unpackbits(drawn["planes"][j], axis=2, bitorder="little")
        assert np.array_equal(planes * 255, seen.birds_eye[PLANES])
        classes = np.arange(1, 13)[:, None, None] == drawn["classes"][j]
        assert np.array_equal(classes * np.uint8(255), seen.forward[:-1])


def labels_of(*boxes: tuple[float, ...], trajectory: np.ndarray | None = None, kind: str = "vehicle") -> Labels:
    straight = np.column_stack([np.arange(1, 13) * 0.25 * 8.0, np.zeros(12)])
    return Labels(
        trajectory=straight if trajectory is None else trajectory, acceleration_mps2=0.0, steer=0.0,
        target_speed_mps=8.0, stop=False, stop_m=100.0, signal=3, boxes=np.array(boxes).reshape(-1, 6),
        groups=np.full(len(boxes), GROUPS.index(kind)), expert_drives=True,
    )  # fmt: skip


def test_a_density_map_gives_its_road_users_back() -> None:
    boxes = [(12.3, -3.1, 0.5, 4.5, 1.8, 7.0), (39.9, 23.9, 3.0, 10.0, 2.5, 0.0), (-7.9, -23.9, -1.5, 0.5, 0.6, 1.2)]
    cells, users = density_labels(labels_of((60.0, 0.0, 0.0, 4.0, 2.0, 0.0), *boxes))
    assert (cells >= 0).sum() == 3
    density = np.zeros((1, len(DENSITY_CHANNELS), DENSITY_ROWS**2), np.float32)
    density[0, 0, cells[:3]] = 1.0
    density[0, 1:, cells[:3]] = users[:3]
    found = sorted(road_users(density.reshape(1, -1, DENSITY_ROWS, DENSITY_ROWS)), key=lambda user: -user.length_m)
    wanted = sorted(boxes, key=lambda box: -box[3])
    for user, (ahead, left, turned, length, width, speed) in zip(found, wanted, strict=True):
        expected = Occupied(1.0, ahead, left, length, width, turned, speed)
        for name in Occupied.__slots__:
            assert getattr(user, name) == pytest.approx(getattr(expected, name), abs=1e-5)


def test_a_density_map_holds_the_nearest_of_a_crowd() -> None:
    crowd = [(float(x), float(y), 0.0, 0.5, 0.6, 1.0) for x in range(1, 40, 3) for y in range(-20, 21, 5)]
    cells, users = density_labels(labels_of(*crowd))
    assert (cells >= 0).sum() == BOXES == len(set(cells.tolist()))
    rows, columns = cells // DENSITY_ROWS, cells % DENSITY_ROWS
    farthest = np.hypot(40 - (rows + 0.5) * 2 + users[:, 0], 24 - (columns + 0.5) * 2 + users[:, 1]).max()
    assert farthest == pytest.approx(sorted(math.hypot(*box[:2]) for box in crowd)[BOXES - 1], abs=1e-4)


def test_hard_moments_are_drawn_more_often() -> None:
    plain = importance(labels_of(), 8.0, expert_drives=True)
    brakes = np.column_stack([np.cumsum(np.maximum(8 - np.arange(12), 0)) * 0.25, np.zeros(12)])
    assert plain == 1.0
    assert importance(labels_of(trajectory=brakes), 8.0, expert_drives=True) > plain
    assert importance(labels_of(), 0.0, expert_drives=True) > plain  # sets off
    walker = (10.0, 2.0, 1.5, 0.5, 0.6, 1.2)
    assert importance(labels_of(walker, kind="pedestrian"), 8.0, expert_drives=True) > plain
    assert importance(labels_of(walker), 8.0, expert_drives=True) == plain


def test_the_target_speed_is_the_mean_of_its_bins() -> None:
    shares = np.zeros((1, 14), np.float32)
    shares[0, [2, 3]] = 0.25, 0.75
    assert target_speed(shares) == pytest.approx(2.75)
