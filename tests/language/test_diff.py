"""Differences are of meaning, in words."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.documents import plain
from foresee_dsl.errors import InputError
from foresee_dsl.language.diff.addresses import compare_addresses
from foresee_dsl.language.diff.compare import diff_models
from foresee_dsl.language.diff.parts import apply
from foresee_dsl.language.diff.plain import plain_text, texts
from foresee_dsl.language.diff.rendering import render_groups, render_markdown
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
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.concretise import concretise
from foresee_dsl.language.project.expand import expand_clip, expand_mutant, expanded_model
from tests.support.meaning_examples import SCENARIO, change, clip_of, example_case, mutant_of
from tests.support.worlds import model, q


def lines(a: Definition, b: Definition) -> list[str]:
    return [str(change) for change in diff_models(a, b)]


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
        ('"value":"1.2","unit":"s"', '"value":"1.3","unit":"s"', "case r01.gap: 1.2 s => 1.3 s (+0.1 s)"),
        ('"value":"0.3"', '"value":"0.5"', "weather.rain: 0.3 => 0.5 (+0.2)"),
        ('"value":"1.4"', '"value":"1.5"', "walker.speed: 1.4 m/s => 1.5 m/s (+0.1 m/s)"),
        ('"pedestrian.adult"', '"pedestrian.child"', "walker.model: pedestrian.adult => pedestrian.child"),
        (
            '"value":"50","unit":"km/h"',
            '"value":"60","unit":"km/h"',
            "param pace.default: 50 km/h => 60 km/h (+10 km/h)",
        ),
        ('"west","east_back"', '"west","north_back"', "runner.route: [west, east_back] => [west, north_back]"),
        ('"value":"7","unit":""', '"value":"8","unit":""', "others.seed: 7 => 8 (+1)"),
        ('"elapsed":{"value":"2"', '"elapsed":{"value":"3"', "signal j4.elapsed: 2 s => 3 s (+1 s)"),
        (
            '"order":"after"',
            '"order":"before"',
            "when ego.eta(j4) < 4 s: runner meets: ego at j4 after gap => ego at j4 before gap",
        ),
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
    assert str(found[0]) == "removed pedestrian walker: pedestrian.adult { ... }"
    assert lines(without("weather"), SCENARIO) == ["added weather: rain 0.3, wetness 0.4"]
    assert lines(without("expect"), SCENARIO)[0] == "added expect never collision(ego)"
    bare = Scenario(name="a", body=(Weather(),))
    assert [plain(d) for d in diff_models(bare, Scenario(name="a", body=(Weather(fog=q("0.2")),)))] == [
        {
            "group": "environment",
            "path": "weather.fog",
            "kind": "added",
            "was": None,
            "now": "0.2",
            "note": "",
            "edit": {"op": "set", "at": ["body", 0, "fog"], "value": {"value": "0.2", "unit": ""}, "rank": 0},
        }
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
        "junction j4: stage go.for: 25 s => 30 s (+5 s)",
        "order: j4, west => west, j4",
    ]


def test_catalogues() -> None:
    one = Catalogue(name="a", body=(model("car.sedan"), model("car.compact")))
    other = Catalogue(name="a", body=(model("car.sedan", q("5 m")),))
    assert lines(one, other) == ["model car.sedan.length: 4.2 m => 5 m (+0.8 m)", "removed model car.compact { ... }"]


def test_mutants_by_their_change_lines() -> None:
    one = mutant_of(change("a.steer", "0", "0.2", start="1 s"), change("a.timing", "1", "2"))
    other = mutant_of(change("a.steer", "0", "0.1", start="1 s"), change("a.timing", "1.0", "2.0"))
    assert lines(one, other) == ["change a.steer.now: 0.2 => 0.1 (-0.1)"]


def test_a_mutant_against_its_clip() -> None:
    parent = example_case(concretise(SCENARIO, "r02"))
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


BASE = """foresee 1

