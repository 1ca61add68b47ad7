"""Recorded runs: their files give back what the driver saw, and what the expert would have done."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from training.columns import packed, unpacked
from training.driving import Disturbance, record
from training.samples import RecordedRun, read
from training.shards import write_shard

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.drivers.pdm import PdmDriver
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.sensing import IDEAL
from foresee_dsl.simulate.trace import HEADING, X, Y

SEED = 11
SECONDS = 11.0


class _Pupil:
    """Drives straight on as `pdm` does, and keeps what it saw and the pictures of each half second."""

    name, version = "pupil", "1"

    def __init__(self) -> None:
        self.seen: dict[float, tuple[Observation, bytes, bytes]] = {}
        self._driver = PdmDriver()

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        self._driver.reset(mission, vehicle, seed)

    def step(self, observation: Observation) -> Control:
        if round(observation.time_s * 20) % 10 == 0:
            views = observation.views
            assert views is not None
            self.seen[observation.time_s] = observation, views.birds_eye().tobytes(), views.forward().tobytes()
        return self._driver.step(observation)


@dataclass(frozen=True)
class Recorded:
    """A recorded run, what its driver saw, and what its trace says of where the ego was."""

    bundle: SumoBundle
    run: RecordedRun
    pupil: _Pupil
    poses: np.ndarray


@pytest.fixture(scope="module")
def recorded(scenarios: Path) -> Recorded:
    bundle = compile_test_case(load_test_case(f"{scenarios}/scenario3/behind_the_bus.foresee::luggage_in_the_rain"))
    bundle = replace(bundle, scene=replace(bundle.scene, end_s=SECONDS))
    pupil = _Pupil()
    found, result = record(bundle, SEED, {"family": "3"}, pupil=pupil, easy=100.0)
    assert found is not None
    return Recorded(bundle, found, pupil, result.trace.states[:, 0][:, [X, Y, HEADING]])


@pytest.fixture(scope="module")
def expert(recorded: Recorded) -> tuple[RecordedRun, RunResult]:
    """The same case driven by the expert."""
    found, result = record(recorded.bundle, SEED, {}, easy=100.0)
    assert found is not None
    return found, result


def test_a_recorded_observation_draws_the_same_pictures(recorded: Recorded, tmp_path: Path) -> None:
    write_shard(tmp_path / "exact.npz", [recorded.run], exact=True)
    (back,) = read(tmp_path / "exact.npz")
    compared = 0
    for k in back.labelled.tolist():
        if back.time_s(k) not in recorded.pupil.seen:
            continue
        seen, above, ahead = recorded.pupil.seen[back.time_s(k)]
        observation = back.observation(k)
        assert (observation.ego, observation.signals) == (seen.ego, seen.signals)
        assert observation.measured_s == seen.measured_s
        assert set(observation.actors) <= set(seen.actors)
        views = observation.views
        assert views is not None
        assert views.birds_eye().tobytes() == above
        assert views.forward().tobytes() == ahead
        compared += 1
    assert compared > 15


def test_rounded_files_are_small_and_show_nearly_the_same(recorded: Recorded, tmp_path: Path) -> None:
    write_shard(tmp_path / "exact.npz", [recorded.run], exact=True)
    write_shard(tmp_path / "rounded.npz", [recorded.run])
    assert (tmp_path / "rounded.npz").stat().st_size < 0.75 * (tmp_path / "exact.npz").stat().st_size
    (back,) = read(tmp_path / "rounded.npz")
    assert np.array_equal(back.labelled, recorded.run.labelled)
    other, pixels = 0, 0
    for k in back.labelled.tolist()[::5]:
        for view in ("birds_eye", "forward"):
            one, two = (getattr(of.observation(k).views, view)() for of in (back, recorded.run))
            other, pixels = other + int((one != two).sum()), pixels + one.size
        mine, exact = back.labels(k), recorded.run.labels(k)
        np.testing.assert_allclose(mine.trajectory, exact.trajectory, atol=0.011)
        np.testing.assert_allclose(mine.boxes[:, [0, 1, 3, 4, 5]], exact.boxes[:, [0, 1, 3, 4, 5]], atol=0.06)
        np.testing.assert_allclose(np.cos(mine.boxes[:, 2] - exact.boxes[:, 2]), 1.0, atol=1e-4)
        assert (mine.stop, mine.signal, mine.groups.tolist()) == (exact.stop, exact.signal, exact.groups.tolist())
    assert other / pixels < 0.002


def test_the_past_of_every_labelled_frame_is_there(recorded: Recorded) -> None:
    run_ = recorded.run
    later = [k for k in run_.labelled.tolist() if run_.time_s(k) >= 1.0]
    assert len(later) > 25
    for k in later:
        for back_s in (0.5, 1.0):
            j = run_.past(k, back_s)
            assert j is not None
            assert run_.time_s(j) == pytest.approx(run_.time_s(k) - back_s)
    first = int(run_.labelled[0])
    assert run_.past(first, run_.time_s(first) + 0.5) is None


def test_the_same_run_gives_the_same_bytes(recorded: Recorded, tmp_path: Path) -> None:
    bundle = replace(recorded.bundle, scene=replace(recorded.bundle.scene, end_s=4.0))
    for name in ("one", "two"):
        found, _ = record(bundle, SEED, {"family": "3"}, pupil=PdmDriver(), easy=100.0)
        assert found is not None
        write_shard(tmp_path / f"{name}.npz", [found])
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()


def test_the_expert_in_the_shadow_drives_as_pdm_with_ideal_sensors(
    recorded: Recorded, expert: tuple[RecordedRun, RunResult]
) -> None:
    """It decides ten times a second and knows only signals that are in view: a small difference, no other driving."""
    _, result = expert
    pdm = run(recorded.bundle, PdmDriver(), seed=SEED, sensors=IDEAL)
    frames = min(result.trace.frames, pdm.trace.frames)
    apart = np.hypot(*(result.trace.states[:frames, 0, :2] - pdm.trace.states[:frames, 0, :2]).T)
    assert apart.max() < 1.5


def test_the_expert_goes_where_it_said_while_it_drives(expert: tuple[RecordedRun, RunResult]) -> None:
    found, result = expert
    states, errors = result.trace.states[:, 0], []
    for k in found.labelled.tolist():
        frame = int(found.frames[k, 0])
        if frame + 20 >= len(states):
            break
        x, y, heading = states[frame, [X, Y, HEADING]]
        dx, dy = states[frame + 20, [X, Y]] - (x, y)
        went = np.array((np.cos(heading) * dx + np.sin(heading) * dy, np.cos(heading) * dy - np.sin(heading) * dx))
        errors.append(np.hypot(*(found.labels(k).at([1.0])[0] - went)))
    assert len(errors) > 25
    assert np.median(errors) < 0.4


def test_disturbances_move_the_ego_and_stay_out_of_the_labels(
    recorded: Recorded, expert: tuple[RecordedRun, RunResult]
) -> None:
    found, result = record(recorded.bundle, SEED, {}, disturbance=Disturbance(True, True, 2.0), easy=100.0)
    assert found is not None
    plain, _ = expert
    start = recorded.bundle.scene.ego
    x, y, heading = result.trace.states[0, 0, [X, Y, HEADING]]
    assert (x, y, heading) != pytest.approx(tuple(plain.ego[0, 7:]))
    assert np.hypot(x - plain.ego[0, 7], y - plain.ego[0, 8]) < 1.5
    assert abs(heading - start.heading_rad) < 0.3
    # The wheels were turned far more than the expert ever asks for on this street.
    assert np.abs(found.ego[:, 6]).max() > np.abs(plain.ego[:, 6]).max()


@pytest.mark.parametrize("step", [0.02, 1.0, None])
def test_columns_come_back(step: float | None) -> None:
    rng = np.random.Generator(np.random.PCG64(3))
    values = rng.normal(0, 300, 1000)
    values = values if step is None else np.rint(values / step) * step
    np.testing.assert_allclose(unpacked(packed(values, step), step), values, atol=0 if step is None else 1e-9)
    assert len(unpacked(packed(np.empty(0), step), step)) == 0


def test_a_value_too_large_for_its_steps_is_refused() -> None:
    with pytest.raises(ValueError, match="cannot be kept"):
        packed(np.array([1e12]), 0.01)
