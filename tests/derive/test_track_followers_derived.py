"""Clips and mutants of a run with recorded tracks, in real SUMO: clips are exact, and each operator acts on a track."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.campaign.driving import DriverSetup
from foresee_dsl.campaign.steps.clip import measure_clip
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.compile.tracks import FileTrack, read_tracks
from foresee_dsl.derive.clipping.fidelity import ClipDeviation
from foresee_dsl.derive.mutate import mutate
from foresee_dsl.derive.operators import operators
from foresee_dsl.derive.operators.ours import retimed
from foresee_dsl.derive.operators.situation import Situation
from foresee_dsl.derive.presets import FOCUSED
from foresee_dsl.derive.reach.ranker import ReachRanker
from foresee_dsl.drivers.idm import IdmDriver
from foresee_dsl.errors import InputError
from foresee_dsl.forecast.foresee import ForeseeRanker
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.model import Clip
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import ACCELERATION, SPEED, STEP_S, Trace, X, Y
from tests.support.recorded import write_case


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("recorded")


@pytest.fixture(scope="module")
def case(folder: Path) -> TestCase:
    return load_test_case(write_case(folder))


@pytest.fixture(scope="module")
def trace(case: TestCase) -> Trace:
    return drive(case)


@pytest.fixture(scope="module")
def early(case: TestCase, trace: Trace) -> tuple[TestCase, Trace]:
    """A clip that begins at 1 s, before v118 appears, and its run."""
    clip_case = written(cut(case, trace, 1.0, 6.0), case.source.parent / "early.foresee")
    return clip_case, drive(clip_case)


def drive(case: TestCase) -> Trace:
    return run(compile_test_case(case), IdmDriver(), seed=0).trace


def cut(case: TestCase, trace: Trace, at_s: float, after_s: float = 3.0) -> Clip:
    point = RiskyPoint(1, trace.frame_at(at_s), at_s, "v117", "none", float("nan"), float("nan"), 0.0, "a test")
    clip = clip_around(case, trace, point, case.source.parent / "clip.foresee", before_s=0.0, after_s=after_s)
    assert parse(print_model(clip), "clip.foresee").model == clip
    return clip


def written(model: Clip, file: Path) -> TestCase:
    file.write_text(print_model(model.model_copy(update={"name": file.stem})), encoding="utf-8")
    return load_test_case(file)


def deviation(case: TestCase, trace: Trace, at_s: float) -> ClipDeviation:
    file = case.source.parent / "clip.foresee"
    return measure_clip(cut(case, trace, at_s), case, trace, file, DriverSetup("idm"))[3]


def child_of(clip_case: TestCase, *lines: str) -> TestCase:
    text = f'foresee 1\n\nmutant child of "{clip_case.source.name}" pin {pin_of(clip_case)} {{\n'
    text += "".join(f"  change {line}\n" for line in lines) + "}\n"
    file = clip_case.source.parent / "child.foresee"
    file.write_text(text, encoding="utf-8")
    return load_test_case(file)


def states(trace: Trace, actor: str = "v117") -> np.ndarray:
    return trace.states[:, trace.index(actor)]


def track_of(folder: Path, name: str = "117") -> FileTrack:
    return read_tracks(folder / "cut.tracks.csv")[name]


@pytest.mark.parametrize("at_s", [0.0, 1.0, 2.0, 3.4, 4.0, 4.1, 6.5])
def test_a_clip_goes_on_exactly(at_s: float, case: TestCase, trace: Trace) -> None:
    found = deviation(case, trace, at_s)
    assert set(found.actors) == {"ego", "v117", "v118", "parked", *(["p9"] if at_s <= 4.0 else [])}
    assert found.largest_others_m < 1e-4  # rounding of the states of vehicles that SUMO drives
    assert max(found.actors[name] for name in ("v117", "parked")) == 0.0


def test_a_clip_names_the_time_of_each_track(case: TestCase, trace: Trace) -> None:
    text = print_model(cut(case, trace, 1.0))
    for name in ("112", "117", "118", "p9", "parked"):
        assert f'track "{name}" from 1.00 s\n' in text
    assert "when time >= 3.00 s {\n    v118 leaves track" in text
    late = " ".join(print_model(cut(case, trace, 6.5)).split())
    assert "p9" not in late
    assert 'vehicle v117: car.compact { track "117" from 6.50 s }' in late
    assert "vehicle v118: car.suv at (" in late
    assert 'track "118"' not in late


def test_a_vehicle_that_was_told_to_leave_and_could_not_does_so_in_the_clip(tmp_path: Path) -> None:
    scenario = tmp_path / "told.foresee"
    text = write_case(tmp_path).read_text(encoding="utf-8")
    scenario.write_text(text.replace("time >= 4 s", "time >= 0.5 s"), encoding="utf-8")
    case = load_test_case(scenario)
    trace = drive(case)
    assert "when time >= 0.00 s {\n    v118 leaves track" in print_model(cut(case, trace, 1.0))
    assert deviation(case, trace, 1.0).largest_others_m < 1e-5


@pytest.mark.parametrize("statement", ["brakes 3 m/s^2 from 3 s for 2 s", "delay 2.5 s", "timing 0.8", "line 0.5 m"])
@pytest.mark.parametrize("at_s", [3.8, 4.4, 6.0])
def test_a_clip_of_a_vehicle_that_leaves_its_track_changed(statement: str, at_s: float, tmp_path: Path) -> None:
    text = write_case(tmp_path).read_text(encoding="utf-8")
    file = tmp_path / "changed.foresee"
    file.write_text(text.replace('{ track "118"', f'{{ {statement}; track "118"'), encoding="utf-8")
    case = load_test_case(file)
    trace = drive(case)
    assert not np.isnan(states(trace, "v118")[-1, X])
    found = deviation(case, trace, at_s).actors
    assert found["v118"] < 0.01


def test_timing_lets_the_clock_of_the_track_run_faster(folder: Path, early: tuple[TestCase, Trace]) -> None:
    clip_case, parent = early
    child = drive(child_of(clip_case, "v117.timing: 1.00 => 1.25"))
    row, track = states(child), track_of(folder)
    for k in (0, 30, 60):
        expected = track.at(1.0 + 1.25 * k * STEP_S)
        assert row[k, [X, Y]] == pytest.approx(expected[:2], abs=1e-3)
        assert row[k, SPEED] == pytest.approx(1.25 * expected.speed_mps)
    both = min(child.frames, parent.frames)
    np.testing.assert_array_equal(states(child, "p9")[:both], states(parent, "p9")[:both])


def test_delay_holds_a_standing_actor_and_lets_another_one_appear_later(early: tuple[TestCase, Trace]) -> None:
    clip_case, parent = early
    child = drive(child_of(clip_case, "p9.delay: 0 s => 0.50 s", "v118.delay: 0 s => 0.50 s"))
    walker, was = states(child, "p9"), states(parent, "p9")
    assert walker[:10, SPEED] == pytest.approx(0.0)
    assert np.ptp(walker[:11, Y]) == 0.0
    np.testing.assert_allclose(walker[10:40, Y], was[:30, Y], atol=1e-9)
    appears = [int(np.flatnonzero(~np.isnan(states(t, "v118")[:, X]))[0]) for t in (parent, child)]
    assert appears == [20, 30]
    np.testing.assert_allclose(states(child, "v118")[30:40, X], states(parent, "v118")[20:30, X], atol=1e-9)


def test_line_moves_the_track_to_one_side(early: tuple[TestCase, Trace]) -> None:
    clip_case, parent = early
    row, was = (states(t) for t in (drive(child_of(clip_case, "v117.line: 0 m => 0.60 m")), parent))
    left = row[:, Y] - was[:, Y]
    assert left[0] == 0.0
    assert left[12] == pytest.approx(0.6 * 8 * 0.6 / 5.0, abs=0.01)  # 8 m/s for 0.6 s, of 5 m
    assert left[15] == pytest.approx(0.6, abs=0.01)
    assert np.abs(np.diff(row[:, Y])).max() < 0.12


def test_brakes_fall_behind_the_track_and_catch_up_with_its_speed(folder: Path, early: tuple[TestCase, Trace]) -> None:
    clip_case, _ = early
    child = drive(child_of(clip_case, "v117.brakes: 0 m/s^2 => 4.00 m/s^2 from 0.50 s for 1.50 s"))
    row, track = states(child), track_of(folder)
    speed = row[:, SPEED]
    assert speed[10] == pytest.approx(8.0)
    assert speed[40] == pytest.approx(2.0, abs=0.02)  # 8 m/s - 1.5 s * 4 m/s^2
    assert row[12:40, ACCELERATION] == pytest.approx(-4.0, abs=0.2)
    gains = spec_of(clip_case.models["car.compact"]).acceleration_mps2
    assert row[45:50, ACCELERATION] == pytest.approx(gains, abs=0.05)
    assert (np.diff(speed[42:]) > 0).all()
    moved = np.hypot(*np.diff(row[:, [X, Y]], axis=0).T) / STEP_S
    assert np.abs(moved - (speed[1:] + speed[:-1]) / 2).max() < 0.15
    for x, y in row[::10, [X, Y]]:  # it stays on the line of its track
        times = np.linspace(0.0, 8.0, 1601)
        assert min(np.hypot(*(np.array([track.at(t)[:2] for t in times]) - (x, y)).T)) < 0.03


@pytest.mark.parametrize(
    "lines",
    [
        ("v117.timing: 1.00 => 0.85",),
        ("v117.brakes: 0 m/s^2 => 4.00 m/s^2 from 0.50 s for 1.50 s",),
        ("v117.line: 0 m => -0.45 m",),
        ("p9.delay: 0 s => 1.20 s", "v118.delay: 0 s => 1.20 s"),
    ],
)
@pytest.mark.parametrize("at_s", [0.8, 1.75, 2.6])
def test_a_clip_of_a_mutant_goes_on_exactly(lines: tuple[str, ...], at_s: float, early: tuple[TestCase, Trace]) -> None:
    mutant = child_of(early[0], *lines)
    case = replace(mutant, clip=None, mutant=None)  # as a scenario of its own, which can be cut again
    case = load_again(case, mutant)
    found = deviation(case, drive(case), at_s).actors
    assert max(found[name] for name in ("v117", "p9", "parked") if name in found) < 1e-4
    assert found["v118"] < 0.1  # after its track SUMO drives it, and it reacts to the ego


def load_again(case: TestCase, mutant: TestCase) -> TestCase:
    from foresee_dsl.language.project.expand import expanded_text

    file = mutant.source.parent / "expanded.foresee"
    file.write_text(expanded_text(mutant), encoding="utf-8")
    again = load_test_case(file)
    assert again.scenario.actors == case.scenario.actors
    return again


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("v117.steer: 0.00 => 0.10", "v117 follows its track, so its steer cannot change"),
        ("v117.speed: 8 m/s => 9 m/s", "v117 follows its track, so its speed cannot change"),
        ("v117.ignores: nothing => signals", "v117 follows its track, so its ignores cannot change"),
        ("v117.line: 0 m => 0.5 m from 1.00 s for 1.00 s", "v117 follows its track, so its line cannot have times"),
    ],
)
def test_a_mutant_cannot_change_what_the_track_decides(line: str, message: str, early: tuple[TestCase, Trace]) -> None:
    with pytest.raises(InputError) as raised:
        child_of(early[0], line)
    assert [(d.code, d.message) for d in raised.value.diagnostics] == [("FS124", message)]


def test_a_model_swap_keeps_the_track(early: tuple[TestCase, Trace]) -> None:
    clip_case, parent = early
    child = drive(child_of(clip_case, "v117.model: car.compact => car.suv"))
    np.testing.assert_array_equal(states(child), states(parent))
    assert child.actors[child.index("v117")].length_m > parent.actors[parent.index("v117")].length_m


def test_operators_offer_what_a_track_can_do(early: tuple[TestCase, Trace]) -> None:
    clip_case, parent = early
    assert clip_case.clip is not None
    models = {name: spec_of(model) for name, model in clip_case.models.items()}
    situation = Situation(clip_case.clip, parent, 60, "v117", models, tuple(sorted(models)))
    rng = np.random.default_rng(0)

    def offered(actor: str) -> set[str]:
        ours = (operator for name, operator in operators().items() if name != "heavy_weather")
        return {operator.name for operator in ours if operator.changes(situation, actor, FOCUSED, rng)}

    assert offered("v117") == {"timing", "line", "model_swap"}
    assert offered("p9") >= {"timing", "delay", "line"}
    assert "delay" in offered("v118")  # it appears later
    assert not offered("parked") & {"timing", "delay", "head_start", "steer"}


@pytest.mark.parametrize("preset", ["focused", "avoidable"])
def test_mutants_of_a_clip_with_tracks_can_be_driven(preset: str, early: tuple[TestCase, Trace]) -> None:
    clip_case, parent = early
    assert clip_case.clip is not None
    mutants = mutate(clip_case, clip_case.clip, parent, count=4, seed=1, preset=preset)
    assert mutants
    for k, mutant in enumerate(mutants):
        file = clip_case.source.parent / f"m{k}.foresee"
        file.write_text(print_model(mutant.model_copy(update={"parent": clip_case.source.name})), encoding="utf-8")
        assert drive(load_test_case(file)).frames > 20


def test_rankers_know_actors_on_tracks(trace: Trace) -> None:
    assert ForeseeRanker().rank(trace)
    points = ReachRanker().rank(trace)
    assert {point.operator for point in points if point.actor == "v117"} >= {"timing"}
    assert "head_start" not in {point.operator for point in points}


def test_a_track_that_begins_later_is_rolled_out_at_its_own_times() -> None:
    boxes = np.full((60, 5), np.nan)
    boxes[20:] = np.column_stack([np.arange(40) * 0.5, *np.zeros((2, 40)), *np.ones((2, 40))])
    same = retimed(boxes, factor=np.ones(1))[0]
    np.testing.assert_allclose(same[20:], boxes[20:], atol=1e-6)
    later = retimed(boxes, delay_s=np.array([0.5]))[0]
    np.testing.assert_allclose(later[30:, 0], boxes[20:50, 0], atol=1e-6)