scenario base {
  doc "As it was."
  use network "town.foresee"

  weather wetness 0.4

  ego: car.sedan {
    route [main]
    start speed 36 km/h
  }
  vehicle runner: car.compact {
    route [main]
    start at 50 m along runner.route
    speed 50 km/h
  }
  vehicle lead: van.delivery {
    route [main]
    start at 90 m along main
  }

  when ego.eta(j4) < 4 s and not (time > 30 s or distance(ego, runner) <= 5 m) {
    runner ignores priority at j4
    lead stops for 4 s
  }
  when runner.speed > 10 m/s {
    lead changes lane left
  }

  expect never collision(ego)
  expect always ttc(ego, lead) > 1 s
  end after 20 s
}
"""

TOWN = """foresee 1

network town {
  junction a at (0 m, 0 m)
  junction j4 at (200 m, 0 m)
  road main from a to j4 { lanes 2; back 0 }
}
"""


def edited(*replacements: tuple[str, str]) -> list[str]:
    """What differs once the base scenario's text is edited, one line each."""
    return lines(model_of(BASE), model_of(with_edits(*replacements)))


def with_edits(*replacements: tuple[str, str]) -> str:
    text = BASE
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    return text


def model_of(text: str) -> Definition:
    return parse(text, "base.foresee").model


def test_layout_order_comments_and_units_do_not_count() -> None:
    same = with_edits(
        ("speed 50 km/h", "speed 13.888888889 m/s  # as fast"),
        ("    route [main]\n    start speed 36 km/h", "    start speed 10 m/s; route [main]"),
        ("  expect never collision(ego)\n  expect always ttc(ego, lead) > 1 s\n", ""),
        ("  weather", "  expect always ttc(ego, lead) > 1000 ms\n  expect never collision(ego)\n\n  weather"),
        ("As it was.", "Other words."),
    )
    assert diff_models(model_of(BASE), model_of(same)) == ()
    assert texts(model_of(BASE), model_of(same)) == (("doc", 'doc "As it was."', 'doc "Other words."'),)
    assert render_groups((), texts(model_of(BASE), model_of(same))) == (
        "no difference in meaning\n\nNo change of meaning: doc\n"
    )


WHEN = "when ego.eta(j4) < 4 s and not (time > 30 s or distance(ego, runner) <= 5 m)"


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("eta(j4) < 4 s", "eta(j4) < 5 s", f"{WHEN}: ego.eta(j4) < 4 s => ego.eta(j4) < 5 s (+1 s)"),
        ("<= 5 m", "<= 550 cm", f"{WHEN}: distance(ego, runner) <= 5 m => distance(ego, runner) <= 550 cm (+50 cm)"),
        ("not (time > 30 s or", "not (time < 30 s or", f"{WHEN}: time > 30 s => time < 30 s"),
        ("stops for 4 s", "stops for 3 s", f"{WHEN}: lead stops for: 4 s => 3 s (-1 s)"),
        ("ttc(ego, lead) > 1 s", "ttc(ego, lead) > 1.5 s",
         "expect always ttc(ego, lead) > 1 s: ttc(ego, lead) > 1 s => ttc(ego, lead) > 1.5 s (+0.5 s)"),
        ("start at 50 m", "start at 60 m",
         "runner.start at: 50 m along runner.route => 60 m along runner.route (+10 m)"),
        ("    speed 50 km/h\n", "", "removed runner.speed: 50 km/h"),
        ("vehicle lead: van", "vehicle lead: bus", "lead.model: van.delivery => bus.delivery"),
        ("end after 20 s", "end after 1 min", "end: after 20 s => after 1 min (+0.666667 min)"),
    ],
)  # fmt: skip
def test_one_edit_of_a_text_is_one_line(old: str, new: str, line: str) -> None:
    assert edited((old, new)) == [line]


def test_a_renamed_actor_is_one_difference() -> None:
    assert edited(("runner", "racer")) == ["renamed runner: racer"]
    assert edited(("runner", "racer"), ("speed 50", "speed 60")) != ["renamed runner: racer"]


def test_a_name_that_another_kind_of_statement_has_too_is_not_renamed() -> None:
    """The parameter keeps the name that the actor loses: renaming both went back and forth without end."""
    now = with_edits(("  ego:", "  param gap: time = 2 s in 0 s..4 s step 1 s\n\n  ego:"))
    differences = lines(model_of(now.replace("runner", "gap")), model_of(now))
    assert any("runner" in line for line in differences)
    assert not [line for line in differences if line.startswith("renamed")]


