"""Parameters become values; what does not fit is said where it is used."""

from __future__ import annotations

import pytest

from foresee_dsl.errors import InputError, Span
from foresee_dsl.language.document import Document
from foresee_dsl.language.model import (
    Actor,
    Assignment,
    Case,
    Doc,
    Ego,
    Item,
    Meets,
    Param,
    ParamValue,
    Ref,
    Route,
    Scenario,
    Tags,
    When,
)
from foresee_dsl.language.project.concretise import cases, concretise
from tests.support.meaning_examples import SCENARIO
from tests.support.worlds import q


def refs(value: object) -> list[Ref]:
    if isinstance(value, Ref):
        return [value]
    if isinstance(value, tuple):
        return [ref for part in value for ref in refs(part)]
    if isinstance(value, Item):
        return [ref for name in type(value).model_fields for ref in refs(getattr(value, name))]
    return []


def with_case(**values: ParamValue) -> Scenario:
    case = Case(name="own", values=tuple(Assignment(name=k, value=v) for k, v in values.items()))
    return SCENARIO.model_copy(update={"body": (*SCENARIO.body, case)})


def test_defaults_when_no_case_is_named() -> None:
    concrete = concretise(SCENARIO, None)
    assert refs(concrete) == []
    assert not concrete.all(Param) and not concrete.all(Case)
    assert concrete.first(Doc) and concrete.first(Tags)
    assert concrete.actors[1].model == "car.compact"
    assert concrete.all(When)[0].actions[0] == Meets(actor="runner", other="ego", junction="j4", gap=q("1.5 s"))


def test_a_case_gives_arms_turns_models_and_quantities() -> None:
    concrete = concretise(SCENARIO, "r02")
    route = concrete.actors[0].body[0]
    assert isinstance(route, Route)
    assert (route.start, route.legs[0].turn) == ("east", "left")
    runner = concrete.actors[1]
    assert runner.model == "car.sports"
    assert runner.body[1].speed == q("62 km/h")  # type: ignore[union-attr]  # the second statement is `speed`
    assert concrete.all(When)[0].actions[0].gap == q("1.5 s")  # type: ignore[union-attr]  # a default stays


def test_actors_that_were_read_before_are_not_kept() -> None:
    before = SCENARIO.actors
    assert concretise(SCENARIO, "r02").actors[1].model == "car.sports"
    copy = SCENARIO.model_copy(update={"body": ()})
    assert (copy.actors, SCENARIO.actors) == ((), before)


def test_what_has_no_reference_is_the_same_object() -> None:
    concrete = concretise(SCENARIO, "r01")
    walker = next(actor for actor in SCENARIO.all(Actor) if actor.name == "walker")
    assert any(item is walker for item in concrete.body)


def test_concretising_twice_changes_nothing() -> None:
    once = concretise(SCENARIO, "r02")
    assert concretise(once, None) == once


def test_cases_are_listed_in_order() -> None:
    assert cases(Document(path="a", text="", model=SCENARIO)) == ("r01", "r02")
    assert cases(Document(path="a", text="", model=concretise(SCENARIO, None))) == ()


def test_unknown_case_names_the_nearest() -> None:
    with pytest.raises(InputError) as caught:
        concretise(SCENARIO, "r2")
    (found,) = caught.value.diagnostics
    assert found.code == "FS100"
    assert found.help == "did you mean 'r02'?"


def test_a_case_of_a_scenario_without_cases() -> None:
    with pytest.raises(InputError, match="no cases"):
        concretise(concretise(SCENARIO, None), "r01")


@pytest.mark.parametrize(
    ("values", "code", "message"),
    [
        ({"gpa": q("1 s")}, "FS031", "has no parameter 'gpa'"),
        ({"gap": q("1 m")}, "FS032", "needs time, but 1 m is length"),
        ({"gap": "soon"}, "FS032", "parameter 'gap' is of type time, but soon is not"),
        ({"way": "up"}, "FS032", "parameter 'way' (up) does not fit here"),
        ({"what": "sports"}, "FS032", "parameter 'what' (sports) does not fit here"),
        ({"pace": q("3 s")}, "FS032", "needs speed, but 3 s is time"),
    ],
)
def test_values_that_do_not_fit(values: dict[str, ParamValue], code: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        concretise(with_case(**values), "own")
    assert code in {found.code for found in caught.value.diagnostics}
    assert message in str(caught.value)


def test_all_mistakes_are_reported_at_once() -> None:
    with pytest.raises(InputError) as caught:
        concretise(with_case(way="up", what="sports", gpa=q("1 s")), "own")
    assert len(caught.value.diagnostics) == 3


def test_a_reference_to_nothing_has_its_place() -> None:
    ego = Ego(model=Ref(name="wat"))
    scenario = Scenario(name="a", body=(Param(name="what", type="model", default="car.sedan"), ego))
    text = "foresee 1\nscenario a {\n  param what: model = car.sedan\n  ego: wat\n}\n"
    span = Span(4, 8, 4, 11)
    document = Document(path="a.foresee", text=text, model=scenario, spans={(id(ego), "model"): span})
    with pytest.raises(InputError) as caught:
        concretise(scenario, None, document=document)
    (found,) = caught.value.diagnostics
    assert (found.path, found.span, found.source_line) == ("a.foresee", span, "  ego: wat")
    assert found.help == "did you mean 'what'?"
