"""Differences are of meaning, in words."""

from __future__ import annotations

from pathlib import Path

import pytest
from meaning_examples import SCENARIO, case_of, change, clip_of, model, mutant_of, q

from foresee_dsl.errors import InputError
from foresee_dsl.language.concretise import concretise
from foresee_dsl.language.diff import diff_addresses, diff_models, render_text, to_dict
from foresee_dsl.language.expand import expand_clip, expand_mutant, expanded_model
from foresee_dsl.language.model import (
    Catalogue,
    Definition,
    Doc,
    EdgeRoute,
    Item,
    Junction,
    Network,
    Road,
    Scenario,
    Stage,
    Weather,
)

SAMPLES = Path(__file__).parent.parent / "cases" / "language"


def lines(a: Definition, b: Definition) -> list[str]:
    return render_text(diff_models(a, b)).splitlines()


def replaced(pattern: str, by: str) -> Scenario:
    text = SCENARIO.model_dump_json()
    assert pattern in text
    return Scenario.model_validate_json(text.replace(pattern, by))


def test_the_same_meaning_has_no_difference() -> None:
    assert lines(SCENARIO, SCENARIO) == []
    other = replaced('{"value":"1.2","unit":"s"}', '{"value":"1200","unit":"ms"}')
    other = other.model_copy(update={"name": "x", "body": tuple(i for i in other.body if not isinstance(i, Doc))})
    assert lines(SCENARIO, other) == []


@pytest.mark.parametrize(
    ("pattern", "by", "line"),
    [
        ('"value":"1.2","unit":"s"', '"value":"1.3","unit":"s"', "case r01.gap: 1.2 s => 1.3 s"),
        ('"value":"0.3"', '"value":"0.5"', "weather.rain: 0.3 => 0.5"),
        ('"value":"1.4"', '"value":"1.5"', "walker.speed: 1.4 m/s => 1.5 m/s"),
        ('"pedestrian.adult"', '"pedestrian.child"', "walker.model: pedestrian.adult => pedestrian.child"),
        ('"value":"50","unit":"km/h"', '"value":"60","unit":"km/h"', "param pace.default: 50 km/h => 60 km/h"),
        ('"west","east_back"', '"west","north_back"', "runner.route: [west, east_back] => [west, north_back]"),
        ('"value":"7","unit":""', '"value":"8","unit":""', "others.seed: 7 => 8"),
        ('"elapsed":{"value":"2"', '"elapsed":{"value":"3"', "signal j4.elapsed: 2 s => 3 s"),
        ('"order":"after"', '"order":"before"', "when eta(ego, j4) < 4 s.runner meets.order: after => before"),
    ],
)
def test_one_changed_value_is_one_line(pattern: str, by: str, line: str) -> None:
    assert lines(SCENARIO, replaced(pattern, by)) == [line]


def test_added_and_removed_statements() -> None:
    def without(*kinds: str) -> Scenario:
        kept: tuple[Item, ...] = tuple(item for item in SCENARIO.body if item.kind not in kinds)
        return SCENARIO.model_copy(update={"body": kept})

    found = diff_models(SCENARIO, without("pedestrian", "case"))
    assert [(d.path, d.now) for d in found] == [("walker", None), ("case r01", None), ("case r02", None)]
    assert str(found[0]) == "removed walker: pedestrian.adult"
    assert lines(without("weather"), SCENARIO) == ["added weather: 0.3 0.4"]
    assert lines(without("expect"), SCENARIO)[0] == "added expect never collision(ego)"
    bare = Scenario(name="a", body=(Weather(),))
    assert [to_dict(d) for d in diff_models(bare, Scenario(name="a", body=(Weather(fog=q("0.2")),)))] == [
        {"path": "weather.fog", "was": None, "now": "0.2"}
    ]


def test_networks() -> None:
    j4 = Junction.model_validate({"name": "j4", "at": {"x": q("0 m"), "y": q("0 m")}, "control": "signals"})
    stages = tuple(Stage(name="go", green=("west",), duration=q(f"{n} s")) for n in (25, 30))
    before = Network(
        name="a", body=(j4.model_copy(update={"stages": stages[:1]}), Road(name="west", start="w", end="j4"))
    )
    after = Network(
        name="b",
        body=(
            Road(name="west", start="w", end="j4", lanes=q("2")),
            j4.model_copy(update={"stages": stages[1:], "control": "stop"}),
        ),
    )
    assert sorted(lines(before, after)) == [
        "added road west.lanes: 2",
        "junction j4.control: signals => stop",
        "junction j4.stage go.duration: 25 s => 30 s",
    ]


def test_catalogues() -> None:
    one = Catalogue(name="a", body=(model("car.sedan"), model("car.compact")))
    other = Catalogue(name="a", body=(model("car.sedan", "5 m"),))
    assert lines(one, other) == ["model car.sedan.length: 4.2 m => 5 m", "removed model car.compact: 4.2 m 1.8 m ours"]


def test_mutants_by_their_change_lines() -> None:
    one = mutant_of(change("a.steer", "0", "0.2", start="1 s"), change("a.timing", "1", "2"))
    other = mutant_of(change("a.steer", "0", "0.1", start="1 s"), change("a.timing", "1.0", "2.0"))
    assert lines(one, other) == ["a.steer.now: 0.2 => 0.1"]


def test_a_mutant_against_its_clip() -> None:
    parent = case_of(concretise(SCENARIO, "r02"))
    clip = expand_clip(clip_of(parent.meaning), parent, source=Path("c.foresee"))
    changes = (change("runner.model", "car.compact", "car.sports"), change("runner.timing", "1", "0.8"))
    mutant = expand_mutant(mutant_of(*changes), clip, source=Path("m.foresee"))
    assert lines(expanded_model(clip), expanded_model(mutant)) == [
        "runner.model: car.compact => car.sports",
        "added runner.timing: 0.8",
    ]


def test_a_statement_of_another_form_is_a_change() -> None:
    route = next(item for item in SCENARIO.actors[0].body)
    ego = SCENARIO.actors[0].model_copy(update={"body": (EdgeRoute(edges=("south",)),)})
    body = tuple(ego if item is SCENARIO.actors[0] else item for item in SCENARIO.body)
    (found,) = diff_models(SCENARIO, SCENARIO.model_copy(update={"body": body}))
    assert found.path == "ego.route"
    assert found.was is not None and found.now == "[south]"
    assert route.kind == "route"


def test_two_kinds_cannot_be_compared() -> None:
    with pytest.raises(InputError, match="is a scenario, but"):
        diff_models(SCENARIO, mutant_of())


def test_files() -> None:
    everything = str(SAMPLES / "everything.foresee")
    assert diff_addresses(everything, everything) == ()
    found = render_text(diff_addresses(f"{everything}::r01", f"{everything}::r02")).splitlines()
    assert "exact.timing" not in found
    assert any("gap: 1.2 s => 2.1 s" in line for line in found)