def test_the_order_of_actors_and_triggers_counts() -> None:
    def vehicles(text: str) -> tuple[str, str]:
        start = text.index("  vehicle runner")
        middle, end = text.index("  vehicle lead"), text.index("  when ego.eta")
        return text[start:middle], text[middle:end]

    first, second = vehicles(BASE)
    found = diff_models(model_of(BASE), model_of(BASE.replace(first + second, second + first)))
    assert [str(change) for change in found] == ["order: runner, lead => lead, runner"]
    assert found[0].kind == "moved"


def test_the_order_of_grids_counts() -> None:
    def with_params(*params: str) -> Definition:
        return model_of(with_edits(("  ego:", "".join(f"  param {param}\n" for param in params) + "\n  ego:")))

    first, second = (f"{name}: time = 1 s in 0 s..4 s step 1 s as grid" for name in ("gap", "pause"))
    free = "late: time = 2 s in 0 s..4 s step 1 s"
    grids, swapped = with_params(first, free, second), with_params(second, free, first)
    assert lines(grids, swapped) == ["order: gap, pause => pause, gap"]
    assert diff_models(apply(grids, diff_models(grids, swapped)), swapped) == ()
    assert plain_text(grids) != plain_text(swapped)
    assert lines(grids, with_params(first, second, free)) == []
    assert plain_text(grids) == plain_text(with_params(free, first, second))
    later = with_params(second, first.replace(" as grid", ""))  # the order counts once both are grids
    assert "order: gap, pause => pause, gap" not in lines(with_params(first, second), later)
    assert "order: pause, gap => gap, pause" in lines(later, with_params(first, second))


def test_everything_at_once_in_text() -> None:
    now = with_edits(
        ("speed 50 km/h", "speed 60 km/h\n    steers 0.12 from 4.00 s for 1.00 s"),
        ("36 km/h", "40 km/h"),
        ("wetness 0.4", "wetness 0.4, rain 0.2"),
        ("eta(j4) < 4 s", "eta(j4) < 5 s"),
        ("  when runner.speed > 10 m/s {\n    lead changes lane left\n  }\n", ""),
        ("  expect never collision(ego)\n", ""),
        ("end after 20 s", "end after 25 s"),
    )
    shown = render_groups(diff_models(model_of(BASE), model_of(now)))
    assert (
        shown
        == """\
Stimulus
  ~ runner.speed: 50 km/h => 60 km/h (+10 km/h)
  + runner.steers: 0.12 from 4.00 s for 1.00 s
  ~ when ego.eta(j4) < 4 s and not (time > 30 s or distance(ego, runner) <= 5 m)
      (+1 s)
      was ego.eta(j4) < 4 s
      now ego.eta(j4) < 5 s
  - when runner.speed > 10 m/s {
      lead changes lane left
    }

Ego
  ~ ego.start speed: 36 km/h => 40 km/h (+4 km/h)

Environment
  + weather.rain: 0.2

Expectation and end
  - expect never collision(ego)
  ~ end: after 20 s => after 25 s (+5 s)
"""
    )
    assert max(map(len, shown.splitlines())) <= 80


def test_colours_and_no_colours() -> None:
    found = diff_models(model_of(BASE), model_of(with_edits(("50 km/h", "60 km/h"))))
    assert "\033[33m  ~ runner.speed" in render_groups(found, colour=True)
    assert "\033" not in render_groups(found)


def test_markdown() -> None:
    now = with_edits(
        ("50 km/h", "60 km/h"),
        ("  when runner.speed > 10 m/s {\n    lead changes lane left\n  }\n", ""),
        ("As it was.", "Now."),
    )
    a, b = model_of(BASE), model_of(now)
    assert (
        render_markdown(diff_models(a, b), texts(a, b), old="a.foresee", new="b.foresee")
        == """\
**`a.foresee`** → **`b.foresee`**

### Stimulus

| | where | was | now | |
| --- | --- | --- | --- | --- |
| changed | `runner.speed` | `50 km/h` | `60 km/h` | +10 km/h |
| removed | `when runner.speed > 10 m/s` | see below |  |  |

<details><summary>when runner.speed &gt; 10 m/s</summary>

```diff
- when runner.speed > 10 m/s {
-   lead changes lane left
- }
```

</details>

<sub>No change of meaning: `doc`</sub>
"""
    )


