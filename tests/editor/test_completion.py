"""What is offered at a place: words of the grammar, names that fit, units of the right dimension."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.editor.completion import complete
from foresee_dsl.editor.files import Files

HEAD = """foresee 1

# a { that opens nothing
scenario a {
  use network "networks/town.foresee"
  param gap: time = 1 s
  param pace: speed = 1 m/s
  param way: turn = left
  param lead_model: model = car.compact
  param approach: arm = mill_west
  this is not a statement {
  }
  ego: car.sedan { route from mill_west straight over mill_oak }
  vehicle runner: car.compact {
    """
BELOW = HEAD + "}\n  "
ROAD = "foresee 1\n\nnetwork n {\n  junction a at (0 m, 0 m)\n  junction b at (200 m, 0 m)\n  road r from a to b\n  "
STOPS = ROAD.replace("network n", "scenario s {\n  network") + (
    "stop market on r at 140 m bay 3 m\n  }\n  ego: car.sedan { route [r] }\n  vehicle liner: bus.city { "
)
ANYWHERE = {"ego", "vehicle", "bicycle", "when", "expect", "end", "case", "param", "signal", "traffic", "weather"}


SIGNALS = ["king_quay", "king_oak", "king_elm", "king_ash", "mill_elm", "park_elm", "park_ash"]


def offered(scenarios: Path, text: str) -> list[str]:
    path = scenarios / "new.foresee"
    files = Files({path: text}, [scenarios])
    return [suggestion.text for suggestion in complete(files, path, text, len(text)).suggestions]


def test_files_of_tracks_are_offered_for_use_tracks(tmp_path: Path) -> None:
    (tmp_path / "cut.tracks.csv").write_text("")
    (tmp_path / "town.foresee").write_text("")
    assert offered(tmp_path, BELOW + 'use tracks "') == ["cut.tracks.csv"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (HEAD + "speed 50 ", ["m/s", "km/h", "mph"]),
        (HEAD + "speed 50 k", ["m/s", "km/h", "mph"]),
        (HEAD + "delay 2 ", ["s", "ms", "min"]),
        (HEAD + "speed ", ["pace", "50 km/h"]),
        (HEAD + "meets ego at mill_oak after ", ["gap", "2.5 s"]),
        (HEAD + "meets ", ["ego", "runner"]),
        (HEAD + "ignores ", ["signals", "priority"]),
        (HEAD + "route from mill_west ", ["straight", "left", "right", "back", "way"]),
        (HEAD + "start at 20 ", ["m", "cm", "km", "ahead", "along", "before", "behind", "past"]),
        (HEAD + 'doc "start ', []),
        (ROAD + "stop market on r at 40 m ", ["bay", "length"]),
        (ROAD + "stop market on r at 40 m bay 3 ", ["m", "cm", "km"]),
        (HEAD + "# start ", []),
        (BELOW + "when ego.eta(mill_oak) < 3 s { ego changes lane ", ["left", "right"]),
        (BELOW + "when time > 3 s { ", ["ego", "runner", *SIGNALS, "approach", "door", "limit", "then", "wait"]),
        (BELOW + "when time > 3 s { king_oak turns to ", ["ew_go", "ns_go"]),
        (BELOW + "when time > 3 s { door of runner ", ["closes", "opens"]),
        (BELOW + "when time > 3 s { runner changes ", ["lane", "line", "speed"]),
        (BELOW + "when ego.signal(mill_elm) is ", ["green", "amber", "red"]),
        (BELOW + "when signal(mill_elm) is ", ["ew_go", "ns_go"]),
        (BELOW + "require gap < 2 ", ["s", "ms", "min", "and", "for", "or"]),
        (BELOW + "signal mill_elm stage ", ["ew_go", "ns_go"]),
        (BELOW + "case x { ", ["gap", "pace", "way", "lead_model", "approach"]),
        (BELOW + "case x { gap = 3 ", ["s", "ms", "min"]),
        (BELOW + "case x { way = ", ["straight", "left", "right", "back"]),
        ("", ["foresee"]),
        ("foresee 1\n\n", ["campaign", "clip", "models", "mutant", "network", "scenario"]),
    ],
)
def test_exactly(scenarios: Path, text: str, expected: list[str]) -> None:
    found = offered(scenarios, text)
    assert [word for word in found if word not in ("side",)] == expected


@pytest.mark.parametrize(
    ("text", "some", "none"),
    [
        (HEAD, {"route", "speed", "start", "ignores"}, {"when", "lanes", "ego"}),
        (BELOW, ANYWHERE, {"lanes", "route", "stops"}),
        (STOPS + "start at ", {"market", "beside", "the"}, {"liner", "r"}),
        (BELOW + "tr", {"traffic"}, {"route"}),
        (HEAD + "route from ", {"mill_west", "mill_west_back", "approach"}, {"mill_oak", "runner", "gap"}),
        (HEAD + "route from mill_west straight over ", {"mill_oak", "king_elm"}, {"mill_west", "runner", "gap"}),
        (HEAD + "start at 20 m along ", {"mill_west", "ego.route", "runner.route"}, {"ego", "mill_oak"}),
        (HEAD + "route [mill_west, ", {"mill_mid"}, {"mill_oak"}),
        (HEAD + 'route ["', {"mill_mid"}, {"mill_oak", "route"}),
        (BELOW + "when ", {"ego.speed", "ego.eta", "time", "ttc", "not"}, {"ego.time", "stops", "mill_oak"}),
        (BELOW + "when ego.", {"ego.speed", "ego.eta"}, set()),
        (BELOW + "when ego ", {"in", "within"}, {"stops"}),
        (BELOW + "when ", {"ego", "runner"}, {"mill_west"}),
        (BELOW + "when ego in junction ", {"mill_oak"}, {"mill_west", "runner"}),
        (BELOW + "when ego within 5 m of ", {"runner", "mill_oak"}, {"mill_west"}),
        (BELOW + "param x: time = 1 s in 0 s..2 s as ", {"uniform", "normal", "grid"}, {"s"}),
        (BELOW + "when ego.eta(", {"mill_oak"}, {"runner", "mill_west"}),
        (BELOW + "when ttc(", {"runner"}, {"mill_oak"}),
        (BELOW + "when distance(ego, ", {"runner", "mill_oak"}, {"mill_west"}),
        (BELOW + "when time > 3 s { ego ", {"stops", "starts", "changes", "meets"}, {"route", "when"}),
        (BELOW + "expect always ego.speed > 3 ", {"km/h", "and"}, {"s", "kg"}),
        (BELOW + "vehicle b: ", {"car.sedan", "lead_model"}, {"gap", "runner"}),
        (BELOW + "param x: ", {"time", "length", "turn"}, {"ego"}),
        (BELOW + "param x: arm = ", {"mill_west"}, {"mill_oak", "gap"}),
        (BELOW + 'use network "', {"networks/town.foresee"}, {"new.foresee"}),
        (BELOW + "network { junction a at (0 m, 0 m) ", {"signals", "stop"}, {"red"}),
        (
            'foresee 1\nmutant a of "scenario7.foresee" pin sha256:000000000000 {\n  change ',
            {"ego.model", "ego.speed", "runner.steer", "runner.timing", "weather.rain"},
            {"ego", "ego.route", "ego.steer", "ego.timing"},
        ),
    ],
)
def test_some_and_not_others(scenarios: Path, text: str, some: set[str], none: set[str]) -> None:
    found = set(offered(scenarios, text))
    assert some <= found
    assert not none & found


def test_every_prefix_of_every_file_has_an_answer(root: Path) -> None:
    """No text that is half written ends in an exception, and most places have something to offer."""
    path = root / "tests" / "cases" / "language" / "everything.foresee"
    text = path.read_text(encoding="utf-8")
    answers = [
        bool(complete(Files({path: text[:k]}, []), path, text[:k], k).suggestions) for k in range(0, len(text), 113)
    ]
    assert sum(answers) > len(answers) / 3


@pytest.mark.parametrize(
    ("line", "some"),
    [
        ("exp", {"expected"}),
        ("expected pdm ", {"passes", "fails", "in"}),
        ("expected pdm fails ", {"F2", "stuck"}),
        ("expected pdm fails F2 ", {"with"}),
    ],
)
def test_expected_results_are_offered_in_a_mutant(scenarios: Path, line: str, some: set[str]) -> None:
    text = f'foresee 1\nmutant a of "scenario7.foresee" pin sha256:000000000000 {{\n  {line}'
    assert some <= set(offered(scenarios, text))


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ("runner.ignores: ", ["nothing", "signals", "priority"]),
        ("runner.speed: 9 ", ["m/s", "km/h", "mph"]),
        ("runner.delay: 0.00 s => ", ["2.5 s"]),
        ("weather.rain: 0 => ", ["0.3"]),
    ],
)
def test_values_of_the_changed_property_are_offered(scenarios: Path, changed: str, expected: list[str]) -> None:
    text = f'foresee 1\nmutant a of "scenario7.foresee" pin sha256:000000000000 {{\n  change {changed}'
    assert offered(scenarios, text) == expected
    models = offered(scenarios, text.replace(changed, "runner.model: "))
    assert "car.compact" in models and "gap" not in models


def test_a_condition_begins_with_a_measure(scenarios: Path) -> None:
    found = offered(scenarios, BELOW + "when ")
    assert found.index("ego.speed") < found.index("gap")
    required = offered(scenarios, BELOW + "require ")
    assert required.index("gap") < required.index("ego.speed")


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project with files of all kinds in folders beside each other."""
    (tmp_path / ".gitattributes").write_text("")
    for name, kind in (
        ("scenarios/near", "scenario near"),
        ("scenarios/sub/lane", "network lane"),
        ("networks/docks", "network docks"),
        ("models", "models"),
        ("clips/cut", 'clip cut of "../scenarios/near.foresee"'),
        ("campaign", "campaign all"),
    ):
        file = tmp_path / f"{name}.foresee"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"foresee 1\n\n{kind} {{\n}}\n")
    (tmp_path / "networks" / "town.net.xml").write_text("")
    (tmp_path / "tracks").mkdir()
    (tmp_path / "tracks" / "cut.tracks.csv").write_text("")
    return tmp_path


LANE, DOCKS, TOWN = "sub/lane.foresee", "../networks/docks.foresee", "../networks/town.net.xml"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (BELOW + 'use network "', [LANE, DOCKS, TOWN]),
        (BELOW + 'use network "../', [DOCKS, TOWN]),
        (BELOW + 'use network "../networks/d', [DOCKS]),
        (BELOW + 'use network "dock', [DOCKS]),
        (BELOW + 'use network "../else', []),
        (BELOW + 'use models "', ["../models.foresee"]),
        (BELOW + 'use tracks "../t', ["../tracks/cut.tracks.csv"]),
        ('foresee 1\n\nscenario a extends "', ["near.foresee"]),
        ('foresee 1\n\nclip a of "', ["near.foresee", "../clips/cut.foresee"]),
        ('foresee 1\n\nmutant a of "', ["../clips/cut.foresee"]),
        ('foresee 1\n\ncampaign a {\n  seeds "', ["near.foresee"]),
    ],
)
def test_files_of_the_right_kind_are_offered_in_the_whole_project(
    project: Path, text: str, expected: list[str]
) -> None:
    path = project / "scenarios" / "x.foresee"
    completed = complete(Files({path: text}, [project]), path, text, len(text))
    assert [suggestion.text for suggestion in completed.suggestions] == expected
    assert completed.replaces == len(text) - text.rindex('"') - 1
