"""Minimising: what a failure does not need is left out, its number comes to the boundary, the same failure stays."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pytest

from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.steps.minimise import judge_of
from foresee_dsl.derive.clipping.clip import clip
from foresee_dsl.derive.minimise.boundary import stable_edge
from foresee_dsl.derive.minimise.candidate import Subject, build, without_actors
from foresee_dsl.derive.minimise.minimise import CannotMinimiseError, Minimal, drop_most, minimise
from foresee_dsl.derive.minimise.outcome import Boundary, Ended, ValueTrial
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language import model as m
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.meaning import clip_pin
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.simulate.trace import Trace
from tests.support.small_street import STREET

SWERVE = "change neighbour.steer: 0.00 => -0.15 from 3.50 s for 1.00 s"
HURRY = "change walker.timing: 1.00 => 1.20"
JUDGE = judge_of(DriverSetup("idm"))


class Street(NamedTuple):
    """The test case, its run, and a clip of it."""

    case: TestCase
    trace: Trace
    clip: m.Clip

    def subject(self, *changes: str, trace: bool = True) -> Subject:
        """A mutant of the clip with these lines."""
        pin = clip_pin(self.clip, self.clip.pin)
        lines = "\n".join(changes)
        text = f'foresee 1\n\nmutant street_m1 of "street_p1.foresee" pin {pin} {{\n{lines}\n}}\n'
        mutant = parse(text, "street_m1.foresee").model
        assert isinstance(mutant, m.Mutant)
        return Subject(self.case, self.clip, mutant, self.trace if trace else None, self.case.source.parent)


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> Street:
    file = tmp_path_factory.mktemp("street") / "street.foresee"
    file.write_text(STREET)
    case = load_test_case(str(file))
    trace = run_test_case(case, "idm", 0).trace
    point = RiskyPoint(1, 100, 5.0, "neighbour", "critical", 1.0, 1.0, 1.0, "neighbour drives beside the ego")
    return Street(case, trace, clip(case, trace, point, before_s=4.5, after_s=4, name="street_p1", parent=file.name))


@pytest.fixture(scope="module")
def small(street: Street) -> Minimal:
    return minimise(street.subject(HURRY, SWERVE), JUDGE, limit_m=0.75)


def run_of(street: Street, found: Minimal, **changes: object) -> RunResult:
    """The run of what is left, or with another value of its change."""
    case = expand_clip(found.clip, street.case, source=Path(street.case.source.parent / "street_p1.foresee"))
    own = found.mutant.changes[0].model_copy(update=changes)
    mutant = found.mutant.model_copy(update={"body": (own,)})
    return run_test_case(expand_mutant(mutant, case, source=case.source), "idm", 0)


def test_what_the_failure_does_not_need_is_left_out(small: Minimal) -> None:
    assert small.complete and small.cut_again
    assert (small.dropped.changes, small.dropped.actors, small.dropped.triggers) == (1, 4, 1)
    assert [item.name for item in small.clip.body if isinstance(item, m.Actor)] == ["neighbour"]
    assert not [item for item in small.clip.body if isinstance(item, m.When)]
    assert [change.property for change in small.mutant.changes] == ["steer"]
    assert small.mutant.origin is not None and small.mutant.origin.minimised is not None
    assert "without 1 change, 4 actors, 1 trigger" in small.mutant.origin.minimised


def test_the_same_failure_with_the_same_actor_stays(street: Street, small: Minimal) -> None:
    whole = street.subject(HURRY, SWERVE)
    clip_case = expand_clip(whole.clip, street.case, source=street.case.source)
    before = run_test_case(expand_mutant(whole.mutant, clip_case, source=street.case.source), "idm", 0)
    now = run_of(street, small)
    assert (now.verdict, now.with_) == (before.verdict, before.with_)
    assert now.verdict.is_collision and now.with_ == "neighbour"


def test_the_number_is_at_the_boundary(street: Street, small: Minimal) -> None:
    (edge,) = small.boundaries
    assert (edge.change, edge.was, edge.first) == ("neighbour.steer", 0.0, -0.15)
    assert edge.sharp and -0.15 < edge.fails < edge.passes < 0
    assert small.mutant.changes[0].now == m.Quantity.of(edge.fails, "ratio", 2)
    assert not run_of(street, small, now=m.Quantity.of(edge.passes, "ratio", 2)).verdict.is_failure
    assert {(one.value, one.ended) for one in edge.tried} >= {(edge.fails, "fails"), (edge.passes, "passes")}


def test_the_clip_is_cut_again_from_the_run(street: Street, small: Minimal) -> None:
    """It begins later and ends earlier, at the exact states; the change begins at the same moment of the run."""
    assert small.dropped.seconds > 4
    assert small.clip.start_s > street.clip.start_s
    start = small.mutant.changes[0].start
    assert isinstance(start, m.Quantity)
    assert small.clip.start_s + start.si == pytest.approx(street.clip.start_s + 3.5)
    fidelity = next(item for item in small.clip.body if isinstance(item, m.Fidelity))
    assert fidelity == m.Fidelity(deviation=m.Quantity.of(0, "length", 2), ego=m.Quantity.of(0, "length", 2))
    assert small.mutant.pin == clip_pin(small.clip, small.clip.pin) != clip_pin(street.clip, street.clip.pin)


def test_the_same_inputs_give_the_same_files(street: Street, small: Minimal) -> None:
    again = minimise(street.subject(HURRY, SWERVE), JUDGE, limit_m=0.75)
    assert print_model(again.clip) == print_model(small.clip)
    assert print_model(again.mutant) == print_model(small.mutant)
    assert again.boundaries == small.boundaries and again.runs == small.runs


@pytest.mark.parametrize("budget", [1, 4, 9])
def test_with_few_runs_less_is_left_out(street: Street, small: Minimal, budget: int) -> None:
    found = minimise(street.subject(HURRY, SWERVE), JUDGE, limit_m=0.75, budget=budget)
    assert found.runs <= budget < small.runs and not found.complete
    assert found.dropped.actors <= small.dropped.actors
    assert run_of(street, replace(found, mutant=_only_steer(found.mutant))).verdict.is_failure


def _only_steer(mutant: m.Mutant) -> m.Mutant:
    return mutant.model_copy(update={"body": tuple(c for c in mutant.changes if c.property == "steer")})


def test_a_failure_that_needs_everything_stays_as_it_is(street: Street, small: Minimal) -> None:
    subject = Subject(street.case, small.clip, small.mutant, street.trace, street.case.source.parent)
    found = minimise(subject, JUDGE, limit_m=0.75)
    assert not found.dropped.text and found.clip == small.clip
    assert found.mutant.changes == small.mutant.changes


def test_without_the_parents_run_the_clip_is_not_shortened(street: Street) -> None:
    found = minimise(street.subject(HURRY, SWERVE, trace=False), JUDGE, limit_m=0.75)
    assert not found.cut_again and not found.dropped.seconds
    assert found.dropped.actors == 4 and found.dropped.changes == 1


def test_a_later_clip_has_the_same_changes_at_the_same_moments_of_the_run(street: Street) -> None:
    subject = street.subject(HURRY, SWERVE)
    whole = subject.whole
    hurry, swerve = build(subject, replace(whole, first=whole.first + 10)).mutant.changes
    assert hurry.start is None and (hurry.was, hurry.now) == (whole.changes[0].was, whole.changes[0].now)
    assert isinstance(swerve.start, m.Quantity) and swerve.start.si == pytest.approx(3.0)


@pytest.mark.parametrize(("first", "last"), [(-1, 100), (0, 100_000), (50, 50)])
def test_a_clip_is_cut_within_the_parents_run(street: Street, first: int, last: int) -> None:
    with pytest.raises(ValueError, match=rf"has no frames {first} to {last}"):
        street.subject(SWERVE).cut(first, last)


def test_a_clip_that_states_no_risky_point_is_shortened_up_to_the_contact(street: Street) -> None:
    own = tuple(item for item in street.clip.body if not isinstance(item, m.Risk))
    bare = street._replace(clip=street.clip.model_copy(update={"body": own}))
    found = minimise(bare.subject(SWERVE), JUDGE, limit_m=0.75)
    assert found.complete and found.mutant.changes[0].property == "steer"


def test_a_clip_that_is_not_what_the_run_gives_is_not_cut_again(street: Street) -> None:
    """An author has edited it: its actors' states at other times are not those of the run."""
    edited = street.clip.model_copy(
        update={"body": tuple(i for i in street.clip.body if getattr(i, "name", "") != "ahead" and i.kind != "when")}
    )
    assert not Street(street.case, street.trace, edited).subject(SWERVE).cut_again
    assert street.subject(SWERVE).cut_again


