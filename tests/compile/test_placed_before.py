"""Children of a clip are placed as they are without their siblings, and only what they change is placed anew."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import PlacedActor, Scene
from foresee_dsl.compile.placement import scene as scenes
from foresee_dsl.compile.placement.spots import PlacedBefore
from foresee_dsl.derive.clipping.clip import clip
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language import model as m
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.language.project.loading import load_test_case
from tests.support.small_street import STREET


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> TestCase:
    """A clip of a street with cars and a walker."""
    file = tmp_path_factory.mktemp("street") / "street.foresee"
    file.write_text(STREET)
    case = load_test_case(str(file))
    point = RiskyPoint(1, 100, 5.0, "neighbour", "critical", 1.0, 1.0, 1.0, "neighbour drives beside the ego")
    trace = run_test_case(case, "idm", 0).trace
    found = clip(case, trace, point, before_s=4.5, after_s=4, name="street_p1", parent=file.name)
    return expand_clip(found, case, source=file)


def child(street: TestCase, *lines: str) -> TestCase:
    text = f'foresee 1\n\nmutant street_m1 of "street_p1.foresee" pin sha256:{12 * "0"} {{\n{chr(10).join(lines)}\n}}\n'
    mutant = parse(text, "street_m1.foresee").model
    assert isinstance(mutant, m.Mutant)
    return expand_mutant(mutant, street, source=Path(street.source))


def scene_of(case: TestCase, monkeypatch: pytest.MonkeyPatch, known: PlacedBefore) -> Scene:
    monkeypatch.setattr(scenes, "PLACED_BEFORE", known)
    return compile_test_case(case).scene


def actors(scene: Scene) -> dict[str, PlacedActor]:
    return {actor.id: actor for actor in scene.actors}


@pytest.mark.parametrize(
    ("line", "changed"),
    [
        ("change neighbour.steer: 0.00 => -0.15 from 3.50 s for 1.00 s", "neighbour"),
        ("change neighbour.model: car.compact => car.suv", "neighbour"),
        ("change walker.timing: 1.00 => 1.20", "walker"),
        ("change walker.line: 0.00 m => 0.60 m", "walker"),
        ("change weather.wetness: 0 => 0.5", ""),
    ],
)
def test_a_child_is_placed_as_without_its_clip(
    street: TestCase, monkeypatch: pytest.MonkeyPatch, line: str, changed: str
) -> None:
    known, case = PlacedBefore(), child(street, line)
    clips = actors(scene_of(street, monkeypatch, known))
    after, alone = (scene_of(case, monkeypatch, one) for one in (known, PlacedBefore()))
    assert after == alone
    found = actors(after)
    assert {name for name in clips if found[name] is not clips[name]} == ({changed} if changed else set())


def test_a_trigger_that_starts_an_actor_is_not_overlooked(street: TestCase, monkeypatch: pytest.MonkeyPatch) -> None:
    """The statement is the same object; what triggers do to its actor is not in it."""
    known = PlacedBefore()
    before = actors(scene_of(street, monkeypatch, known))["walker"]
    text = "foresee 1\n\nscenario s {\n  when time > 1 s {\n    walker starts\n  }\n}\n"
    (when,) = (item for item in parse(text, "s.foresee").model.body if isinstance(item, m.When))
    body = (*street.scenario.body, when)
    scenario = street.scenario.model_copy(update={"body": body})
    after = actors(scene_of(replace(street, scenario=scenario), monkeypatch, known))["walker"]
    assert not before.waits
    assert after.waits
