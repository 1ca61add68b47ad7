"""Scenarios that extend another mean what the same scenario written out means; mistakes are where they were made."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.language.checked_files import check_paths
from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.expand import expanded_model
from foresee_dsl.language.project.loading import Project, load_test_case, load_test_cases

NETWORK = """foresee 1

network town {
  junction a at (0 m, 0 m)
  junction b at (200 m, 0 m)
  road main from a to b { lanes 2; back 0 }
}
"""

BASE = """foresee 1

scenario base {
  tags [scenario3]
  use network "networks/town.foresee"
  param gap: length = 40 m in 10 m..80 m step 1 m
  param pace: speed = 30 km/h
  weather rain 0.3
  ego: car.sedan { route [main] }
  vehicle lead: car.compact {
    route [main]
    speed pace
    start at gap along main
  }
  when late: time > 3 s { lead stops }
  expect safe: always ttc(ego, lead) > 1 s
  end after 20 s
  case near { gap = 20 m }
  case far { gap = 60 m }
}
"""

LINES = {
    "add weather": ("add weather fog 0.2", None),
    "weather": ("change weather.rain: 0.3 => 0.8", ("rain 0.3", "rain 0.8")),
    "fog": ("change weather.fog: 0 => 0.5", ("weather ", "weather fog 0.5, ")),
    "model": ("change lead.model: car.compact => car.suv", ("lead: car.compact", "lead: car.suv")),
    "speed": ("change lead.speed: pace => 9 m/s", ("speed pace", "speed 9 m/s")),
    "delay": (
        "change lead.delay: 0 s => 1 s",
        ("start at gap along main\n", "start at gap along main\n    delay 1 s\n"),
    ),
    "expect": ("change expect.safe: 1 s => 2 s", ("lead) > 1 s", "lead) > 2 s")),
    "default": ("change param.pace: 30 km/h => 20 km/h", ("speed = 30 km/h", "speed = 20 km/h")),
    "end": ("change end.after: 20 s => 25 s", ("end after 20 s", "end after 25 s")),
    "when": ("drop when late", ("  when late: time > 3 s { lead stops }\n", "")),
    "case": ("drop case far", ("  case far { gap = 60 m }\n", "")),
    "add case": ("add case mid { gap = 40 m }", ("  case near", "  case mid { gap = 40 m }\n  case near")),
    "actor": (
        "add vehicle late: car.suv { route [main]; start at gap along main; speed pace }",
        (
            "  expect safe",
            "  vehicle late: car.suv { route [main]; start at gap along main; speed pace }\n  expect safe",
        ),
    ),
    "kind": (
        "change bicycle lead: bicycle.city { route [main] }",
        (
            "  vehicle lead: car.compact {\n    route [main]\n    speed pace\n    start at gap along main\n  }\n",
            "  bicycle lead: bicycle.city { route [main] }\n",
        ),
    ),
}


def write(folder: Path, **files: str) -> None:
    for name, text in {"networks/town": NETWORK, "base": BASE, **files}.items():
        path = folder / f"{name}.foresee"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def extension(*lines: str, of: str = "base.foresee", name: str = "wet") -> str:
    body = "".join(f"  {line}\n" for line in lines)
    return f'foresee 1\n\nscenario {name} extends "{of}" {{\n{body}}}\n'


def meanings(path: Path) -> dict[str, str]:
    return {case.id.rpartition("::")[2]: case.meaning for case in load_test_cases([path])}


def mistakes(folder: Path, *lines: str) -> list[Diagnostic]:
    write(folder, wet=extension(*lines))
    with pytest.raises(InputError) as caught:
        load_test_cases([folder / "wet.foresee"])
    return list(caught.value.diagnostics)


@pytest.mark.parametrize(
    ("was", "line", "now"),
    [
        ("steers 0.1 from 1 s for 2 s", "steer: 0.1 => 0.2", "steers 0.2 from 1 s for 2 s"),
        ("line 0.5 m for 2 s", "line: 0.5 m => 1 m", "line 1 m for 2 s"),
        ("brakes 3 m/s^2 from 1 s", "brakes: 3 m/s^2 => 4 m/s^2 from 2 s for 1 s", "brakes 4 m/s^2 from 2 s for 1 s"),
        ("brakes 3 m/s^2 from 1 s for 2 s", "brakes: 3 m/s^2 => 4 m/s^2 for 1 s", "brakes 4 m/s^2 for 1 s"),
        ("timing 0.9", "steer: 0 => 0.2", "timing 0.9; steers 0.2"),
    ],
)
def test_a_changed_value_keeps_its_times(tmp_path: Path, was: str, line: str, now: str) -> None:
    of_lead = "start at gap along main\n"
    write(tmp_path, wet=extension(f"change lead.{line}"), base=BASE.replace(of_lead, f"{of_lead}    {was}\n"))
    write(tmp_path / "whole", base=BASE.replace(of_lead, f"{of_lead}    {now}\n"))
    assert meanings(tmp_path / "wet.foresee") == meanings(tmp_path / "whole" / "base.foresee")


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.sampled_from([k for k in LINES if LINES[k][1]]), unique=True))
def test_it_means_what_it_means_written_out(tmp_path: Path, names: list[str]) -> None:
    if "kind" in names:  # then there is nothing left of what these change
        names = [name for name in names if name not in ("model", "speed", "delay", "expect")]
    text = BASE
    for name in names:
        edit = LINES[name][1]
        assert edit is not None and edit[0] in text
        text = text.replace(*edit, 1)
    write(tmp_path, wet=extension(*(LINES[name][0] for name in names)), by_hand=text)
    assert meanings(tmp_path / "wet.foresee") == meanings(tmp_path / "by_hand.foresee")


def test_nothing_different_means_the_same_and_keeps_the_tags(tmp_path: Path) -> None:
    write(tmp_path, wet=extension('doc "the same"'))
    assert meanings(tmp_path / "wet.foresee") == meanings(tmp_path / "base.foresee")
    case = load_test_case(f"{tmp_path / 'wet.foresee'}::near")
    assert (case.scenario.name, case.family) == ("wet", "3")
    write(tmp_path, wet=extension("tags [scenario9]"))
    assert load_test_case(f"{tmp_path / 'wet.foresee'}::near").family == "9"


def test_an_extension_elsewhere_and_one_of_an_extension(tmp_path: Path) -> None:
    write(
        tmp_path,
        **{
            "more/wet": extension("change weather.rain: 0.3 => 0.8", of="../base.foresee"),
            "flooded": extension("change weather.rain: 0.8 => 1.0", "drop when late", of="more/wet.foresee"),
            "by_hand": BASE.replace("rain 0.3", "rain 1").replace("  when late: time > 3 s { lead stops }\n", ""),
        },
    )
    flooded = tmp_path / "flooded.foresee"
    assert meanings(flooded) == meanings(tmp_path / "by_hand.foresee")
    shown = print_model(expanded_model(load_test_case(f"{flooded}::near")))
    assert 'use network "networks/town.foresee"' in shown and "weather rain 1.0" in shown
    (tmp_path / "more" / "full.foresee").write_text(
        print_model(expanded_model(load_test_case(f"{tmp_path / 'more' / 'wet.foresee'}::far")))
    )
    full = load_test_case(tmp_path / "more" / "full.foresee")
    assert full.meaning == meanings(tmp_path / "more" / "wet.foresee")["far"]


def test_words_are_parameters_only_where_the_whole_has_them(tmp_path: Path) -> None:
    lines = ("add param main: arm = main", "change ego: car.suv { route from main }", "drop vehicle lead")
    write(tmp_path, wet=extension("change ego: car.suv { route from main }"))
    assert "from main" in print_model(load_test_case(f"{tmp_path / 'wet.foresee'}::near").scenario)
    write(tmp_path, wet=extension(lines[0], lines[1]))
    assert "from main" in print_model(load_test_case(f"{tmp_path / 'wet.foresee'}::near").scenario)


def test_drawn_cases_are_drawn_with_the_whole(tmp_path: Path) -> None:
    base = BASE.replace("  case near { gap = 20 m }\n  case far { gap = 60 m }\n", "  cases 5 from seed 3\n")
    lines = ("add require gap < 30 m", "change cases 4 from seed 3")
    by_hand = base.replace("cases 5", "require gap < 30 m\n  cases 4")
    write(tmp_path, base=base, wet=extension(*lines), by_hand=by_hand)
    found = meanings(tmp_path / "wet.foresee")
    assert list(found) == ["seed3_01", "seed3_02", "seed3_03", "seed3_04"]
    assert found == meanings(tmp_path / "by_hand.foresee")


@pytest.mark.parametrize(
    ("lines", "message", "column"),
    [
        (["add vehicle lead: car.suv { route [main] }"], "'base.foresee' already has an actor called 'lead'", 15),
        (["add end after 9 s"], "'base.foresee' already has an end", 7),
        (["add weather fog 0.2"], "'base.foresee' already has weather", 7),
        (["change cases 4 from seed 3"], "'base.foresee' has no cases from seed 3", 10),
        (["drop vehicle ego"], "'base.foresee' has no vehicle called 'ego'", 16),
        (["change vehicle leed: car.suv { route [main] }"], "'base.foresee' has no actor called 'leed'", 18),
        (
            ["change when time > 1 s { lead stops }"],
            "this `when` has no name, so it is not clear which one it changes",
            10,
        ),
        (["drop vehicle leed"], "'base.foresee' has no vehicle called 'leed'", 16),
        (["drop bicycle lead"], "'base.foresee' has no bicycle called 'lead'", 16),
        (["drop cases"], "'base.foresee' has no cases", 3),
        (["drop when"], "this does not name the when to drop", 3),
        (["change lead.speed: 9 m/s => 8 m/s"], "lead.speed is pace in 'base.foresee' now, not 9 m/s", 22),
        (["change expect.save: 1 s => 2 s"], "'base.foresee' has no expectation called 'save'", 10),
        (["change expect.safe: 1 s => 2 m"], "expect.safe is 1 s, so it cannot change to 2 m", 30),
        (["change weather.rain: 0.3 => 1.2"], "weather.rain cannot be 1.2", 31),
        (["change param.gab: 40 m => 30 m"], "'base.foresee' has no parameter 'gab'", 10),
        (["change lead.model: car.compact => car.nosuch"], "there is no model 'car.nosuch'", 3),
        (["add expect never collision(nobody)"], "unknown actor 'nobody'", 30),
        (["change param.gap: 40 m => 90 m"], "`90 m` is outside the range of 'gap', 10 m..80 m", 3),
        (["add vehicle x: car.suv { route [main]; speed pase }"], "unknown parameter 'pase'", 48),
    ],
)
def test_mistakes_are_where_they_were_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lines: list[str],
                                           message: str, column: int) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    (found,) = mistakes(Path(), *lines)
    assert (found.message, found.path) == (message, "wet.foresee")
    assert found.span is not None and (found.span.line, found.span.column) == (4, column)


def test_the_help_of_lines_that_cannot_be_followed(tmp_path: Path) -> None:
    obstacle = "add obstacle crate: obstacle.crate { start at 90 m along main }"
    (mistake,) = mistakes(tmp_path, obstacle, "drop vehicle crate")
    assert mistake.help == "it is an obstacle: write `drop obstacle crate`"
    (mistake,) = mistakes(tmp_path, "add cases 2 from seed 3", "add cases 4 from seed 3")
    assert mistake.message.endswith("base.foresee' already has cases from seed 3")
    (mistake,) = mistakes(tmp_path, "drop vehicle ego")
    assert mistake.help == "every scenario has an ego: replace it with `change ego: car.sedan { ... }`"
    (mistake,) = mistakes(tmp_path, "change ego.speed: 9 m/s => 8 m/s")
    assert mistake.help == "replace its whole statement: `change ego: ...`"


def test_what_breaks_in_the_other_is_shown_at_extends_with_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    lines = ("drop vehicle lead", "drop expect safe")
    assert [d.message for d in mistakes(Path(), *lines)] == ["unknown actor 'lead' (in 'base.foresee', line 15)"]
    (found,) = mistakes(Path(), "add require gap < 30 m")
    assert found.message == "in case 'far', gap is 60 m, but `require gap < 30 m` (in 'base.foresee', line 19)"


def test_a_dropped_parameter_that_is_used_is_reported_at_the_drop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (found,) = mistakes(Path(), "drop param pace")
    assert found.message == "'pace' is dropped, but still used in line 12 of 'base.foresee'"
    assert found.span is not None and (found.span.line, found.span.column) == (4, 14)
    (found, *_) = mistakes(Path(), "drop param pace", "add vehicle x: car.suv { route [main]; speed pace }")
    assert found.message == "'pace' is dropped, but still used in line 12 of 'base.foresee', line 5"
    (found,) = mistakes(Path(), "drop param nosuch", "add vehicle x: car.suv { route [main]; speed nosuch }")
    assert found.message == "'base.foresee' has no param called 'nosuch'"
    write(Path(), wet=extension("drop param pace", "add param pace: speed = 9 m/s in 5 m/s..20 m/s"))
    assert load_test_cases(["wet.foresee"])


def test_a_mistake_of_the_other_is_said_of_the_other_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write(Path(), base=BASE.replace("speed pace", "speed pase"), wet=extension("drop when late"))
    found = check_paths(["."]).diagnostics
    assert [(d.path, d.code) for d in found] == [("base.foresee", "FS031")]


def test_circles_and_what_is_no_scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write(Path(), a=extension(of="b.foresee"), b=extension(of="a.foresee"), c=extension(of="networks/town.foresee"))
    for file, code in (("a", "FS133"), ("c", "FS132")):
        with pytest.raises(InputError) as caught:
            load_test_cases([f"{file}.foresee"])
        assert [d.code for d in caught.value.diagnostics] == [code]


def test_a_softer_expectation_is_a_warning(tmp_path: Path) -> None:
    write(tmp_path, wet=extension("change expect.safe: 1 s => 0.5 s"))
    project = Project()
    project.test_cases([tmp_path / "wet.foresee"])
    (found,) = [d for d in project.warnings if d.code == "FS311"]
    assert found.source_line == "  change expect.safe: 1 s => 0.5 s"


def test_children_of_an_extension(tmp_path: Path) -> None:
    write(tmp_path, wet=extension("change weather.rain: 0.3 => 0.8"))
    pin = load_test_case(f"{tmp_path / 'wet.foresee'}::near").meaning
    clip = f"""foresee 1