def test_a_long_table_is_folded() -> None:
    many = "".join(f"  pedestrian p{n}: pedestrian.adult\n" for n in range(12))
    shown = render_markdown(
        diff_models(model_of(BASE), model_of(with_edits(("  when runner", f"{many}  when runner"))))
    )
    assert "<details><summary>12 differences</summary>" in shown


def test_part_of_the_differences_can_be_applied() -> None:
    a = model_of(BASE)
    b = model_of(with_edits(("50 km/h", "60 km/h"), ("20 s", "25 s"), ("wetness 0.4", "fog 0.1")))
    changes = diff_models(a, b)
    stimulus = apply(a, [change for change in changes if change.group == "stimulus"])
    assert lines(a, stimulus) == ["runner.speed: 50 km/h => 60 km/h (+10 km/h)"]
    assert diff_models(apply(a, changes), b) == ()
    with pytest.raises(ValueError, match="there is no"):
        apply(parse(TOWN, "town.foresee").model, changes)


def test_equal_meaning_is_equal_plain_text() -> None:
    same = with_edits(
        ("speed 50 km/h", "speed 13.888888889 m/s  # as fast"),
        ("    route [main]\n    start speed 36 km/h", "    start speed 10 m/s; route [main]"),
        ("  end after 20 s\n", ""),
        ("  weather", "  end after 20000 ms\n  weather"),
        ("As it was.", "Other words."),
    )
    assert plain_text(model_of(BASE)) == plain_text(model_of(same))
    assert "Other words." in plain_text(model_of(same), people=True)
    assert diff_models(model_of(BASE), model_of(plain_text(model_of(BASE)))) == ()
    assert plain_text(model_of(BASE)) != plain_text(model_of(with_edits(("50 km/h", "51 km/h"))))


# ---- files ---------------------------------------------------------------------------------------------------------


def write(folder: Path, name: str, text: str) -> str:
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    return str(file)


def test_files_are_compared_with_the_networks_that_they_use(tmp_path: Path) -> None:
    a, b = write(tmp_path, "one/base.foresee", BASE), write(tmp_path, "two/base.foresee", BASE)
    write(tmp_path, "one/town.foresee", TOWN)
    write(tmp_path, "two/town.foresee", TOWN.replace("lanes 2", "lanes 3"))
    found = compare_addresses(a, b)
    assert [(change.group, str(change)) for change in found.changes] == [("network", "road main.lanes: 2 => 3 (+1)")]
    write(tmp_path, "two/town.foresee", TOWN.replace("200 m", "20000 cm"))
    assert compare_addresses(a, b).changes == ()


def test_a_missing_network_leaves_what_the_files_say(tmp_path: Path) -> None:
    a = write(tmp_path, "a.foresee", BASE)
    b = write(tmp_path, "b.foresee", with_edits(("town.foresee", "other.foresee")))
    assert [str(change) for change in compare_addresses(a, b).changes] == [
        'use network: "town.foresee" => "other.foresee"',
    ]


def test_two_cases_of_a_file(tmp_path: Path) -> None:
    write(tmp_path, "town.foresee", TOWN)
    cases = "  param pace: speed = 50 km/h\n  case slow { pace = 30 km/h }\n  case fast { pace = 60 km/h }\n"
    file = write(
        tmp_path, "base.foresee", with_edits(("  weather", f"{cases}\n  weather"), ("speed 50 km/h", "speed pace"))
    )
    found = compare_addresses(f"{file}::slow", f"{file}::fast")
    assert [str(change) for change in found.changes] == ["runner.speed: 30 km/h => 60 km/h (+30 km/h)"]
    assert plain(found)["groups"] == ["stimulus"]


def test_bare_crossings_are_something_that_is_written() -> None:
    junction = "foresee 1\n\nnetwork n {\n  junction j at (0 m, 0 m)"
    without, bare = (parse(junction + rest, "n.foresee").model for rest in ("\n}\n", " { crossings }\n}\n"))
    (added,), (removed,) = diff_models(without, bare), diff_models(bare, without)
    assert (added.kind, added.was, added.now) == ("added", None, "crossings")
    assert (removed.kind, removed.was, removed.now) == ("removed", "crossings", None)
