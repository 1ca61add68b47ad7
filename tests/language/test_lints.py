"""Lints: what is reported and what is not, comments that allow them, and whether an expectation became weaker."""

from __future__ import annotations

from pathlib import Path

import pytest

from foresee_dsl.language.checked_files import check_paths
from foresee_dsl.language.codes import every_code
from foresee_dsl.language.logic import weaker
from foresee_dsl.language.model import Expect, Scenario
from foresee_dsl.language.parser import format_text, parse
from tests.support.code_frames import FRAMES, example
from tests.support.examples_at_work import found_in

HEAD = FRAMES["scenario"].partition("@")[0]
TOWN = example(every_code()["FS301"], "end after 60 s").files["town.foresee"]


@pytest.fixture
def codes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Return a function from the lines of a scenario to the codes and lines of what is reported."""
    monkeypatch.chdir(tmp_path)
    Path("town.foresee").write_text(TOWN)

    def check(lines: str, head: str = HEAD) -> list[tuple[str, str]]:
        text = f"{head}{lines}\n}}\n"
        Path("main.foresee").write_text(text)
        found = check_paths(["main.foresee"]).diagnostics
        assert all(d.span is not None and d.source_line == text.split("\n")[d.span.line - 1] for d in found)
        return [(d.code, d.source_line.strip()) for d in found]

    return check


@pytest.mark.parametrize(
    "condition",
    [
        "time > 60 s",
        "time >= 61 s",
        "ego.speed < 0 m/s",
        "ttc(ego, runner) <= -1 s",
        "distance(ego, runner) < 0 m",
        "ego.eta(j4) < 0 s",
        "time < 5 s and time > 6 s",
        "ego.speed > 5 m/s and not ego.speed > 4 m/s",
        "time > 70 s or ego.speed < 0 m/s",
        "not time >= 0 s",
        "ego.speed > 5 m/s and (runner.speed > 1 m/s and ego.speed <= 5 m/s)",
        "ego.speed > 5 m/s for 90 s",
        "runner.speed > 400 km/h",
        "crate.speed > 0 m/s",
        "arrived(crate)",
        "not (time >= 0 s or arrived(ego))",
        "runner in junction side_end",
        "ego.signal(j4) is red and ego.signal(j4) is green",
        "signal(j4) is ns_go and signal(j4) is ew_go",
        "ego ahead of runner and ego behind runner",
        "ego ahead of ego",
        "ego in lane 1 and ego in lane 2",
        "collision(runner) and not collision(runner)",
        "ego within 5 m of runner and distance(ego, runner) > 6 m",
        "lateral(ego, runner) < 0 m",
        "ego.offset > 6 m",
        "overlap(ego, runner) > 12 m",
        "relative_speed(runner, ego) > 900 km/h",
    ],
)
def test_a_trigger_that_can_never_fire(codes, condition: str):
    crate = "  obstacle crate: obstacle.crate { start at 70 m along ego.route }\n" if "crate" in condition else ""
    assert codes(f"{crate}  when {condition} {{\n    runner stops\n  }}") == [("FS303", f"when {condition} {{")]


@pytest.mark.parametrize(
    "condition",
    [
        "time >= 60 s",
        "time > 59 s",
        "ego.speed <= 0 m/s",
        "distance(ego, j4) < 0 m",  # negative once it is in the junction
        "ego.acceleration < -3 m/s^2",
        "time > 5 s and time < 6 s",
        "ego.speed >= 5 m/s and ego.speed <= 5 m/s",
        "ego.speed > 5 m/s and runner.speed < 4 m/s",
        "not time > 3 s",
        "runner.speed > 100 km/h",
        "ego.signal(j4) is red or ego.signal(j4) is green",
        "ego in junction west_end",  # where its road begins
        "relative_speed(ego, runner) < 0 m/s",
        "overlap(ego, runner) > 4 m",
        "ego ahead of runner or ego behind runner",
        "ego.speed > 5 m/s for 2 s",
    ],
)
def test_a_trigger_that_may_fire(codes, condition: str):
    assert codes(f"  when {condition} {{\n    runner stops\n  }}") == []


@pytest.mark.parametrize(
    "condition",
    [
        "cutter.speed > 1 m/s",
        "cutter.speed < -1 m/s",
        "cutter.speed > 400 km/h",
        "cutter in junction side_end",
        "relative_speed(cutter, ego) > 900 km/h",
        "distance(ego, cutter) < 5 m",
    ],
)
def test_a_recorded_track_may_hold_any_movement(codes, condition: str):
    Path("a.tracks.csv").write_text("time_s,actor,x_m,y_m,heading_deg,speed_mps\n0.00,17,-90.000,-1.650,0.00,10.000\n")
    track = '  use tracks "a.tracks.csv"\n  vehicle cutter: car.compact { track "17" }\n'
    lines = f"{track}  when {condition} {{\n    runner stops\n  }}\n  expect eventually {condition}"
    assert [code for code, _ in codes(lines)] == ["FS317"]  # the file is not pinned


@pytest.mark.parametrize(
    ("condition", "code"),
    [
        ("runner.speed < -1 m/s", []),
        ("relative_speed(runner, ego) < -250 km/h", []),
        ("ego.speed < -1 m/s", ["FS303"]),
        ("runner.eta(j4) < 0 s", ["FS303"]),
    ],
)
def test_an_actor_that_reverses_has_speeds_below_zero(codes, condition: str, code: list[str]):
    reverses = "  when time > 1 s {\n    runner reverses 25 m at 6 m/s\n  }\n"
    assert [code for code, _ in codes(f"{reverses}  when {condition} {{\n    runner stops\n  }}")] == code


def test_an_actor_that_follows_a_path_may_come_to_other_junctions(codes):
    leads = "  when time > 1 s {\n    runner follows [20 m ahead of runner] then joins [main, side_back]\n  }\n"
    asked = "  when runner in junction side_end {\n    runner stops\n  }"
    assert codes(leads + asked) == []
    assert [code for code, _ in codes(asked)] == ["FS303"]


@pytest.mark.parametrize(
    ("route", "condition", "reported"),
    [
        ("route [west, main]", "box.eta(side_end) < 4 s", True),
        ("route [west, main]", "box.eta(side_end) > 4 s", False),  # it is infinite
        ("route [west, main]", "not box.eta(side_end) < 4 s", False),
        ("route [west, main]", "not not box.eta(side_end) < 4 s", True),
        ("route [west, main]", "not (box.speed > 1 m/s and box.eta(side_end) > 4 s)", True),
        ("route [west, main]", "not distance(box, side_end) < 4 m", True),
        ("route [west, main]", "distance(box, side_end) > 4 m", True),
        ("route [west, main]", "box.eta(j4) < 4 s", False),
        ("route [west, main]", "box.eta(j5) < 4 s", True),  # the route ends there
        ("route [west, main, east]", "box.eta(j5) < 4 s", False),
        ("route from west straight over j4", "box.eta(j4) < 4 s", False),
        ("route from west straight over j4", "box.eta(j5) < 4 s", True),
        ("route from west straight over j4", "box.eta(west_end) < 4 s", True),
        ("route from west straight over j4 straight over j5", "box.eta(j5) < 4 s", False),
        ("route from west straight over j4 straight over j5", "box.eta(side_end) < 4 s", True),
        ("route [west]", "box.eta(j4) < 4 s", True),
        ("route [west, ..., east]", "box.eta(side_end) < 4 s", False),  # the lints do not look for ways
    ],
)
def test_a_junction_that_a_route_does_not_go_over(codes, route: str, condition: str, reported: bool):
    lines = f"  vehicle box: car.compact {{ {route} }}\n  when {condition} {{\n    runner stops\n  }}"
    assert [code for code, _ in codes(lines)] == ["FS304"] * reported


@pytest.mark.parametrize(
    "condition",
    [
        "time > 70 s or ego.speed > 1 m/s",
        "ego.speed > 1 m/s and not time > 70 s",
        "ego.speed > 1 m/s and ego.speed >= 0 m/s",
        "ego.speed > 1 m/s or (runner.speed > 900 km/h and ego.speed > 2 m/s)",
        "distance(ego, ego) < 5 m",
        "ttc(runner, runner) < 5 s and ego.speed > 1 m/s",
    ],
)
def test_a_part_of_a_condition_that_says_nothing(codes, condition: str):
    assert codes(f"  when {condition} {{\n    runner stops\n  }}") == [("FS315", f"when {condition} {{")]
    assert [code for code, _ in codes(f"  expect never ({condition})")] == ["FS315"]


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        ("runner stops\n then { wait 1 s }", ["FS303"]),
        ("runner stops for 2 s\n then { wait 1 s }", []),
        ("wait 61 s\n then { runner stops }", ["FS303"]),
        ("wait 30 s\n then { wait 20 s\n then { wait 20 s }\n then { runner stops } }", []),
        ("wait 30 s\n then { wait 31 s\n then { runner stops } }", ["FS303"]),
        ("then when time > 70 s { runner stops }", ["FS303"]),
        ("then when time > 70 s or ego.speed > 3 m/s { runner stops }", ["FS315"]),
    ],
)
def test_steps_that_never_come(codes, steps: str, expected: list[str]):
    assert [code for code, _ in codes(f"  when time > 5 s {{\n{steps}\n  }}")] == expected


@pytest.mark.parametrize(
    "action",
    [
        *("changes speed to 3 m/s", "leaves", "reverses 5 m at 2 m/s", "follows ego gap 2 s", "matches ego"),
        *("stops at (0 m, -20 m)", "synchronises at (0 m, -20 m) with ego at (-20 m, 0 m)", "brakes 2 m/s^2 for 1 s"),
    ],
)
def test_a_stop_that_another_trigger_ends_is_no_end(codes, action: str):
    again = f"  when time > 9 s {{\n    runner {action}\n  }}\n"
    assert codes(f"{again}  when time > 5 s {{\n    runner stops\n    then {{ wait 1 s }}\n  }}") == []


def test_what_leaves_the_speed_alone_ends_no_stop(codes):
    again = "  when time > 9 s {\n    runner ignores signals\n    ego ignores signals\n  }\n"
    found = codes(f"{again}  when time > 5 s {{\n    runner stops\n    then {{ wait 1 s }}\n  }}")
    assert ("FS303", "then { wait 1 s }") in found


@pytest.mark.parametrize(
    ("requirement", "expected"),
    [
        ("gap > 5 s", ["FS053"]),
        ("gap <= 4 s", ["FS315"]),
        ("gap > 1 s", []),
        ("gap < long", ["FS315"]),
        ("kind is car.sports", ["FS033"]),
        ("kind is car.compact or gap > 9 s", ["FS315"]),
        ("kind is car.compact or gap > 1 s", []),
        ("any > 20 s or kind is car.compact", []),
    ],
)
def test_requirements_that_say_nothing(codes, requirement: str, expected: list[str]):
    params = """  param gap: time = 2 s in 0 s..4 s
  param long: time = 8 s in [6 s, 8 s]
  param any: time = 30 s
  param kind: model = car.compact in [car.compact, car.suv]
  vehicle more: kind { route from north straight over j4 }
  when time > gap and time < long and time < any { runner stops }
