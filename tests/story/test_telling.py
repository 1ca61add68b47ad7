"""What a story says, on real runs: a mutant that is steered into the ego, equal stories, names from users' files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pytest

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.forecast.registry import load_ranker
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.model import Change, Mutant, Quantity
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.trace import Event
from foresee_dsl.story import ContactClass, Story, tell
from foresee_dsl.story.story import seen_for

STEERED = """foresee 1

scenario narrow {
  network here {
    junction west at (0 m, 0 m)
    junction east at (300 m, 0 m)
    road way from west to east { lanes 1; speed 50 km/h }
  }

  ego: car.sedan {
    route [way]
    start at 20 m along way
    start speed 40 km/h
    goal 290 m along way
  }
  vehicle oncoming: van.parcel {
    route [way_back]
    start at 60 m along way_back
    speed 40 km/h
  }
  end after 20 s
}
"""


class Told(NamedTuple):
    case: TestCase
    result: RunResult
    story: Story


def mutated(clip_case: TestCase, value: float) -> Told:
    change = Change(
        actor="oncoming",
        property="steer",
        was=Quantity.of(0.0, "ratio", 2),
        now=Quantity.of(value, "ratio", 2),
        start=Quantity.of(4.0, "time", 2),
        duration=Quantity.of(1.0, "time", 2),
    )
    mutant = Mutant(name="narrow_p1_m1", parent="narrow_p1.foresee", pin=pin_of(clip_case), body=(change,))
    case = expand_mutant(mutant, clip_case, source=clip_case.source.with_name("narrow_p1_m1.foresee"))
    result = run_test_case(case, "idm", 0)
    return Told(case, result, tell(result.trace, case))


@pytest.fixture(scope="module")
def clip_case(tmp_path_factory: pytest.TempPathFactory) -> TestCase:
    file = tmp_path_factory.mktemp("steered") / "narrow.foresee"
    file.write_text(STEERED, encoding="utf-8")
    (case,) = load_test_cases([str(file)])
    trace = run_test_case(case, "idm", 0).trace
    point = load_ranker("proximity").rank(trace)[0]
    clip_file = file.with_name("narrow_p1.foresee")
    clip = clip_around(case, trace, point, clip_file, before_s=5, after_s=3)
    return expand_clip(clip, case, source=clip_file)


@pytest.fixture(scope="module")
def steered(clip_case: TestCase) -> Told:
    return mutated(clip_case, 0.2)


def test_somebody_steered_into_the_ego_is_a_class_of_its_own(steered: Told) -> None:
    assert steered.result.verdict in (Verdict.F3, Verdict.F4)
    assert steered.story.contact is ContactClass.STRUCK_BY_STEERED
    assert steered.story.opponent_manoeuvre == "comes the other way, is steered towards the ego"
    assert steered.story.sentence.startswith("'oncoming' (van) comes the other way and is steered to its left into")
    assert steered.story.mutation == "'oncoming' is steered to the left from 4.00 s"


def test_children_that_differ_in_numbers_tell_the_same_story(clip_case: TestCase, steered: Told) -> None:
    other = mutated(clip_case, 0.16)
    assert other.result.trace.digest != steered.result.trace.digest
    assert other.story.signature == steered.story.signature


def test_who_is_steered_away_did_not_strike(clip_case: TestCase) -> None:
    away = mutated(clip_case, -0.1)
    assert away.result.verdict is Verdict.PASS
    assert (away.story.contact, away.story.opponent) == (ContactClass.NONE, "oncoming")
    assert "is steered" not in away.story.opponent_manoeuvre
    assert "they come as near as" in away.story.sentence
    (nearest,) = (moment for moment in away.story.moments if moment.kind == "nearest")
    assert nearest.time_s < away.result.duration_s


def test_moments_are_in_order_and_within_the_run(steered: Told) -> None:
    times = [moment.time_s for moment in steered.story.moments]
    assert times == sorted(times)
    assert times[0] == 0.0 and times[-1] == pytest.approx(steered.result.time_s)
    assert steered.story.moments[-1].kind == "contact"
    assert {"ego", "oncoming"} == {moment.actor for moment in steered.story.moments}


def test_the_same_run_is_told_the_same_again(steered: Told) -> None:
    assert tell(steered.result.trace, steered.case) == steered.story


def test_an_absurdly_long_name_is_cut(tmp_path: Path) -> None:
    name = "o" * 80  # the longest that the language allows
    file = tmp_path / "narrow.foresee"
    file.write_text(STEERED.replace("oncoming", name), encoding="utf-8")
    (case,) = load_test_cases([str(file)])
    trace = run_test_case(case, "idm", 0).trace
    touched = Event(trace.duration_s, "ego", "collision", {"with": name, "verdict": "F5"})
    story = tell(replace(trace, events=(*trace.events, touched)), case)
    assert story.opponent == name
    assert name[:30] in story.sentence and len(story.sentence) < 500
    assert all(len(moment.text) < 300 for moment in story.moments)


def test_a_sight_is_not_longer_than_was_searched() -> None:
    assert [seen_for(time_s) for time_s in (0.85, 9.95, 10.0)] == ["0.8 s", "9.9 s", "10 s or longer"]
