"""A small real campaign with the ranker `reach`: clips begin with the proposed change, and children make it first."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.avoidance.candidates.behaviours import CarefulSettings
from foresee_dsl.avoidance.candidates.recorded import RecordedRun
from foresee_dsl.avoidance.candidates.scoring import Promise
from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.campaign.workers.pool import RunOptions
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.derive.clipping.clip import clip, clip_frames
from foresee_dsl.derive.mutate import Mutator
from foresee_dsl.derive.operators import operators
from foresee_dsl.derive.operators.situation import Numeric
from foresee_dsl.derive.presets import PRESETS
from foresee_dsl.derive.reach.ranker import ReachRanker
from foresee_dsl.derive.reach.rolling import ReachSettings
from foresee_dsl.errors import ForeseeError
from foresee_dsl.forecast.protocol import Mutations
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Clip, Quantity, Window
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.expand import expand_clip
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.trace import STEP_S, Trace
from tests.support.small_campaign import SETTINGS, TEXT, campaign, published, write_project

REACH = replace(SETTINGS, ranker="reach")


@pytest.fixture(scope="module")
def cases(tmp_path_factory: pytest.TempPathFactory) -> tuple[TestCase, ...]:
    file = tmp_path_factory.mktemp("reach") / "crosser.foresee"
    file.write_text(TEXT, encoding="utf-8")
    return tuple(load_test_cases([file]))


def clip_of(text: str) -> Clip:
    model = parse(text, "clip").model
    assert isinstance(model, Clip)
    return model


@pytest.mark.parametrize("preset", ["paper", "focused"])
def test_children_make_the_proposed_change_and_say_why(preset: str, tmp_path: Path) -> None:
    result, _ = campaign(write_project(tmp_path), tmp_path / "out", replace(REACH, preset=preset))
    assert not result.broken
    proposed = [(c, clip_of(c.text)) for c in result.clips]
    # A clip that strays from its parent's run has no children.
    proposed = [(c, m) for c, m in proposed if m.risk is not None and m.risk.operator and c.children]
    assert proposed
    for outcome, model in proposed:
        risk = model.risk
        assert risk is not None
        assert risk.actor == "other"
        assert f" by {risk.operator}" in outcome.text
        first = outcome.children[0]
        assert risk.operator in first.operators
        for child in outcome.children:
            mutant = parse(child.text, child.name).model
            same = risk.operator in child.operators and any(change.startswith("other.") for change in child.changes)
            other = "" if same else "its clip was cut for another change: "
            assert mutant.origin.why == f"{other}{risk.text}"  # type: ignore[union-attr]
        changed = parse(first.text, first.name).model.changes  # type: ignore[union-attr]
        steers = [change for change in changed if change.property == "steer"]
        assert all(change.actor == "other" for change in steers)
        assert all(change.start is None or change.start.si == 0 for change in steers)  # it begins with the clip


def test_any_number_of_workers_and_a_second_run_give_the_same(tmp_path: Path) -> None:
    file = write_project(tmp_path)
    for jobs in (1, 2):
        campaign(file, tmp_path / str(jobs), REACH, options=RunOptions(jobs=jobs))
    first = published(tmp_path / "1")
    assert first["json"]["clips"]
    assert published(tmp_path / "2") == first
    _, heard = campaign(file, tmp_path / "1", REACH)
    assert heard.kinds == []
    assert published(tmp_path / "1") == first


def test_clips_begin_with_the_change_or_a_handover_before_it(cases: tuple[TestCase, ...]) -> None:
    case = cases[0]
    trace = driven(case)
    models = {name: spec_of(model) for name, model in case.models.items()}
    point = next(p for p in ReachRanker().before(Mutations("paper", models)).rank(trace) if p.operator == "steer")
    assert point.begins is not None
    begins_s = point.begins * STEP_S
    for handover_s in (0.0, 0.5):
        made = clip(
            case, trace, point, before_s=5.0, after_s=5.0, name="one", parent="x.foresee", handover_s=handover_s
        )
        window = next(item for item in made.body if isinstance(item, Window))
        assert isinstance(window.start, Quantity)
        assert isinstance(window.end, Quantity)
        # With a hand-over the driver plans at the same moments as in the run: it begins at a multiple of 0.2 s.
        assert begins_s - handover_s - 0.2 < window.start.si <= max(begins_s - handover_s, 0.0)
        assert window.end.si - window.start.si <= 10.0 + handover_s + 0.2
        own = expand_clip(clip_of(print_model(made)), case, source=Path("one.foresee"))
        mutator = Mutator(own, made, driven(own), preset="paper")
        (child, *_) = mutator.children(1)
        (steer,) = [change for change in child.changes if change.property == "steer"]
        onset_s = steer.start.si if isinstance(steer.start, Quantity) else 0.0
        assert window.start.si + onset_s == pytest.approx(begins_s)


def test_a_clip_is_cut_only_if_its_own_seconds_promise_a_failure(cases: tuple[TestCase, ...], tmp_path: Path) -> None:
    """With the preset `avoidable`; the seconds before a clip that begins with its change do not count."""
    settings = replace(REACH, preset="avoidable", risky_points=30, children=1)
    result, _ = campaign(write_project(tmp_path), tmp_path / "out", settings)
    case = cases[0]
    trace = driven(case)
    models = {name: spec_of(model) for name, model in case.models.items()}
    promise = Promise(RecordedRun.of(trace), CarefulSettings())
    own, around = set(), set()
    for point in ReachRanker().before(Mutations("avoidable", models)).rank(trace, before_s=3, after_s=3):
        frames = clip_frames(trace, point, before_s=3, after_s=3)
        if promise.of(point.frame, frames.first, frames.last):
            own.add(point.rank)
        if promise.of(point.frame, max(0, point.frame - 60), frames.last):
            around.add(point.rank)
    cut = {clip.rank for clip in result.clips if clip.seed.endswith(f"::{case.id.partition('::')[2]}")}
    assert cut
    assert cut <= own
    assert around - own  # points that only the seconds before their clips promise


def test_an_operator_that_there_is_not_is_a_mistake(cases: tuple[TestCase, ...]) -> None:
    case = cases[0]
    trace = driven(case)
    point = replace(ReachRanker().rank(trace)[0], operator="teleport")
    made = clip(case, trace, point, before_s=5.0, after_s=5.0, name="one", parent="crosser.foresee")
    own = expand_clip(made, case, source=Path("one.foresee"))
    with pytest.raises(
        ForeseeError, match=r"clip one: its `risk` line has the unknown `by teleport`; write one of: .*steer"
    ):
        Mutator(own, made, trace, preset="paper")


@pytest.mark.parametrize("preset", ["paper", "focused"])
def test_what_is_rolled_out_is_what_the_mutator_may_draw(preset: str, cases: tuple[TestCase, ...]) -> None:
    """The values of the proposals, against those of the operators on the clip that is cut and driven."""
    case, chosen = cases[0], PRESETS[preset]
    trace = driven(case)
    models = {name: spec_of(model) for name, model in case.models.items()}
    ranker = ReachRanker(replace(ReachSettings(), shares=400)).before(Mutations(preset, models))
    points = [p for p in ranker.rank(trace) if isinstance(operators().get(p.operator), Numeric)][:2]
    assert points
    rolling = ranker.rolling(trace, np.full((len(trace.actors), trace.frames), 1.0))
    for point in points:
        assert point.begins is not None
        made = clip(case, trace, point, before_s=5.0, after_s=5.0, name="one", parent="x.foresee")
        own = expand_clip(made, case, source=Path("one.foresee"))
        situation = Mutator(own, made, driven(own), preset=preset).situation
        rolled = dict(rolling.changes(point.begins, [trace.index(point.actor)]))
        values = next(v for c, v in rolled.items() if c.operator.name == point.operator)
        operator = operators()[point.operator]
        assert isinstance(operator, Numeric)
        allowed = operator.values(situation, point.actor, chosen)
        assert len(values) == pytest.approx(len(allowed), abs=2)  # a clip's speeds have four decimals
        assert min(values) == pytest.approx(min(allowed), abs=0.02)
        assert max(values) == pytest.approx(max(allowed), abs=0.02)


def driven(case: TestCase) -> Trace:
    return run_test_case(case, "idm", 0).trace