"""
    found = codes(f"{params}  require {requirement}\n  case a {{ gap = 3 s }}")
    assert [code for code, _ in found] == expected


def test_only_the_ego_sees(codes):
    assert codes("  when ego sees runner {\n    runner stops\n  }") == []
    found = codes("  when runner sees ego or time > 3 s {\n    runner stops\n  }")
    assert found == [("FS316", "when runner sees ego or time > 3 s {")]


def test_the_end_of_the_run_counts(codes):
    lines = "  end after 10 s\n  when time > 20 s {\n    runner stops\n  }"
    assert codes(lines) == [("FS303", "when time > 20 s {")]
    assert codes(lines.replace("10 s", "30 s")) == []


def test_what_follows_in_a_sequence_counts_too(codes):
    lines = "  when time > 2 s {\n    runner stops for 1 s\n    then when time > 80 s {\n      runner stops\n    }\n  }"
    assert codes(lines) == [("FS303", "then when time > 80 s {")]


def test_values_of_cases_are_looked_at_and_said_once(codes):
    lines = "  param late: time = 10 s\n  when time > late {\n    runner stops\n  }\n"
    assert codes(lines) == []
    assert codes(lines + "  case a { late = 20 s }\n  case b { late = 90 s }\n  case c { late = 95 s }") == [
        ("FS303", "when time > late {")
    ]


@pytest.mark.parametrize(
    ("expectation", "expected"),
    [
        ("never ego.speed < 0 m/s", ["FS307"]),
        ("always ttc(ego, runner) >= 0 s", ["FS307"]),
        ("always ego.speed < 0 m/s", ["FS307"]),
        ("eventually time > 80 s", ["FS307"]),
        ("eventually within 5 s time > 6 s", ["FS307"]),
        ("never within 90 s collision(ego)", ["FS306"]),
        ("eventually within 60 s arrived(ego)", []),
        ("always ttc(ego, runner) > 1 s", []),
        ("never (collision(ego) or ego.speed > 60 km/h)", []),
        ("eventually time > 50 s", []),
    ],
)
def test_expectations_that_say_nothing(codes, expectation: str, expected: list[str]):
    assert [code for code, _ in codes(f"  expect {expectation}")] == expected


@pytest.mark.parametrize(
    ("action", "expected"),
    [
        ("crate stops", True),
        ("crate changes speed to 3 m/s", True),
        ("walker changes lane left", True),
        ("still starts", True),
        ("ego changes lane left", True),
        ("rider changes lane right", True),
        ("walker starts", False),
        ("walker changes speed to 1 m/s", False),
        ("runner changes lane left", False),
        ("runner meets ego at j4 after 1 s", False),
        ("rider stops", False),
    ],
)
def test_actions_that_cannot_be_done(codes, action: str, expected: bool):
    lines = f"""\
  obstacle crate: obstacle.crate {{
    start at 70 m along ego.route
  }}
  pedestrian walker: pedestrian.adult {{
    path [(-30 m, -9 m), (-30 m, 9 m)]
  }}
  pedestrian still: pedestrian.adult {{
    start at (-50 m, -9 m)
  }}
  bicycle rider: bicycle.city {{
    path [(-60 m, -9 m), (-60 m, 9 m)]
  }}
  when time > 1 s {{
    {action}
  }}"""
    assert codes(lines) == ([("FS305", action)] if expected else [])


def test_speeds_are_compared_with_the_models_of_the_file(codes, tmp_path: Path):
    models = "foresee 1\n\nmodels ours {\n  model car.slow { length 4 m; width 2 m; max_speed 20 km/h }\n}\n"
    (tmp_path / "ours.foresee").write_text(models)
    slow = '  use models "ours.foresee"\n  vehicle late: car.slow {\n    route [north]\n    @\n  }'
    assert codes(slow.replace("@", "speed 30 km/h")) == [("FS308", "speed 30 km/h")]
    assert codes(slow.replace("@", "start speed 30 km/h")) == [("FS308", "start speed 30 km/h")]
    assert codes(slow.replace("@", "speed 20 km/h")) == []


@pytest.mark.parametrize(
    ("route", "expected"),
    [
        ("route [south, east]", True),
        ("route [south, ..., east]", False),
        ("route [west, main, east]", False),
        ("route from west straight over j5", True),
        ("route from west straight over j4 straight over j5", False),
        ("route from side straight over j4", True),
        ("route from main left over j4", False),  # entered the other way round
    ],
)
def test_routes_with_a_gap(codes, route: str, expected: bool):
    assert [c for c, _ in codes(f"  vehicle box: car.compact {{\n    {route}\n  }}")] == (["FS309"] if expected else [])


def test_a_lint_in_a_block_that_begins_on_its_line_underlines_its_first_line(codes):
    lines = "  vehicle lorry: car.compact { route [west,\n      side]\n    start at 3 m along lorry.route\n  }"
    codes(lines)
    (found,) = check_paths(["main.foresee"]).diagnostics
    assert found.span is not None and found.code == "FS309"
    assert found.source_line[found.span.column - 1 : found.span.end_column - 1] == "[west,"


def test_unused_parameters_and_dead_cases(codes):
    lines = "  param a: time = 9 s\n  param b: time = 1 s\n  end after a\n"
    assert codes(lines) == [("FS301", "param b: time = 1 s")]
    cases = "  param a: time = 9 s\n  end after a\n  case one { a = 5 s }\n  case two { a = 5000 ms }\n  case three\n"
    assert codes(cases) == [("FS302", "case two { a = 5000 ms }")]


@pytest.mark.parametrize(
    ("change", "marked"),
    [
        ("runner.timing: 1.00 => 1.0", "1.0"),
        ("runner.style: usual => usual", "usual"),
        ("runner.steer: 0.00 => 0.10 from 3.00 s for 1.00 s", "3.00 s"),
        ("runner.steer: 0.00 => 0.10 from 2.95 s for 1.00 s", ""),
    ],
)
def test_a_change_without_effect(change: str, marked: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = found_in(every_code()["FS318"], f"change {change}", tmp_path / "example", monkeypatch)
    assert [(d.code, d.source_line[d.span.column - 1 : d.span.end_column - 1]) for d in found if d.span] == (
        [("FS318", marked)] if marked else []
    )


@pytest.mark.parametrize(
    ("end", "window", "help"),
    [
        ("  end after 9 s\n", "8.00 s..9.00 s", None),
        ("  end after 9 s\n", "8.00 s..9.05 s", "let it end then: `window 8.00 s..9 s`"),
        ("  end after 9 s\n", "9.00 s..19.00 s", "write times of the parent's run"),
        ("", "8.00 s..60.00 s", None),
        ("", "8.00 s..60.00 s  # foresee: allow FS319", ("FS312", 4)),
        ("", "8.00 s..60.05 s  # foresee: allow FS319", None),
    ],
)
def test_a_window_beyond_the_end_of_the_parent(
    end: str, window: str, help: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = every_code()["FS319"]
    text = code.right.replace("54.00 s..60.00 s", window)
    parent = f"--- parent.foresee\n{HEAD}{end}}}\n"
    found = found_in(code, f"{text}{parent}", tmp_path / "example", monkeypatch)
    described = [str(d.help) if d.code == "FS319" else (d.code, d.start[0]) for d in found]
    assert described == ([] if help is None else [help])


def test_an_expectation_of_somebody_else_is_none_of_the_ego(codes):
    head = HEAD.replace("expect never collision(ego)", "expect never collision(runner)")
    assert codes("", head) == [("FS310", "scenario example {")]
    assert codes("  expect always ttc(runner, ego) > 1 s", head) == []


# ---- comments that allow --------------------------------------------------------------------------------------------

DEAD = "  when time > 99 s {@\n    runner stops\n  }\n"


def test_a_comment_allows_a_lint_on_its_statement(codes):
    assert codes(DEAD.replace("@", "  # foresee: allow FS303")) == []
    assert codes("  # foresee: allow FS303 (kept for the record)\n" + DEAD.replace("@", "")) == []
    assert codes("  # foresee: allow FS301, FS303\n" + DEAD.replace("@", "")) == [
        ("FS312", "# foresee: allow FS301, FS303")
    ]


def test_a_comment_reaches_no_further(codes):
    lines = DEAD.replace("@", "  # foresee: allow FS303") + DEAD.replace("@", "")
    assert codes(lines) == [("FS303", "when time > 99 s {")]


ALLOW = "# foresee: allow FS303"


@pytest.mark.parametrize(
    "lines",
    [
        f"  when time > 99 s {{ runner stops {ALLOW}\n  }}",
        f"  when time > 99 s {{ runner stops; runner starts {ALLOW}\n  }}",
        f"  when time > 9 s {{ runner stops }}; when time > 99 s {{ runner stops }} {ALLOW}",
        f"  {ALLOW}\n  when time > 9 s {{ runner stops }}; when time > 99 s {{ runner stops }}",
        f"  tags [one,\n    two]; when time > 99 s {{ runner stops {ALLOW}\n  }}",
    ],
)
def test_a_formatted_file_allows_what_the_source_allowed(codes, lines: str):
    text = f"{HEAD}{lines}\n}}\n"
    written = format_text(text, "main.foresee").removeprefix(format_text(f"{HEAD}}}\n", "main.foresee")[:-2])
    assert "FS303" not in [code for code, _ in codes(lines)]
    assert "FS303" not in [code for code, _ in codes(written.removesuffix("}\n"))]


def test_a_comment_before_the_definition_is_for_the_file(codes):
    assert codes(DEAD.replace("@", "") * 2, HEAD.replace("foresee 1\n", "foresee 1\n\n# foresee: allow FS303")) == []


def test_a_comment_in_a_text_is_none(codes):
    lines = '  doc "# foresee: allow FS303"\n' + DEAD.replace("@", "")
    assert codes(lines) == [("FS303", "when time > 99 s {")]


def test_errors_cannot_be_allowed(codes):
    lines = "  when time > 1 s {\n    ego stops  # foresee: allow FS305\n  }"
    assert [code for code, _ in codes(lines)] == ["FS305", "FS312"]


def test_the_bundled_scenarios_earn_no_error(scenarios: Path):
    found = check_paths([str(scenarios)]).diagnostics
    assert [d for d in found if d.severity == "error"] == []


# ---- weaker expectations --------------------------------------------------------------------------------------------


def expect(text: str) -> Expect:
    model = parse(f"foresee 1\nscenario a {{\n expect {text}\n}}\n", "a").model
    assert isinstance(model, Scenario)
    return model.all(Expect)[0]


WEAKER = [
    ("always ttc(ego, a) > 1.5 s", "always ttc(ego, a) > 1 s"),
    ("always ttc(ego, a) > 1 s", "always ttc(ego, a) >= 1 s"),
    ("always ego.speed < 10 m/s", "always ego.speed < 40 km/h"),
    ("never ego.speed > 10 m/s", "never ego.speed > 12 m/s"),
    ("never ego.speed > 10 m/s", "always ego.speed < 12 m/s"),
    ("never collision(ego)", "never (collision(ego) and ego.speed > 3 m/s)"),
    ("never (collision(ego) or ego.speed > 20 m/s)", "never collision(ego)"),
    ("always (ego.speed < 9 m/s and ttc(ego, a) > 1 s)", "always ttc(ego, a) > 1 s"),
    ("always ttc(ego, a) > 1 s", "always (ttc(ego, a) > 1 s or ego.speed < 1 m/s)"),
    ("always ttc(ego, a) > 1 s", "always within 10 s ttc(ego, a) > 1 s"),
    ("eventually within 30 s arrived(ego)", "eventually within 40 s arrived(ego)"),
    ("eventually within 30 s arrived(ego)", "eventually arrived(ego)"),
    ("eventually arrived(ego)", "eventually (arrived(ego) or ego.speed > 1 m/s)"),
    ("eventually ego.speed > 9 m/s for 5 s", "eventually ego.speed > 9 m/s for 2 s"),
    ("eventually ego.speed > 9 m/s for 5 s", "eventually ego.speed > 8 m/s"),
    ("always ego.speed < 9 m/s", "eventually ego.speed < 9 m/s"),
]


@pytest.mark.parametrize(("strong", "weak"), WEAKER)
def test_weaker(strong: str, weak: str):
    assert weaker(expect(strong), expect(weak)) is True
    assert weaker(expect(weak), expect(strong)) is False
    assert weaker(expect(strong), expect(strong)) is False


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("always ttc(ego, a) > 1 s", "always ttc(ego, b) > 1 s"),
        ("always ttc(ego, a) > 1 s", "always distance(ego, a) > 1 m"),
        ("never collision(ego)", "eventually arrived(ego)"),
        ("always within 10 s ttc(ego, a) > 2 s", "always within 20 s ttc(ego, a) > 1 s"),
        ("eventually within 30 s ego.speed > 9 m/s", "eventually within 20 s ego.speed > 8 m/s"),
        ("always ego.speed < 9 m/s", "always ego.speed > 1 m/s"),
    ],
)
def test_what_cannot_be_told(old: str, new: str):
    assert weaker(expect(old), expect(new)) is None
    assert weaker(expect(new), expect(old)) is None


def test_the_same_written_otherwise_is_not_weaker():
    assert weaker(expect("never ego.speed > 36 km/h"), expect("always ego.speed <= 10 m/s")) is False
    assert weaker(expect("never not arrived(ego)"), expect("always arrived(ego)")) is False
