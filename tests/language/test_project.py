"""Addresses become test cases; every mistake on the way has its place."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from foresee_dsl.compile.compiler import diagnose
from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.language.codes import every_code
from foresee_dsl.language.diff.addresses import compare_addresses
from foresee_dsl.language.document import Problem, TestCase
from foresee_dsl.language.meaning import meaning_hash, pin_of
from foresee_dsl.language.model import End, Network, UseNetwork
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.addresses import parse_address, scenario_files
from foresee_dsl.language.project.expand import expanded_model
from foresee_dsl.language.project.loading import (
    Project,
    bundled_models,
    load_catalogue,
    load_test_case,
    load_test_cases,
)

SAMPLES = Path(__file__).parent.parent / "cases" / "language"

NETWORK = """foresee 1

network town {
  junction a at (0 m, 0 m)
  junction b at (200 m, 0 m)
  road main from a to b { lanes 2; back 0 }
}
"""

SCENARIO = """foresee 1

scenario lead_brakes {
  doc "The lead brakes."
  tags [scenario3]
  use network "networks/town.foresee"
  param gap: length = 40 m in 10 m..80 m step 1 m
  param lead_model: model = car.compact
  weather rain 0.3
  ego: car.sedan {
    route [main]
    start speed 36 km/h
  }
  vehicle lead: lead_model {
    route [main]
    start at gap along main
  }
  expect never collision(ego)
  end after 20 s
  case near { gap = 20 m }
  case far { gap = 60 m; lead_model = van.delivery }
}
"""

CLIP = """foresee 1

clip lead_brakes_p1 of "../lead_brakes.foresee" case near pin PIN {
  window 2.00 s..12.00 s
  risk "close" at 7.00 s with lead

  ego: car.sedan at (30 m, -1.6 m) heading 0 deg speed 10.00 m/s {
    route [main]
  }
  goal (130 m, -1.6 m)

  vehicle lead: car.compact at (50 m, -1.6 m) heading 0 deg speed 8.00 m/s {
    route [main]
  }

  fidelity 0.00 m
}
"""

MUTANT = """foresee 1

mutant lead_brakes_p1_m1 of "lead_brakes_p1.foresee" pin PIN {
  change lead.model: car.compact => van.delivery
  change lead.timing: 1.00 => 0.80
}
"""


class Folder:
    """A project in a temporary folder: a network, a scenario, a clip and a mutant with the right pins."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.write("networks/town.foresee", NETWORK)
        self.scenario = self.write("lead_brakes.foresee", SCENARIO)
        pin = load_test_case(f"{self.scenario}::near").meaning
        self.clip = self.write("children/lead_brakes_p1.foresee", CLIP.replace("PIN", pin))
        self.mutant_text = MUTANT.replace("PIN", pin_of(load_test_case(self.clip)))
        self.mutant = self.write("children/lead_brakes_p1_m1.foresee", self.mutant_text)

    def write(self, name: str, text: str) -> Path:
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    def edit(self, path: Path, old: str, new: str) -> Path:
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new), encoding="utf-8")
        return path


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    return Folder(tmp_path)


def mistake(address: str | Path, **options: bool) -> Diagnostic:
    """The one mistake that loading finds."""
    with pytest.raises(InputError) as caught:
        load_test_case(address, **options)
    (found,) = caught.value.diagnostics
    assert found.code in every_code()
    return found


def underlined(found: Diagnostic) -> str:
    """What the diagnostic points at."""
    assert found.span is not None
    assert Path(found.path).read_text(encoding="utf-8").splitlines()[found.span.line - 1] == found.source_line
    end = found.span.end_column - 1 if found.span.end_line == found.span.line else None
    return found.source_line[found.span.column - 1 : end]


# What works


def test_a_case(folder: Folder) -> None:
    case = load_test_case(f"{folder.scenario}::far")
    assert case.id == f"{folder.scenario}::far"
    assert case.source == folder.scenario
    assert case.family == "3"
    assert case.scenario.actors[1].model == "van.delivery"
    assert isinstance(case.network, Network)
    assert case.models == bundled_models()
    assert case.document is not None and case.clip is None and case.mutant is None


