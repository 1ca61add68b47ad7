"""Clips and mutants become full scenarios; every WAS is checked."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.errors import InputError, Span
from foresee_dsl.language.document import Document, TestCase
from foresee_dsl.language.meaning import meaning_hash
from foresee_dsl.language.model import (
    Actor,
    Change,
    CruiseSpeed,
    Delay,
    Ego,
    End,
    Expect,
    Expected,
    GoalAt,
    Network,
    Ref,
    Scenario,
    SignalState,
    Steers,
    Tags,
    Timing,
    Traffic,
    UseModels,
    UseNetwork,
    Weather,
    When,
    Window,
)
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.concretise import concretise
from foresee_dsl.language.project.expand import expand_clip, expand_mutant, expanded_model, expanded_text
from tests.support.meaning_examples import (
    MODELS,
    NETWORK,
    SCENARIO,
    change,
    clip_of,
    example_case,
    mutant_of,
    state,
)
from tests.support.worlds import point, q

PARENT = example_case(concretise(SCENARIO, "r02"))
CLIP = clip_of(PARENT.meaning)
CHILDREN = Path("/project/out/children")


def clip_case(parent: TestCase = PARENT) -> TestCase:
    return expand_clip(CLIP, parent, source=CHILDREN / "runner_p1.foresee")


def mutated(*changes: Change, of: TestCase | None = None) -> TestCase:
    return expand_mutant(mutant_of(*changes), of or clip_case(), source=CHILDREN / "runner_p1_m1.foresee")


def actor(case: TestCase, name: str) -> Ego | Actor:
    return next(found for found in case.scenario.actors if found.name == name)


def test_a_clip_takes_its_surroundings_from_its_parent() -> None:
    case = clip_case()
    scenario, parent = case.scenario, PARENT.scenario
    assert scenario.first(Tags) == parent.first(Tags)
    assert case.family == "7"
    assert scenario.first(Weather) == parent.first(Weather)
    assert scenario.first(End) == End(after=q("10.00 s"))
    assert [found.name for found in scenario.actors] == ["ego", "runner", "others_03"]
    assert not scenario.all(Traffic) and not scenario.all(When)
    assert len(scenario.all(SignalState)) == 1
    assert (case.network, case.models, case.clip, case.mutant) == (NETWORK, MODELS, CLIP, None)
    assert case.meaning == meaning_hash(scenario, NETWORK, MODELS)


def test_a_clip_keeps_the_expectations_that_it_can_judge() -> None:
    # `eventually arrived` cannot be judged in a window, and the walker is not in the clip.
    assert [expect.mode for expect in clip_case().scenario.all(Expect)] == ["never"]
    walker = Actor(kind="pedestrian", name="walker", model="pedestrian.adult", state=state("3", "1 m/s"))
    case = expand_clip(clip_of(PARENT.meaning, body=(*CLIP.body, walker)), PARENT, source=Path("c.foresee"))
    assert [expect.mode for expect in case.scenario.all(Expect)] == ["never", "always"]


def test_the_goal_replaces_the_egos() -> None:
    own = tuple(
        item.model_copy(update={"body": (*item.body, GoalAt(place=point("1", "1")))}) if isinstance(item, Ego) else item
        for item in CLIP.body
    )
    case = expand_clip(clip_of(PARENT.meaning, body=own), PARENT, source=Path("c.foresee"))
    goals = [item for item in actor(case, "ego").body if isinstance(item, GoalAt)]
    assert goals == [GoalAt(place=point("40", "0"))]


def test_a_windows_length_in_mixed_units() -> None:
    body = tuple(i if not isinstance(i, Window) else Window(start=q("900 ms"), end=q("2 s")) for i in CLIP.body)
    case = expand_clip(clip_of(PARENT.meaning, body=body), PARENT, source=Path("c.foresee"))
    assert case.scenario.first(End) == End(after=q("1.100000 s"))


@pytest.mark.parametrize(
    ("kinds", "code", "message"),
    [((Ego,), "FS044", "no ego"), ((Window,), "FS044", "no window")],
)
def test_an_incomplete_clip(kinds: tuple[type, ...], code: str, message: str) -> None:
    body = tuple(item for item in CLIP.body if not isinstance(item, kinds))
    with pytest.raises(InputError, match=message) as caught:
        expand_clip(clip_of(PARENT.meaning, body=body), PARENT, source=Path("c.foresee"))
    assert caught.value.diagnostics[0].code == code
    assert caught.value.diagnostics[0].path == "c.foresee"


@pytest.mark.parametrize(
    ("end", "message", "help"),
    [("8 s", "before it begins", "write the earlier time first"), ("9 s", "when it begins", "let it end later")],
)
def test_a_window_that_ends_too_early(end: str, message: str, help: str) -> None:
    body = tuple(i if not isinstance(i, Window) else Window(start=q("9 s"), end=q(end)) for i in CLIP.body)
    with pytest.raises(InputError, match=message) as caught:
        expand_clip(clip_of(PARENT.meaning, body=body), PARENT, source=Path("c.foresee"))
    assert caught.value.diagnostics[0].code == "FS039"
    assert caught.value.diagnostics[0].help == help


def test_a_parameter_in_a_clip() -> None:
    slow = Actor(kind="vehicle", name="slow", model="car.sedan", body=(CruiseSpeed(speed=Ref(name="pace")),))
    with pytest.raises(InputError, match="'pace' is not a parameter") as caught:
        expand_clip(clip_of(PARENT.meaning, body=(*CLIP.body, slow)), PARENT, source=Path("c.foresee"))
    assert caught.value.diagnostics[0].code == "FS031"


@pytest.mark.parametrize(
    ("name", "kind", "code", "help"),
    [
        ("car.sedna", "vehicle", "FS110", "did you mean 'car.sedan'?"),
        ("car.sedan", "pedestrian", "FS038", "it needs a model of class pedestrian: pedestrian.adult"),
    ],
)
def test_models_of_a_clip(name: str, kind: str, code: str, help: str) -> None:
    other = Actor.model_validate({"kind": kind, "name": "other", "model": name, "state": state("70", "1 m/s")})
    with pytest.raises(InputError) as caught:
        expand_clip(clip_of(PARENT.meaning, body=(*CLIP.body, other)), PARENT, source=Path("c.foresee"))
    (found,) = caught.value.diagnostics
    assert (found.code, found.help) == (code, help)


def test_all_changes_of_a_mutant() -> None:
    case = mutated(
        change("runner.model", "car.compact", "car.sports"),
        change("runner.steer", "0.00", "0.12", start="4 s", duration="1 s"),
        change("runner.timing", "1.00", "0.80"),
        change("runner.speed", "17.220 m/s", "16 m/s"),
        change("others_03.delay", "0 s", "0.4 s"),
        change("ego.speed", "36 km/h", "11 m/s"),
    )
    runner = actor(case, "runner")
    assert runner.model == "car.sports"
    assert set(runner.body) == {
        Steers(value=q("0.12"), start=q("4 s"), duration=q("1 s")),
        Timing(factor=q("0.80")),
    }
    assert runner.state is not None and runner.state.speed == q("16 m/s")
    assert runner.state.at == actor(clip_case(), "runner").state.at  # type: ignore[union-attr]  # clips have states
    assert actor(case, "others_03").body == (Delay(time=q("0.4 s")),)
    assert actor(case, "ego").state.speed == q("11 m/s")  # type: ignore[union-attr]  # clips have states
    assert case.meaning != clip_case().meaning
    assert case.mutant is not None and case.clip is CLIP


def test_a_mutant_that_changes_nothing_means_its_clip() -> None:
    assert mutated().meaning == clip_case().meaning
    assert [type(item) for item in mutated().scenario.body] == [type(item) for item in clip_case().scenario.body]


def test_a_mutant_of_a_mutant_sees_what_the_first_changed() -> None:
    first = mutated(change("runner.steer", "0", "0.12"))
    second = mutated(change("runner.steer", "0.120", "0.3"), of=first)
    assert actor(second, "runner").body == (Steers(value=q("0.3")),)
    with pytest.raises(InputError, match=r"runner\.steer is 0\.12 in the clip now, not 0"):
        mutated(change("runner.steer", "0", "0.3"), of=first)


@pytest.mark.parametrize(
    ("target", "was", "now", "has"),
    [
        ("runner.model", "car.sedan", "car.sports", "car.compact"),
        ("runner.steer", "0.10", "0.12", "0"),
        ("runner.timing", "0.90", "0.80", "1"),
        ("runner.delay", "1 s", "2 s", "0 s"),
        ("runner.speed", "17.2 m/s", "16 m/s", "17.220 m/s"),
    ],
)
def test_a_wrong_was_says_what_the_clip_has(target: str, was: str, now: str, has: str) -> None:
    with pytest.raises(InputError) as caught:
        mutated(change(target, was, now))
    (found,) = caught.value.diagnostics
    assert found.code == "FS123"
    assert found.message == f"{target} is {has} in the clip now, not {was}"
    assert found.help == f"write `change {target}: {has} => ...`"


@pytest.mark.parametrize(
    ("target", "was", "now", "code", "message"),
    [
        ("runer.timing", "1", "2", "FS037", "no actor 'runer'"),
        ("ego.steer", "0", "0.1", "FS124", "the driver under test drives it"),
        ("ego.timing", "1", "0.9", "FS124", "the driver under test drives it"),
        ("runner.steer", "0", "1.2", "FS124", "from -1 (right) to 1 (left)"),
        ("runner.timing", "1", "0", "FS124", "a factor above zero"),
        ("runner.delay", "0 s", "-1 s", "FS124", "zero or more"),
        ("runner.delay", "0 s", "1 m", "FS124", "needs time, but 1 m is length"),
        ("runner.speed", "17.22 m/s", "-1 m/s", "FS124", "zero or more"),
        ("runner.speed", "17.22 m/s", "1 m", "FS124", "needs speed, but 1 m is length"),
        ("runner.model", "car.compact", "car.sprots", "FS110", "no model 'car.sprots'"),
        ("runner.model", "car.compact", "bicycle.city", "FS038", "a vehicle cannot have the model 'bicycle.city'"),
    ],
)
def test_changes_that_cannot_be(target: str, was: str, now: str, code: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        mutated(change(target, was, now))
    (found,) = caught.value.diagnostics
    assert found.code == code
    assert message in f"{found.message} {found.help}"


def test_every_bad_change_is_reported_at_its_place() -> None:
    changes = (change("runer.timing", "1", "2"), change("runner.timing", "0.9", "2"))
    mutant = mutant_of(*changes)
    places = {(id(changes[0]), "actor"): Span(2, 10, 2, 15), (id(changes[1]), "was"): Span(3, 26, 3, 29)}
    text = "mutant m {\n  change runer.timing: 1 => 2\n  change runner.timing: 0.9 => 2\n}\n"
    document = Document(path="m.foresee", text=text, model=mutant, spans=places)
    with pytest.raises(InputError) as caught:
        expand_mutant(mutant, clip_case(), source=Path("m.foresee"), document=document)
    assert [(d.path, d.span, d.help) for d in caught.value.diagnostics] == [
        ("m.foresee", Span(2, 10, 2, 15), "did you mean 'runner'?"),
        ("m.foresee", Span(3, 26, 3, 29), "write `change runner.timing: 1 => ...`"),
    ]


def test_paths_are_found_from_the_childs_folder() -> None:
    used = (UseNetwork(path="networks/town.net.xml"), UseModels(path="../more.foresee"))
    scenario = Scenario(name="runner", body=(*used, *PARENT.scenario.body))
    parent = TestCase(
        id="a",
        scenario=scenario,
        network=NETWORK,
        models=MODELS,
        meaning=PARENT.meaning,
        source=Path("/project/scenarios/runner.foresee"),
    )
    clip = expand_clip(CLIP, parent, source=CHILDREN / "runner_p1.foresee")
    mutant = expand_mutant(mutant_of(), clip, source=CHILDREN / "more" / "m.foresee")
    for case, up in ((clip, "../.."), (mutant, "../../..")):
        scenario = expanded_model(case)
        assert scenario.first(UseNetwork) == UseNetwork(path=f"{up}/scenarios/networks/town.net.xml")
        assert scenario.first(UseModels) == UseModels(path=f"{up}/more.foresee")
        end = scenario.first(End)
        assert end is not None and end.where == "anywhere"  # the ego of a clip need not arrive
        assert [i for i in scenario.body if i is not end] == [i for i in case.scenario.body if not isinstance(i, End)]


def test_the_text_says_which_sensor_errors_it_does_not_repeat() -> None:
    for case, kind in ((clip_case(), "clip 'runner_p1'"), (mutated(), "mutant 'runner_p1_m1'")):
        text = expanded_text(case)
        assert parse(text, "full.foresee").model == expanded_model(case)
        comments = [line for line in text.splitlines() if line.startswith("# ")]
        assert kind in comments[0] and "parent's run from 12.40 s on" in comments[1] and len(comments) == 4
    begins = tuple(Window(start=q("0 s"), end=q("9 s")) if isinstance(i, Window) else i for i in CLIP.body)
    first = expand_clip(clip_of(PARENT.meaning, body=begins), PARENT, source=Path("c.foresee"))
    assert "ensor" not in expanded_text(first) and not expanded_text(PARENT).count("# ")


def test_an_inline_network_is_carried_along() -> None:
    assert expanded_model(clip_case()).first(Network) == NETWORK.model_copy(update={"name": "here"})
    assert expanded_model(PARENT).first(Network) is not None


def test_the_id_is_the_path_as_given() -> None:
    case = expand_clip(CLIP, PARENT, source=Path("out/c.foresee"))
    assert case.id == "out/c.foresee"
    assert case.source.is_absolute()


def test_who_an_expected_failure_is_with_is_an_actor_of_the_clip() -> None:
    body = (Expected(driver="team", outcome="fails", failure="F2", actor="kid"),)
    mutant = mutant_of().model_copy(update={"body": body})
    with pytest.raises(InputError) as caught:
        expand_mutant(mutant, clip_case(), source=Path("m.foresee"))
    (found,) = caught.value.diagnostics
    assert (found.code, found.message) == ("FS037", "unknown actor 'kid'")
    runner = body[0].model_copy(update={"actor": "runner"})
    assert expand_mutant(mutant.model_copy(update={"body": (runner,)}), clip_case(), source=Path("m.foresee"))