def test_a_mutant_that_passes_is_refused_in_words(street: Street) -> None:
    with pytest.raises(CannotMinimiseError, match="street_m1 does not fail: drove to the end"):
        minimise(street.subject(HURRY), JUDGE, limit_m=0.75)


@pytest.mark.parametrize("needed", [set(), {0}, {12}, {3, 9}, {4, 5, 6}, set(range(13))])
def test_everything_goes_but_what_is_needed(needed: set[int]) -> None:
    asked: list[frozenset[int]] = []

    def holds(gone: frozenset[int]) -> bool:
        asked.append(gone)
        return not gone & needed

    assert drop_most(range(13), holds) == set(range(13)) - needed
    assert len(asked) <= 1 + 8 * len(needed)


def test_items_that_must_go_together_go_together() -> None:
    """Two that hold each other: neither can go alone."""
    pair = {6, 7}
    assert drop_most(range(8), lambda gone: len(gone & pair) != 1) == set(range(8))
    assert drop_most([], lambda _: True) == frozenset()


WHEN = """
  when headway(ego, walker) < 3.4 s {
    walker starts
    wait 6 s
    then {
      bus starts
    }
  }
"""


def test_triggers_lose_what_they_do_with_actors_that_are_left_out() -> None:
    body = f"{STREET.partition('  when ')[0]}{WHEN}}}\n"
    model = parse(body, "when.foresee").model
    assert isinstance(model, m.Scenario)
    when = model.first(m.When)
    assert when is not None
    assert without_actors(when, frozenset({"ahead"})) is when
    assert without_actors(when, frozenset({"walker"})) is None
    left = without_actors(when, frozenset({"bus"}))
    assert left is not None and [action.kind for action in left.actions] == ["starts"]