def test_a_relative_address_gives_a_relative_id(folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder.root)
    case = load_test_case("./children/../lead_brakes.foresee::near")
    assert case.id == "lead_brakes.foresee::near"
    assert case.source == folder.scenario
    assert load_test_case("children/lead_brakes_p1_m1.foresee").id == "children/lead_brakes_p1_m1.foresee"


def test_the_meaning_of_a_case_is_its_own(folder: Folder) -> None:
    near, far = load_test_cases([folder.scenario])
    assert near.meaning != far.meaning
    folder.edit(folder.scenario, "scenario lead_brakes {", "# Why.\nscenario other_name {")
    folder.edit(folder.scenario, '  doc "The lead brakes."\n  tags [scenario3]\n', "  tags [scenario4]\n\n")
    folder.edit(folder.scenario, "case far { gap = 60 m; lead_model", "case away { gap = 0.06 km; lead_model")
    folder.edit(folder.scenario, "start speed 36 km/h", "start speed 10 m/s")
    folder.edit(folder.root / "networks/town.foresee", "network town {", 'network village {\n  doc "Small."')
    assert [case.meaning for case in load_test_cases([folder.scenario])] == [near.meaning, far.meaning]


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("lead_brakes.foresee", "rain 0.3", "rain 0.31"),
        ("lead_brakes.foresee", "gap = 20 m", "gap = 21 m"),
        ("lead_brakes.foresee", "end after 20 s", "end after 21 s"),
        ("lead_brakes.foresee", "never collision(ego)", "never collision(lead)"),
        ("lead_brakes.foresee", "36 km/h", "37 km/h"),
        ("lead_brakes.foresee", "= car.compact", "= car.sedan"),
        ("networks/town.foresee", "200 m", "201 m"),
        ("networks/town.foresee", "lanes 2", "lanes 3"),
    ],
)
def test_a_changed_value_changes_the_meaning_and_makes_children_stale(
    folder: Folder, file: str, old: str, new: str
) -> None:
    before = load_test_case(f"{folder.scenario}::near").meaning
    folder.edit(folder.root / file, old, new)
    now = load_test_case(f"{folder.scenario}::near").meaning
    assert now != before
    found = mistake(folder.clip)
    assert found.code == "FS135"
    assert before in found.message and now in found.message
    assert underlined(found) == before
    assert found.help == "the parent has changed: run `foresee repin` to see the effect on this file"
    assert mistake(folder.mutant) == found
    assert load_test_case(folder.mutant, check_pin=False).mutant is not None


def test_children(folder: Folder) -> None:
    clip, mutant = load_test_case(folder.clip), load_test_case(folder.mutant)
    assert [actor.name for actor in clip.scenario.actors] == ["ego", "lead"]
    assert clip.clip is not None and clip.mutant is None
    assert mutant.mutant is not None and mutant.clip == clip.clip
    assert mutant.scenario.actors[1].model == "van.delivery"
    assert mutant.scenario.first(UseNetwork) == UseNetwork(path="../networks/town.foresee")
    assert (mutant.family, mutant.network) == ("3", clip.network)
    found = [str(change) for change in compare_addresses(str(folder.clip), str(folder.mutant)).changes]
    assert found == ["lead.model: car.compact => van.delivery", "added lead.timing: 0.80"]


@pytest.mark.parametrize(
    "name", ["lead_brakes.foresee::far", "children/lead_brakes_p1.foresee", "children/lead_brakes_p1_m1.foresee"]
)
def test_what_expand_prints_means_the_same(folder: Folder, name: str) -> None:
    case = load_test_case(folder.root / name)
    printed = case.source.with_name("expanded.foresee")
    printed.write_text(print_model(expanded_model(case)), encoding="utf-8")
    again = load_test_case(printed)
    assert again.meaning == meaning_hash(expanded_model(case), case.network, case.models)
    kept = [item for item in case.scenario.body if not isinstance(item, End)]
    assert [item for item in again.scenario.body if not isinstance(item, End)] == kept
    anywhere = "anywhere" if case.snapshot else None  # the ego of a clip need not arrive
    assert again.scenario.first(End) == case.scenario.first(End).model_copy(update={"where": anywhere})


def test_a_mutant_goes_stale_with_its_clip(folder: Folder) -> None:
    folder.edit(folder.clip, "8.00 m/s", "8.10 m/s")
    assert mistake(folder.mutant).code == "FS135"
    folder.edit(folder.clip, "8.10 m/s", "28.80 km/h")
    folder.edit(folder.clip, "fidelity 0.00 m", "fidelity 0.01 m")
    folder.edit(folder.clip, '"close"', '"very close"')
    assert load_test_case(folder.mutant).mutant is not None


