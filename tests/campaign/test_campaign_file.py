"""A campaign's file: what it says, what the command line changes, and what is wrong with it."""

from __future__ import annotations

import inspect
import json
from dataclasses import fields, make_dataclass
from pathlib import Path
from typing import get_args

import pytest

from foresee_dsl.campaign.campaign_file import is_campaign, read_campaign
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.cli import campaigns
from foresee_dsl.cli.options.campaign_options import option_name, options_of_settings
from foresee_dsl.errors import InputError
from foresee_dsl.files import data_folder
from foresee_dsl.language import model as m
from foresee_dsl.language.campaign_values import RulesMode
from foresee_dsl.language.model.item import Bounds
from tests.support import command
from tests.support.small_campaign import write_project

NIGHTLY = """foresee 1

campaign nightly {
  seeds "**"
  drivers [idm]
  clip before 3 s after 2.5 s
  risky_points 2
  children 1
  seed 7
  budget 10 min
}
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    write_project(tmp_path / "project")
    return tmp_path / "project"


def written(project: Path, text: str) -> Path:
    file = project / "nightly.foresee"
    file.write_text(text)
    return file


def foresee(*arguments: object, expect: int = 0) -> str:
    done = command.foresee(*arguments, env={"COLUMNS": "100"}, expect=expect)
    return done.stdout + done.stderr


def test_what_it_says_is_what_is_done(project: Path) -> None:
    found = read_campaign(written(project, NIGHTLY))
    assert (found.name, found.drivers, found.rankers, found.budget_s) == ("nightly", ("idm",), (), 600.0)
    assert found.settings == {"before_s": 3.0, "after_s": 2.5, "risky_points": 2, "children": 1, "seed": 7}
    none = read_campaign(written(project, NIGHTLY.replace("budget 10 min", "budget 0 min")))
    assert none.budget_s == 0.0, "as with `--budget 0`"
    (path,) = found.paths
    assert Path(path).is_file() and not is_campaign(path), "patterns give scenarios, not the campaign itself"
    assert is_campaign(str(project / "nightly.foresee"))


def test_rules_and_a_folder_of_failures_whose_path_begins_at_the_file(project: Path) -> None:
    (project / "out" / "earlier").mkdir(parents=True)
    text = NIGHTLY.replace("seed 7", 'rules report\n  first_from "out/earlier"')
    settings = read_campaign(written(project, text)).settings
    assert settings["rules"] is RulesMode.REPORT and settings["first_from"] == (project / "out/earlier").as_posix()
    said = foresee("campaign", project / "nightly.foresee", "--out", project / "other", expect=1)
    assert "has no failing mutants: name the folder of a campaign, or of kept failures" in " ".join(said.split())


def test_a_driver_that_is_its_own_reference(project: Path) -> None:
    """A check says so; a run may still have other drivers, from its options."""
    file = written(project, NIGHTLY.replace("drivers [idm]", "drivers [idm]\n  against [idm]"))
    shown = " ".join(foresee("check", file, expect=1).split())
    assert "error FS058: idm is the driver under test" in shown and "| against [idm]" in shown
    assert "name another, or `none`" in shown
    assert read_campaign(file).against == ("idm",)
    for line in ("drivers [idm, pdm]\n  against [idm]", "drivers [idm]\n  against [idm, pdm]", "against [idm]"):
        foresee("check", written(project, NIGHTLY.replace("drivers [idm]", line)))


def test_addresses_and_several_lines(project: Path) -> None:
    (scenario,) = (p for p in project.rglob("*.foresee"))
    name = scenario.relative_to(project).as_posix()
    text = NIGHTLY.replace('seeds "**"', f'seeds "{name}::later"\n  seeds "{name}"\n  seeds "{name}::later"')
    found = read_campaign(written(project, text))
    assert found.paths == (f"{project / name}::later", str(project / name))


@pytest.mark.parametrize(
    ("line", "instead", "code", "words"),
    [
        ("drivers [idm]", "drivers [idn]", "FS058", "did you mean 'idm'?"),
        ("drivers [idm]", "rankers [forsee]", "FS058", "did you mean 'foresee'?"),
        ("drivers [idm]", "against [none, idm]", "FS058", "remove it, or write only `none`"),
        ("drivers [idm]", "preset focussed", "FS058", "did you mean 'focused'?"),
        ("drivers [idm]", "drivers [idm, idm]", "FS013", "keep one"),
        ('seeds "**"', 'seeds "none/**"', "FS059", "begin at this file's own folder"),
        ('seeds "**"', 'seeds "crosser.foresee::latter"', "FS059", "did you mean 'later'?"),
        ('seeds "**"', 'seeds "streets.foresee"', "FS059", "name a scenario"),
        ('seeds "**"', 'seeds "nightly.foresee"', "FS059", "name a scenario"),
        ('seeds "**"', 'seeds "empty"', "FS059", "begin at this file's own folder"),
        ('seeds "**"', "repeat 2", "FS057", "name the test cases to run"),
        ("children 1", "children 1\n  children 2", "FS047", ""),
        ("budget 10 min", "budget 10 m", "FS010", "a time"),
        ("budget 10 min", "rules reported", "FS012", "did you mean 'report'?"),
        ("budget 10 min", 'first_from "out/none"', "FS059", "a campaign, or of kept failures"),
        ("budget 10 min", 'first_from "../.."', "FS138", "--allow-outside"),
    ],
)
def test_mistakes_are_shown_where_they_are(project: Path, line: str, instead: str, code: str, words: str) -> None:
    (project / "empty").mkdir()
    (project / "streets.foresee").write_text("foresee 1\n\nnetwork streets {\n}\n")
    file = written(project, NIGHTLY.replace(line, instead))
    try:
        read_campaign(file)
    except InputError as error:
        (found,) = error.diagnostics
    else:
        pytest.fail("no mistake was found")
    assert found.code == code and words in found.help
    assert found.span is not None and found.source_line
    assert code in foresee("check", file, expect=1)
    assert code in foresee("campaign", file, "--out", project / "out", expect=1)
    assert not (project / "out").exists()


@pytest.mark.parametrize(
    ("goal", "expect", "message", "help"),
    [
        ("rom", "expect room: always distance(ego, other) > 2 m", "no test case has", "did you mean 'room'?"),
        ("sides", "expect room: always distance(ego, other) > 2 m", "no test case has", "their labels: room"),
        ("room", "expect never collision(other)", "no test case has", "write `expect NAME: always ...`"),
        ("room", "expect room: eventually distance(ego, other) > 2 m", "which clips do not check", "`expect always`"),
    ],
)
def test_a_goal_that_no_test_case_has(project: Path, goal: str, expect: str, message: str, help: str) -> None:
    crosser = project / "crosser.foresee"
    crosser.write_text(crosser.read_text().replace("expect never collision(ego)", expect))
    file = written(project, NIGHTLY.replace("budget 10 min", f"goal {goal}"))
    shown = foresee("check", file, expect=1)
    assert "error FS058" in shown and message in " ".join(shown.split()) and f"| goal {goal}" in " ".join(shown.split())
    assert help in " ".join(shown.split())
    assert message in " ".join(foresee("campaign", file, "--out", project / "out", expect=1).split())
    foresee("check", written(project, NIGHTLY))


def test_it_runs_and_the_command_line_goes_before_it(project: Path, tmp_path: Path) -> None:
    file = written(project, NIGHTLY.replace("[idm]", "[idm, pdm]"))
    plans = foresee("plan", file, "--out", tmp_path / "out")
    assert "idm, reach" in plans and "pdm, reach" in plans
    foresee("campaign", file, "--out", tmp_path / "one", "--driver", "idm", "--children", "0", "--quiet", "--exit-zero")
    one = json.loads((tmp_path / "one" / "campaign.json").read_text())
    settings = one["settings"]
    assert (settings["driver"], settings["children"], settings["after_s"], settings["seed"]) == ("idm", 0, 2.5, 7)
    foresee(
        "campaign",
        file,
        "--out",
        tmp_path / "two",
        "--store",
        tmp_path / "one" / "store",
        "--children",
        "0",
        "--exit-zero",
    )
    folders = sorted(p.parent.name for p in (tmp_path / "two").glob("*/campaign.json"))
    assert folders == ["idm_reach", "pdm_reach"]


def test_it_stands_alone(project: Path) -> None:
    file = written(project, NIGHTLY)
    assert "no other path can be given beside it" in foresee(
        "campaign", file, project, "--out", project / "out", expect=1
    )


def test_the_bundled_one_runs_the_whole_library() -> None:
    found = read_campaign(Path(data_folder("scenarios")) / "campaign.foresee")
    assert found.drivers == ("pdm",)
    assert {Path(p).parent.name for p in found.paths} == {"scenarios", *(f"scenario{k}" for k in "34789")}


def test_a_statement_has_the_bounds_of_its_option() -> None:
    options = options_of_settings()
    for statement in get_args(get_args(m.CampaignItem)[0]):
        for name, setting in getattr(statement, "sets", {}).items():
            bounds = [part for part in statement.model_fields[name].metadata if isinstance(part, Bounds)]
            (option,) = (part for part in options[option_name(setting)].annotation.__metadata__)
            assert [(part.low, part.high) for part in bounds] in ([], [(option.min, option.max)]), setting


IN_NO_FILE = {
    "driver": "the statement `drivers` names several",
    "ranker": "the statement `rankers` names several",
    "against": "the statement `against` names several",
    "fidelity_limit_m": "it has no option either",
    "handover_s": "each driver asks for its own",
}
"""The settings that no statement sets, each with the reason. A new setting needs a statement, or a reason here."""


def test_each_setting_has_an_option_a_statement_and_a_place_in_the_docs(root: Path) -> None:
    names = [field.name for field in fields(CampaignSettings)]
    statements = get_args(get_args(m.CampaignItem)[0])
    stated = [setting for statement in statements for setting in getattr(statement, "sets", {}).values()]
    assert sorted([*stated, *IN_NO_FILE]) == sorted(names)
    for function in (campaigns.campaign, campaigns.plan):
        parameters = inspect.signature(function).parameters
        assert {option_name(name) for name in names} - set(parameters) == {"fidelity_limit_m"}
    method = (root / "docs" / "background" / "method.md").read_text(encoding="utf-8")
    assert [name for name in names if f"| `{name}` |" not in method] == []


def test_the_options_have_the_defaults_of_the_settings() -> None:
    options, settings = options_of_settings(), CampaignSettings()
    for field in fields(CampaignSettings):
        option = option_name(field.name)
        if option not in ("fidelity_limit_m", "handover", "against"):  # the driver's request, and three drivers
            assert options[option].default == getattr(settings, field.name)


def test_a_setting_without_an_option_is_refused() -> None:
    with pytest.raises(TypeError, match="the setting lane_m has no option"):
        options_of_settings(make_dataclass("More", [("lane_m", float, 1.0)], bases=(CampaignSettings,), frozen=True))