clip wet_p1 of "wet.foresee" case near pin {pin} {{
  window 2.00 s..12.00 s
  ego: car.sedan at (30 m, -1.6 m) heading 0 deg speed 10.00 m/s {{ route [main] }}
  goal (130 m, -1.6 m)
  vehicle lead: car.compact at (50 m, -1.6 m) heading 0 deg speed 8.00 m/s {{ route [main] }}
}}
"""
    write(tmp_path, wet=extension("change weather.rain: 0.3 => 0.8"), clip=clip)
    pin = pin_of(load_test_case(tmp_path / "clip.foresee"))
    head = f'foresee 1\n\nmutant m of "clip.foresee" pin {pin} {{\n'
    harder = (
        "  change weather.rain: 0.8 => 0.9\n  change weather.fog: 0.0 => 0.3\n  change expect.safe: 1 s => 2 s\n}\n"
    )
    write(tmp_path, wet=extension("change weather.rain: 0.3 => 0.8"), mutant=head + harder)
    shown = print_model(load_test_case(tmp_path / "mutant.foresee").scenario)
    assert "weather rain 0.9, fog 0.3" in shown and "ttc(ego, lead) > 2 s" in shown
    for line, code in (
        ("change expect.safe: 1 s => 0.5 s", "FS311"),
        ("change weather.rain: 0.3 => 0.9", "FS123"),
        ("change param.gap: 1 s => 2 s", "FS006"),
        ("change expect.nosuch: 1 s => 2 s", "FS126"),
    ):
        write(tmp_path, wet=extension("change weather.rain: 0.3 => 0.8"), mutant=f"{head}  {line}\n}}\n")
        with pytest.raises(InputError) as caught:
            load_test_case(tmp_path / "mutant.foresee")
        assert [d.code for d in caught.value.diagnostics] == [code]


def test_outside_the_project_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inside = tmp_path / "work"
    write(tmp_path)
    inside.mkdir()
    (inside / "wet.foresee").write_text(extension("drop when late", of="../base.foresee"))
    monkeypatch.chdir(inside)
    with pytest.raises(InputError) as caught:
        load_test_cases(["wet.foresee"], allow_outside=False)
    (found,) = caught.value.diagnostics
    assert found.code == "FS138" and "--allow-outside" in found.help
    assert len(load_test_cases(["wet.foresee"])) == 2
    (tmp_path / "pyproject.toml").touch()  # now both lie in one project
    assert len(load_test_cases(["wet.foresee"], allow_outside=False)) == 2
    (tmp_path / "pyproject.toml").unlink()
    monkeypatch.chdir(tmp_path)  # now the working folder holds both
    assert len(load_test_cases(["work/wet.foresee"], allow_outside=False)) == 2