def test_a_clip_of_a_mutant(folder: Folder) -> None:
    pin = load_test_case(folder.mutant).meaning
    text = CLIP.replace("../lead_brakes.foresee", "../lead_brakes_p1_m1.foresee").replace(" case near", "")
    deeper = folder.write("children/more/deeper.foresee", text.replace("PIN", pin))
    case = load_test_case(deeper)
    assert case.scenario.first(UseNetwork) == UseNetwork(path="../../networks/town.foresee")
    assert case.mutant is None


def test_an_own_catalogue_wins(folder: Folder) -> None:
    own = "foresee 1\n\nmodels own {\n  model car.sedan {\n    length 6 m\n    width 2 m\n  }\n}\n"
    more = folder.write("more.foresee", own)
    before = load_test_case(f"{folder.scenario}::near")
    folder.edit(folder.scenario, "  param gap", '  use models "more.foresee"\n  param gap')
    case = load_test_case(f"{folder.scenario}::near")
    assert case.models["car.sedan"].length.si == 6  # type: ignore[union-attr]  # no reference in a catalogue
    assert case.models["car.compact"] == before.models["car.compact"]
    assert case.meaning != before.meaning
    assert list(load_catalogue(more)) == ["car.sedan"]
    assert load_catalogue() == bundled_models()


def test_a_foreign_network(folder: Folder) -> None:
    net = folder.write("networks/town.net.xml", "<net/>")
    folder.edit(folder.scenario, "town.foresee", "town.net.xml")
    assert load_test_case(f"{folder.scenario}::near").network == net


def test_a_network_in_the_scenario() -> None:
    case = load_test_case(SAMPLES / "inline_network.foresee")
    assert isinstance(case.network, Network)


def test_the_sample_with_everything() -> None:
    cases = load_test_cases([SAMPLES / "everything.foresee"])
    drawn = ["seed7_01", "seed7_02", "seed7_03"]
    assert [case.id.rpartition("::")[2] for case in cases] == ["r01", "r02", "r03", "r04", *drawn]
    assert len({case.meaning for case in cases}) == 7


