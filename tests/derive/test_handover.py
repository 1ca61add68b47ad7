"""The hand-over: the ego of a clip follows its recorded states, to the millimetre, before its driver drives."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import RecordedState
from foresee_dsl.derive.clipping.clip import DRIVES_S, RECORDED_EVERY_S, clip
from foresee_dsl.derive.clipping.fidelity import ClipDeviation, deviation, with_fidelity
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.checks.documents import check_document
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.model import Clip, Ego, Recorded
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.expand import expand_clip, expanded_model
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState, centre_of_front, limits_of
from foresee_dsl.simulate.actors.moved_actors import recorded_states
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import STEP_S, Trace, X, Y
from tests.support.worlds import COMPACT

MOTION = Bicycle(limits_of(COMPACT))


def recorded(state: BicycleState, time_s: float) -> RecordedState:
    """A state as a clip's file has it."""
    x, y = (round(v, 4) for v in centre_of_front(state.x, state.y, state.heading, -COMPACT.length_m))
    return RecordedState(
        time_s=time_s,
        x=x,
        y=y,
        heading_rad=math.radians(round(math.degrees(math.remainder(state.heading, math.tau)), 4)),
        speed_mps=round(state.speed, 4),
        acceleration_mps2=round(state.acceleration, 4),
        steer_rad=math.radians(round(math.degrees(state.steer), 4)),
    )