def test_a_boundary_says_that_its_region_is_broken() -> None:
    ends: tuple[tuple[float, Ended], ...] = ((1.06, "passes"), (1.07, "fails"), (1.12, "passes"), (1.16, "fails"))
    trials = tuple(ValueTrial(value, ended, "") for value, ended in ends)
    edge = Boundary("walker.timing", "", 0.01, 1.0, 1.36, fails=1.16, also_fails=1.07, passes=1.06, tried=trials)
    assert edge.broken and edge.sharp
    assert edge.sentence == (
        "walker.timing fails at 1.16 (also at 1.07), passes at 1.06; the failing region has gaps: 1.12 passes again"
    )
    later = (ValueTrial(1.17, "otherwise", ""), ValueTrial(1.18, "passes", ""), ValueTrial(1.19, "passes", ""))
    assert replace(edge, tried=(*trials, *later)).sentence.endswith("gaps: 1.12, 1.18 and 1.19 pass again")
    assert replace(edge, tried=(*trials[:2], *later)).sentence.endswith("gaps: values from 1.18 to 1.19 pass again")
    whole = replace(edge, fails=1.07, tried=trials[:2])
    assert not whole.broken and whole.sentence == "walker.timing fails at 1.07, passes at 1.06"


@pytest.mark.parametrize(
    ("failing", "edge"),
    [
        (set(range(30)), 29),
        (set(range(12)), 11),
        ({*range(13), 15, 16}, 12),  # bisection meets 15 and 16 first; they have too few neighbours
        ({0}, 0),
    ],
)
def test_the_edge_is_that_of_a_stable_region(failing: set[int], edge: int) -> None:
    assert stable_edge(30, lambda k: k in failing) == edge
