"""Minimising keeps the situation: who hid the actor, and the signal on the ego's way.

The driver holds its speed whatever it sees, so that the collision alone needs neither.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pytest

from foresee_dsl.campaign.driving import DriverSetup
from foresee_dsl.campaign.steps.minimise import judge_of
from foresee_dsl.compile import compile_test_case
from foresee_dsl.derive.clipping.clip import clip
from foresee_dsl.derive.minimise.candidate import Subject
from foresee_dsl.derive.minimise.minimise import Minimal, minimise
from foresee_dsl.derive.minimise.trials import TrialJudge
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language import model as m
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.meaning import clip_pin
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.simulate.runner import run
from foresee_dsl.story import tell
from foresee_dsl.story.story import Grounds

TEXT = """foresee 1

scenario hidden {
  network street {
    junction west at (0 m, 0 m)
    junction east at (200 m, 0 m)
    junction north at (60 m, 80 m)
    junction middle at (60 m, 0 m) signals {
      stage up_go for 5 s green [up]
      stage in_go for 40 s green [in]
    }
    road in from west to middle { sidewalk 2 m }
    road out from middle to east { parking 2.2 m; sidewalk 2 m }
    road up from north to middle { sidewalk 2 m }
  }

  ego: car.sedan {
    route [in, out]
    start at 15 m along in
    start speed 36 km/h
    goal 110 m along out
  }
  obstacle van: obstacle.parked_van {
    start at 58 m along out offset -2.9 m
  }
%s  pedestrian walker: pedestrian.adult {
    path [62 m along out offset -4.5 m, 62 m along out offset 6 m]
    speed 1.8 m/s
  }
  when distance(ego, walker) < 40 m {
    walker starts
  }
  signal middle stage in_go elapsed 0 s
  end after 16 s anywhere
}
"""


FAR_OFF = """  obstacle far_off: obstacle.parked_van {
    start at 110 m along out offset -2.9 m
  }
"""


class Unmoved:
    """A driver that keeps its speed and its wheel straight."""

    name, version = "unmoved", "1"

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Remember nothing."""

    def step(self, observation: Observation) -> Control:
        """Hold 10 m/s."""
        slow = 10.0 - observation.ego.speed_mps
        return Control(0.0, min(max(slow, 0.0), 1.0), 0.0)


class SlowsDown(Unmoved):
    """A driver that brakes to 4 m/s while it sees a pedestrian who walks."""

    def step(self, observation: Observation) -> Control:
        """Brake, or hold 10 m/s."""
        if any(seen.kind == "pedestrian" and seen.speed_mps > 0.1 for seen in observation.actors):
            return Control(0.0, 0.0, float(observation.ego.speed_mps > 4.0))
        return super().step(observation)


JUDGE = replace(judge_of(DriverSetup("idm")), drive=lambda case: run(compile_test_case(case), Unmoved()))


class Case(NamedTuple):
    """A mutant before and after minimising: its clip, its run, and the grounds of its story."""

    small: m.Clip
    before: tuple[RunResult, Grounds]
    after: tuple[RunResult, Grounds]


def minimised(
    folder: Path, judge: TrialJudge, delay_s: float, after_s: float, bystander: str = ""
) -> tuple[Subject, Minimal]:
    """Return the mutant in which the walker starts later, before and after minimising."""
    file = folder / "hidden.foresee"
    file.write_text(TEXT % bystander)
    parent = load_test_case(str(file))
    trace = judge.drive(parent).trace
    assert trace.meta["verdict"] == "pass", trace.meta["reason"]
    point = RiskyPoint(1, 230, 11.5, "walker", "critical", 1.0, 1.0, 1.0, "walker comes from behind the van")
    cut = clip(parent, trace, point, before_s=8.5, after_s=after_s, name="hidden_p1", parent=file.name)
    change, pin = f"change walker.delay: 0.00 s => {delay_s:.2f} s", clip_pin(cut, cut.pin)
    mutant = parse(
        f'foresee 1\n\nmutant hidden_m1 of "hidden_p1.foresee" pin {pin} {{\n{change}\n}}\n', "m.foresee"
    ).model
    assert isinstance(mutant, m.Mutant)
    subject = Subject(parent, cut, mutant, trace, folder)
    return subject, minimise(subject, judge, limit_m=0.75)


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    subject, small = minimised(tmp_path_factory.mktemp("hidden"), JUDGE, 1.2, 2.5, FAR_OFF)
    before, after = ((subject.clip, subject.mutant), (small.clip, small.mutant))
    return Case(small.clip, driven(subject.parent, *before), driven(subject.parent, *after))


def driven(parent: TestCase, cut: m.Clip, mutant: m.Mutant, judge: TrialJudge = JUDGE) -> tuple[RunResult, Grounds]:
    """Drive a mutant of a clip."""
    clip_case = expand_clip(cut, parent, source=parent.source.parent / "hidden_p1.foresee")
    mutated = expand_mutant(mutant, clip_case, source=clip_case.source)
    result = judge.drive(mutated)
    return result, tell(result.trace, mutated).grounds


def test_what_hides_the_actor_stays_and_a_bystander_goes(case: Case) -> None:
    actors = {item.name for item in case.small.body if isinstance(item, m.Actor)}
    assert actors == {"van", "walker"}
    (before, why_before), (after, why_after) = case.before, case.after
    assert (after.verdict, after.with_) == (before.verdict, "walker")
    assert why_after.hidden_by == why_before.hidden_by == "'van' (parked van)"


def test_the_signal_on_the_egos_way_stays(case: Case) -> None:
    assert case.before[1].signal == case.after[1].signal == "middle green"
    assert [item.junction for item in case.small.body if isinstance(item, m.SignalState)] == ["middle"]


def test_the_values_beside_a_boundary_ended_so_in_its_own_clip(tmp_path: Path) -> None:
    """This driver sees the walker in time without the van, so the run in which the van was left out passes."""
    judge = replace(JUDGE, drive=lambda case: run(compile_test_case(case), SlowsDown()))
    subject, small = minimised(tmp_path, judge, 2.0, 4.5)
    assert {item.name for item in small.clip.body if isinstance(item, m.Actor)} == {"van", "walker"}
    (edge,), (change,) = small.boundaries, small.mutant.changes
    ended = {trial.value: trial.ended != "passes" for trial in edge.tried}
    assert ended[2.0] and False in ended.values()
    for value, fails in ended.items():
        other = change.model_copy(update={"now": m.Quantity.of(value, "time", 2)})
        body = tuple(other if item is change else item for item in small.mutant.body)
        result, _ = driven(subject.parent, small.clip, small.mutant.model_copy(update={"body": body}), judge)
        assert result.verdict.is_failure == fails, value