@settings(max_examples=50)
@given(
    st.floats(0, 20),
    st.floats(-4, 4),
    st.lists(st.tuples(st.floats(-1, 1), st.floats(0, 1), st.floats(0, 1)), min_size=3, max_size=3),
)
def test_it_is_where_it_was_and_near_that_between_the_recorded_states(
    speed: float, heading: float, answers: list[tuple[float, float, float]]
) -> None:
    # A driver that answers something else each 0.2 s.
    states = [BicycleState(3.0, -7.0, heading, speed)]
    for k in range(12):
        steer, throttle, brake = answers[k // 4]
        states.append(MOTION.step(states[-1], Control(0.3 * steer, throttle, brake), STEP_S))
    for every in (1, 2):
        marks = [recorded(states[k], k * STEP_S) for k in range(every, 13, every)]
        found = list(recorded_states(states[0], marks, MOTION))
        assert len(found) == 12
        for k, (there, here) in enumerate(zip(states[1:], found, strict=True), start=1):
            exact = k % every == 0
            assert math.hypot(here.x - there.x, here.y - there.y) < (2e-4 if exact else 0.1)
            assert abs(math.remainder(here.heading - there.heading, math.tau)) < (1e-5 if exact else 0.1)
            if exact:
                assert (here.speed, here.acceleration, here.steer) == pytest.approx(
                    (there.speed, there.acceleration, there.steer), abs=1e-4
                )


def test_states_at_any_times() -> None:
    start = BicycleState(0.0, 0.0, 0.0, 10.0)
    half = COMPACT.length_m / 2
    marks = [RecordedState(t, 10 * t + half, 0.0, 0.0, 10.0, 0.0, 0.0) for t in (0.03, 0.12, 0.33)]
    found = list(recorded_states(start, marks, MOTION))
    assert [state.x for state in found] == pytest.approx([0.5, 1.0, 1.5, 2.0, 2.5, 3.0])
    assert list(recorded_states(start, (), MOTION)) == []


TEXT = """foresee 1

scenario alone {
  network here {
    junction west at (-150 m, 0 m)
    junction bend at (0 m, 0 m)
    junction north at (0 m, 200 m)
    road first from west to bend { lanes 1; speed 50 km/h }
    road second from bend to north { lanes 1; speed 50 km/h }
  }
  ego: car.compact {
    route from first left over bend
    start at 20 m along ego.route
    start speed 4 m/s
  }
  vehicle ahead: car.compact {
    route from first left over bend
    start at 60 m along ahead.route
    speed 20 km/h
  }
  end after 16 s
}
"""


class Smooth:
    """A driver that remembers: it follows the centreline, and its pedals and wheel go through a low-pass filter."""

    name = "smooth"
    version = "1"

    def __init__(self, filter_s: float) -> None:
        self.keep = math.exp(-STEP_S / filter_s)

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        self.line, self.vehicle = mission.centreline, vehicle
        self.steer = self.pedal = 0.0

    def step(self, seen: Observation) -> Control:
        ego = seen.ego
        k = min(int(np.hypot(*(self.line - (ego.x, ego.y)).T).argmin()) + 6, len(self.line) - 1)
        x, y = self.line[k] - (ego.x, ego.y)
        angle = math.remainder(math.atan2(y, x) - ego.heading_rad, math.tau)
        wheels = math.atan(2 * self.vehicle.wheelbase_m * math.sin(angle) / math.hypot(x, y))
        wanted = 5.0 + 2.0 * math.sin(seen.time_s / 3) if abs(angle) > 0.05 else 8.0
        self.steer += (1 - self.keep) * (wheels / self.vehicle.steer_max_rad - self.steer)
        self.pedal += (1 - self.keep) * (min(max((wanted - ego.speed_mps) / 2, -1.0), 1.0) - self.pedal)
        return Control(self.steer, max(self.pedal, 0.0), max(-self.pedal, 0.0))


@pytest.fixture(scope="module")
def seed(tmp_path_factory: pytest.TempPathFactory) -> tuple[TestCase, RunResult]:
    file = tmp_path_factory.mktemp("alone") / "alone.foresee"
    file.write_text(TEXT)
    case = load_test_case(str(file))
    return case, run(compile_test_case(case), Smooth(0.4))


def cut(seed: tuple[TestCase, RunResult], handover_s: float, at_s: float = 4.0) -> Clip:
    case, result = seed
    frame = result.trace.frame_at(at_s)
    point = RiskyPoint(1, frame, at_s, "", "none", float("nan"), float("nan"), 0.0, "a test")
    return clip(
        case, result.trace, point, before_s=3, after_s=5, name="p1", parent="alone.foresee", handover_s=handover_s
    )


def driven(seed: tuple[TestCase, RunResult], model: Clip) -> tuple[Trace, ClipDeviation]:
    """Run what the clip's text says."""
    case, result = seed
    again = parse(print_model(model), "p1.foresee").model
    assert again == model
    trace = run(
        compile_test_case(expand_clip(again, case, source=case.source.parent / "p1.foresee")), Smooth(0.4)
    ).trace
    return trace, deviation(result.trace, result.trace.frame_at(model.start_s), trace)


def test_a_driver_with_a_memory_strays_less_the_longer_it_watches(seed: tuple[TestCase, RunResult]) -> None:
    far = [driven(seed, cut(seed, handover_s))[1] for handover_s in (0.0, 0.5, 1.0, 2.0)]
    ego = [found.ego_m for found in far]
    assert ego[0] > 0.5
    assert all(later < sooner / 2 for sooner, later in pairwise(ego)), ego
    assert ego[-1] < 0.01
    assert all(found.largest_others_m < 0.001 for found in far)


def test_the_ego_follows_its_states_to_the_millimetre_and_then_goes_on(seed: tuple[TestCase, RunResult]) -> None:
    model = cut(seed, 1.0)
    rows = [item for item in ego_of(model).body if isinstance(item, Recorded)]
    assert [float(row.time.value) for row in rows] == pytest.approx(np.arange(1, 21) * RECORDED_EVERY_S)
    trace, _ = driven(seed, model)
    parent = seed[1].trace
    first = parent.frame_at(model.start_s)
    there, here = parent.states[first : first + 21, 0], trace.states[:21, 0]
    assert np.hypot(*(here - there)[:, [X, Y]].T).max() < 1e-3
    # It hands over with the speed, the acceleration and the wheels of that moment.
    assert here[20, 2:] == pytest.approx(there[20, 2:], abs=2e-3)
    # And the driver watches meanwhile: what it answers has no effect.
    assert np.hypot(*(trace.states[-1, 0] - trace.states[20, 0])[[X, Y]]) > 10


def ego_of(model: Clip) -> Ego:
    return next(item for item in model.body if isinstance(item, Ego))


def test_a_hand_over_is_part_of_what_a_clip_means_and_of_its_expansion(seed: tuple[TestCase, RunResult]) -> None:
    case, _ = seed
    with_it, without = (expand_clip(cut(seed, s), case, source=case.source.parent / "p.foresee") for s in (0.5, 0.0))
    assert pin_of(with_it) != pin_of(without)
    text = print_model(expanded_model(with_it))
    assert text.count("recorded ") == 10
    assert parse(text, "expanded.foresee").model == expanded_model(with_it)


def test_a_clip_from_the_run_s_beginning_has_none(seed: tuple[TestCase, RunResult]) -> None:
    assert "recorded" not in print_model(cut(seed, 0.5, at_s=3.0))  # there the driver started afresh in the parent too


def test_a_hand_over_ends_before_the_mutation(seed: tuple[TestCase, RunResult]) -> None:
    assert "recorded 2.00 s" in print_model(cut(seed, 3.0 - DRIVES_S))
    with pytest.raises(ValueError, match=r"it must end 1 s before the risky point, which is 3 s after"):
        cut(seed, 2.1)


def test_recorded_states_are_the_ego_s_and_in_order(seed: tuple[TestCase, RunResult]) -> None:
    text = print_model(cut(seed, 0.5))
    rows = [line for line in text.splitlines() if "recorded" in line]
    ahead = next(line for line in text.splitlines() if "vehicle ahead" in line)
    for wrong in (text.replace(rows[0], rows[1]), text.replace(ahead, f"{ahead}\n{rows[0]}")):
        assert [d.code for d in check_document(parse(wrong, "p1.foresee"))] == ["FS056"]
    assert check_document(parse(text, "p1.foresee")) == ()


def test_the_fidelity_line_tells_the_others_from_the_ego(seed: tuple[TestCase, RunResult]) -> None:
    model = cut(seed, 0.0)
    found = replace(driven(seed, model)[1], actors={"ego": 0.318, "ahead": 0.0012})
    text = print_model(with_fidelity(model, found))
    assert "  fidelity 0.00 m ego 0.32 m\n" in text
    assert parse(text, "p1.foresee").model == with_fidelity(model, found)