def test_folders_give_their_scenarios_in_order(folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.write("a/z.foresee", SCENARIO.replace("networks/", "../networks/"))
    folder.write(".hidden/x.foresee", "nonsense")
    folder.write("notes.txt", "nonsense")
    monkeypatch.chdir(folder.root)
    ids = ["a/z.foresee::near", "a/z.foresee::far", "lead_brakes.foresee::near", "lead_brakes.foresee::far"]
    assert [case.id for case in load_test_cases(["."])] == ids
    mixed = ["lead_brakes.foresee::far", "children/lead_brakes_p1.foresee", ".", "lead_brakes.foresee"]
    found = [case.id for case in load_test_cases(mixed)]
    assert found == [mixed[0], mixed[1], *ids[:3]]


def test_files_of_every_kind(folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder.root)
    names = [
        "children/lead_brakes_p1.foresee",
        "children/lead_brakes_p1_m1.foresee",
        "lead_brakes.foresee",
        "networks/town.foresee",
    ]
    assert [path.as_posix() for path in scenario_files(["."])] == names
    assert [path.as_posix() for path in scenario_files([names[3], "networks", "./lead_brakes.foresee"])] == [
        names[3],
        names[2],
    ]


def test_a_file_is_read_once(folder: Folder) -> None:
    project = Project()
    near, far = project.test_cases([folder.scenario])
    assert near.network is far.network
    assert project.test_case(f"{folder.scenario}::near") is near


@pytest.mark.parametrize(
    ("address", "path", "case"),
    [
        ("a.foresee", "a.foresee", None),
        ("a/b.foresee::r01", "a/b.foresee", "r01"),
        ("odd::name/a.foresee::r01", "odd::name/a.foresee", "r01"),
    ],
)
def test_addresses(address: str, path: str, case: str | None) -> None:
    assert parse_address(address) == (Path(path), case)


# What does not


@pytest.mark.parametrize("address", ["::r01", "a.foresee::", "a.foresee::R 1", ""])
def test_bad_addresses(address: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_address(address)
    assert caught.value.diagnostics[0].code == "FS131"


def test_a_missing_file(folder: Folder) -> None:
    found = mistake(folder.root / "lead_break.foresee")
    assert (found.code, found.help) == ("FS130", "did you mean 'lead_brakes.foresee'?")
    for call in (load_test_cases, scenario_files):
        with pytest.raises(InputError) as caught:
            call([str(folder.root / "lead_break.foresee")])
        assert caught.value.diagnostics == (found,)


def test_a_folder_where_a_file_is_needed(folder: Folder) -> None:
    found = mistake(folder.root / "networks")
    assert (found.code, found.message.endswith("is a folder, but one file is needed")) == ("FS131", True)


def test_paths_that_the_system_refuses(folder: Folder) -> None:
    assert mistake("x" * 300 + ".foresee").code == "FS130"
    folder.edit(folder.scenario, "networks/town", "n" * 300)
    assert mistake(f"{folder.scenario}::near").code == "FS130"


def test_a_folder_without_scenarios(folder: Folder) -> None:
    with pytest.raises(InputError, match="no scenario in folder"):
        load_test_cases([folder.root / "networks"])


def test_an_unknown_case(folder: Folder) -> None:
    found = mistake(f"{folder.scenario}::fra")
    assert (found.code, found.help) == ("FS100", "did you mean 'far'?")
    assert mistake(f"{folder.scenario}::zzz").help == "write one of near, far"
    assert mistake(f"{folder.clip}::near").code == "FS100"


def test_several_cases_and_none_named(folder: Folder) -> None:
    found = mistake(folder.scenario)
    assert found.code == "FS103"
    assert f"{folder.scenario}::near" in found.help


def test_more_cases_than_a_help_lists(folder: Folder) -> None:
    more = "".join(f"  case c{k} {{ gap = 2{k} m }}\n" for k in range(9))
    folder.edit(folder.scenario, "  case near", f"{more}  case near")
    found = mistake(folder.scenario)
    assert found.code == "FS103" and found.help.endswith("::c0`, for example")


def test_a_clip_of_an_unknown_case(folder: Folder) -> None:
    folder.edit(folder.clip, "case near", "case naer")
    found = mistake(folder.clip)
    assert (found.code, found.path, found.help) == ("FS100", str(folder.clip), "did you mean 'near'?")
    assert underlined(found) in ("naer", "case naer")
    folder.edit(folder.clip, " case naer", "")
    found = mistake(folder.clip)
    assert (found.code, found.span is not None) == ("FS103", True)
    assert found.help.startswith("write `case near`")


def test_a_missing_network(folder: Folder) -> None:
    folder.edit(folder.scenario, "networks/town", "networks/twon")
    found = mistake(f"{folder.scenario}::near")
    assert (found.code, found.message) == ("FS130", "there is no file 'networks/twon.foresee'")
    assert found.help == "did you mean 'town.foresee'?"
    assert underlined(found) == '"networks/twon.foresee"'
    folder.edit(folder.scenario, "networks/twon", "netwroks/town")
    assert "there is no folder" in mistake(f"{folder.scenario}::near").help


@pytest.mark.parametrize(
    ("written", "code", "message"),
    [
        ("networks", "FS137", "unknown kind"),
        ("town.osm", "FS137", "unknown kind"),
        ("town.net.xml", "FS130", "no file 'town.net.xml'"),
        ("town.xodr", "FS130", "no file 'town.xodr'"),
        ("other.foresee", "FS132", "holds a scenario, not a network"),
        ("children/lead_brakes_p1.foresee", "FS132", "holds a clip, not a network"),
        ("lead_brakes.foresee", "FS133", "lead_brakes.foresee' uses itself"),
    ],
)
def test_a_network_that_is_none(folder: Folder, written: str, code: str, message: str) -> None:
    folder.write("other.foresee", SCENARIO)
    folder.edit(folder.scenario, "networks/town.foresee", written)
    found = mistake(f"{folder.scenario}::near")
    assert found.code == code
    assert message in found.message
    assert underlined(found) == f'"{written}"'


def test_models_that_are_none(folder: Folder) -> None:
    folder.edit(folder.scenario, "  param gap", '  use models "networks/town.foresee"\n  param gap')
    found = mistake(f"{folder.scenario}::near")
    assert (found.code, underlined(found)) == ("FS132", '"networks/town.foresee"')
    with pytest.raises(InputError, match="not models"):
        load_catalogue(folder.scenario)


def test_a_mistake_in_the_network_is_shown_there(folder: Folder) -> None:
    folder.edit(folder.root / "networks/town.foresee", "200 m", "200 kmh")
    with pytest.raises(InputError) as caught:
        load_test_case(f"{folder.scenario}::near")
    (found,) = caught.value.diagnostics
    assert found.path == str(folder.root / "networks/town.foresee")
    assert found.span is not None and found.span.line == 5


@pytest.mark.parametrize(
    ("old", "new", "place", "code", "help"),
    [
        ("ego: car.sedan", "ego: car.sedna", "car.sedna", "FS110", "did you mean 'car.sedan'?"),
        ("model = car.compact", "model = car.compct", "car.compct", "FS110", "did you mean 'car.compact'?"),
        ("model = car.compact", "model = pedestrian.adult", "pedestrian.adult", "FS038", "vehicle"),
        ("case near { gap = 20 m }", "case near { lead_model = car.x }", "car.x", "FS110", "car."),
    ],
)
def test_models_are_checked_where_they_are_written(
    folder: Folder, old: str, new: str, place: str, code: str, help: str
) -> None:
    folder.edit(folder.scenario, old, new)
    found = mistake(f"{folder.scenario}::near")
    assert found.code == code
    assert help in found.help or code == "FS110"
    assert underlined(found) == place


def test_a_model_of_the_traffic(folder: Folder) -> None:
    statements = ("count 2", "models [car.sedan, car.sedn]", "within 90 m of ego.route", "seed 1")
    traffic = "  traffic others {\n" + "".join(f"    {line}\n" for line in statements) + "  }\n"
    folder.edit(folder.scenario, "  expect never", f"{traffic}  expect never")
    found = mistake(f"{folder.scenario}::near")
    assert (found.code, found.message) == ("FS110", "there is no model 'car.sedn'")
    assert found.span is not None


def test_networks_are_no_test_cases(folder: Folder) -> None:
    found = mistake(folder.root / "networks/town.foresee")
    assert (found.code, found.message) == ("FS132", "this holds a network, not a test case")


def test_parents_of_the_wrong_kind(folder: Folder) -> None:
    folder.edit(folder.mutant, "lead_brakes_p1.foresee", "../networks/town.foresee")
    found = mistake(folder.mutant)
    assert (found.code, underlined(found)) == ("FS132", '"../networks/town.foresee"')
    folder.write("single.foresee", SCENARIO.partition("  case near")[0] + "}\n")
    folder.edit(folder.mutant, "../networks/town.foresee", "../single.foresee")
    pin = load_test_case(folder.root / "single.foresee").meaning
    folder.mutant.write_text(MUTANT.replace("PIN", pin).replace("lead_brakes_p1.foresee", "../single.foresee"))
    found = mistake(folder.mutant)
    assert (found.code, underlined(found)) == ("FS132", '"../single.foresee"')
    assert "a mutant changes a clip" in found.message


def test_a_missing_parent(folder: Folder) -> None:
    folder.clip.rename(folder.clip.with_name("lead_brakes_p2.foresee"))
    found = mistake(folder.mutant)
    assert (found.code, underlined(found)) == ("FS130", '"lead_brakes_p1.foresee"')
    assert found.help.startswith("did you mean 'lead_brakes_p")


def test_files_that_use_themselves(folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder.root / "children")
    pin = "sha256:000000000000"
    folder.write("children/a.foresee", MUTANT.replace("PIN", pin).replace("lead_brakes_p1.foresee", "a.foresee"))
    found = mistake("a.foresee")
    assert (found.code, found.message) == ("FS133", "'a.foresee' uses itself: a.foresee -> a.foresee")
    assert underlined(found) == '"a.foresee"'
    for one, other in (("b", "c"), ("c", "d"), ("d", "b")):
        text = CLIP.replace("PIN", pin).replace("../lead_brakes.foresee", f"{other}.foresee")
        folder.write(f"children/{one}.foresee", text.replace(" case near", ""))
    found = mistake("b.foresee")
    assert found.message == "'b.foresee' uses itself: b.foresee -> c.foresee -> d.foresee -> b.foresee"
    assert found.path == "d.foresee"


def test_too_many_parents(folder: Folder) -> None:
    text = CLIP.replace("PIN", "sha256:000000000000").replace(" case near", "")
    for number in range(40):
        child = text.replace("../lead_brakes.foresee", f"n{number + 1}.foresee")
        folder.write(f"children/n{number}.foresee", child)
    assert mistake(folder.root / "children/n0.foresee").code == "FS134"


def test_a_wrong_was_and_an_unknown_actor(folder: Folder) -> None:
    folder.edit(folder.mutant, "1.00 => 0.80", "0.90 => 0.80")
    found = mistake(folder.mutant)
    assert (found.code, underlined(found)) == ("FS123", "0.90")
    assert found.message == "lead.timing is 1 in the clip now, not 0.90"
    folder.edit(folder.mutant, "lead.timing", "laed.timing")
    found = mistake(folder.mutant)
    assert (found.code, found.help) == ("FS037", "did you mean 'lead'?")
    assert underlined(found).startswith("laed")


def test_outside_of_the_project(folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    inner = folder.write("inner/x.foresee", SCENARIO.replace("networks/", "../networks/"))
    monkeypatch.chdir(inner.parent)
    found = mistake("x.foresee::near", allow_outside=False)
    assert (found.code, underlined(found)) == ("FS138", '"../networks/town.foresee"')
    monkeypatch.chdir(folder.root)
    assert load_test_case("inner/x.foresee::near", allow_outside=False).id == "inner/x.foresee::near"


def test_mistakes_of_all_files_together(folder: Folder) -> None:
    folder.write(
        "one.foresee", SCENARIO.replace("ego: car.sedan", "ego: car.sedna").replace("lead_model =", "lead_model  =")
    )
    folder.write("two.foresee", SCENARIO.replace("36 km/h", "36 kmh"))
    folder.write("empty.foresee", "")
    with pytest.raises(InputError) as caught:
        load_test_cases([folder.root])
    assert {Path(found.path).name for found in caught.value.diagnostics} == {
        "one.foresee",
        "two.foresee",
        "empty.foresee",
    }


def test_a_stale_child_can_still_be_compared(folder: Folder) -> None:
    folder.edit(folder.scenario, "rain 0.3", "rain 0.4")
    changes = compare_addresses(str(folder.clip), str(folder.mutant)).changes
    assert any("lead.model" in str(change) for change in changes)


# What the compiler finds


def problem(actor: str, item: str) -> Problem:
    return Problem(actor=actor, item=item, code="FS250", message="it is off the road", help="move it")


def place(case: TestCase, actor: str, item: str) -> str:
    (found,) = diagnose(case, (problem(actor, item),)).diagnostics
    assert (found.code, found.help) == ("FS250", "move it")
    return underlined(found) if found.span else found.message


def test_problems_of_a_scenario_get_their_places(folder: Folder) -> None:
    case = load_test_case(f"{folder.scenario}::near")
    assert place(case, "lead", "start_at") == "start at gap along main"
    assert place(case, "lead", "route") == "route [main]"
    assert place(case, "lead", "model") == "lead_model"
    assert "lead" in place(case, "lead", "")
    assert place(case, "ego", "start_speed") == "start speed 36 km/h"
    assert place(case, "", "end") == "end after 20 s"
    assert place(case, "", "") == "it is off the road"


def test_problems_of_children_get_their_places(folder: Folder) -> None:
    clip, mutant = load_test_case(folder.clip), load_test_case(folder.mutant)
    assert "50 m" in place(clip, "lead", "state")
    assert place(mutant, "lead", "timing") == "change lead.timing: 1.00 => 0.80"
    assert place(mutant, "lead", "route").startswith("change lead.model")
    assert place(mutant, "ego", "route") == "it is off the road (as written in 'lead_brakes_p1.foresee')"


def test_a_copy_of_the_folder_has_the_same_meaning(folder: Folder, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(folder.root, copy, ignore=shutil.ignore_patterns("copy"))
    for name in ("lead_brakes.foresee::near", "children/lead_brakes_p1_m1.foresee"):
        one, other = load_test_case(folder.root / name), load_test_case(f"{copy}{os.sep}{name}")
        assert one.meaning == other.meaning
