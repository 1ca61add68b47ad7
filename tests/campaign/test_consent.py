"""Programs that files name as drivers start only where the user said so."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from foresee_dsl.campaign.campaign_file import read_campaign
from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.mutate_file import mutate_file
from foresee_dsl.campaign.steps.clip import measure_clip
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.cli import app
from foresee_dsl.cli.options.common import names_in
from foresee_dsl.drivers.consent import allowing, may_start, refuse_programs
from foresee_dsl.errors import DriverError
from foresee_dsl.forecast.registry import load_ranker
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.loading import load_test_case
from tests.support.small_campaign import TEXT

PROGRAM = "external:python3 mine.py"


@pytest.fixture
def campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A campaign's file that somebody sent: its driver is a program that leaves a mark when it runs."""
    folder = tmp_path / "received"
    folder.mkdir()
    (folder / "crosser.foresee").write_text(TEXT, encoding="utf-8")
    (folder / "mine.py").write_text(f"open({str(tmp_path / 'mark')!r}, 'w')\n", encoding="utf-8")
    file = folder / "all.foresee"
    file.write_text(
        'foresee 1\n\ncampaign all {\n  seeds "crosser.foresee"\n'
        f'  drivers ["external:python3 {folder}/mine.py"]\n}}\n',
        encoding="utf-8",
    )
    monkeypatch.setenv("FORESEE_CONFIG", str(tmp_path / "config.toml"))
    monkeypatch.chdir(tmp_path)
    return file


def test_a_reference_driver_may_hold_a_comma(campaign: Path) -> None:
    address = "external:python3 other.py --speeds 3,5"
    text = campaign.read_text(encoding="utf-8")
    drivers = next(line for line in text.splitlines() if "drivers" in line)
    campaign.write_text(text.replace(drivers, f'  drivers [idm]\n  against ["{address}", pdm]'), encoding="utf-8")
    assert read_campaign(campaign).against == (address, "pdm")
    done = CliRunner().invoke(app, ["plan", str(campaign)])
    assert f"name programs as drivers: {address}." in str(done.exception)
    quoted = f'"{address}",pdm'
    for given in (["--run-programs"], ["--against", quoted]):
        done = CliRunner().invoke(app, ["plan", str(campaign), *given])
        assert done.exit_code == 0, done.exception
    assert names_in(quoted) == (address, "pdm") and names_in(" idm, ,pdm,idm") == ("idm", "pdm")


@pytest.mark.parametrize("command", ["campaign", "plan"])
def test_a_campaigns_file_starts_no_program_unasked(campaign: Path, command: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, [command, str(campaign), "--out", str(tmp_path / "out")])
    assert isinstance(done.exception, DriverError)
    assert "name programs as drivers: external:python3" in str(done.exception)
    assert "--run-programs starts the programs that the file names, --driver names another driver instead" in str(
        done.exception
    )
    assert not (tmp_path / "mark").exists() and not (tmp_path / "out").exists()


def test_an_option_or_another_driver_is_consent_enough(campaign: Path) -> None:
    for consent in (["--run-programs"], ["--driver", "idm"]):
        done = CliRunner().invoke(app, ["plan", str(campaign), *consent])
        assert done.exit_code == 0, done.exception


def test_a_line_in_the_configuration_allows_a_folder(campaign: Path, tmp_path: Path) -> None:
    config = tmp_path / "config.toml"
    config.write_text(f'run-programs-in = ["{campaign.parent}"]\n', encoding="utf-8")
    with allowing(()):
        refuse_programs([(PROGRAM, campaign), ("pdm", tmp_path / "x.foresee")], "ask")
        assert may_start(PROGRAM)
    with pytest.raises(DriverError, match=r"programs as drivers: external:python3 mine.py. ask; or write"):
        refuse_programs([(PROGRAM, campaign), (PROGRAM, tmp_path / "x.foresee")], "ask")
    for wrong in ('run-programs-in = "everywhere"', 'run-programs-in = ["here"]', "run-programs-in = ["):
        config.write_text(wrong, encoding="utf-8")
        with pytest.raises(DriverError, match="the configuration"):
            refuse_programs([(PROGRAM, campaign)], "ask")


@pytest.fixture(scope="module")
def mutant(scenarios: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A mutant that somebody sent, which says that it was recorded with a program."""
    folder = tmp_path_factory.mktemp("received")
    shutil.copytree(scenarios, folder, dirs_exist_ok=True)
    case = load_test_case(folder / "scenario9.foresee::r03")
    trace = run_test_case(case, "idm", 0).trace
    file = folder / "p1.foresee"
    draft = clip_around(case, trace, load_ranker("proximity").rank(trace)[0], file, before_s=2.0, after_s=1.0)
    clip, *_ = measure_clip(draft, case, trace, file, DriverSetup("idm"))
    file.write_text(print_model(clip), encoding="utf-8")
    (child,) = mutate_file(file, preset="focused", count=1, driver="idm", seed=0)
    (folder / "mine.py").write_text("open('mark', 'w')\n", encoding="utf-8")
    recorded = f'driver "example 1 via external:{sys.executable} {folder}/mine.py"'
    text, replaced = re.subn(r'driver "idm [^"]*"', recorded, child.text)
    assert replaced == 1
    Path(child.file).write_text(text, encoding="utf-8")
    return Path(child.file)


@pytest.mark.parametrize(
    ("command", "more", "said"),
    [
        ("verify", (), "--run-programs"),
        ("minimise", (), "--run-programs"),
        ("show", (), ""),
        ("view", ("--output", "page.html"), ""),
        ("export", ("openscenario", "--out", "exported"), "write it, or another driver, with --driver"),
        ("repin", ("--run",), ""),
    ],
)
def test_no_command_starts_the_program_that_a_mutant_records(
    mutant: Path, command: str, more: tuple[str, ...], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORESEE_CONFIG", str(tmp_path / "config.toml"))
    monkeypatch.chdir(mutant.parent)
    more = tuple(str(tmp_path / word) if word in ("page.html", "exported") else word for word in more)
    words = [command, *more[:1], str(mutant), *more[1:]] if command == "export" else [command, str(mutant), *more]
    done = CliRunner().invoke(app, words)
    assert not (mutant.parent / "mark").exists()
    assert said in f"{done.stdout} {done.exception}"


def test_a_link_in_an_allowed_folder_is_where_it_leads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORESEE_CONFIG", str(tmp_path / "config.toml"))
    (tmp_path / "config.toml").write_text(f'run-programs-in = ["{tmp_path}/mine"]\n', encoding="utf-8")
    for folder in ("mine", "received"):
        (tmp_path / folder).mkdir()
    (tmp_path / "received" / "x.foresee").touch()
    (tmp_path / "mine" / "x.foresee").symlink_to(tmp_path / "received" / "x.foresee")
    with pytest.raises(DriverError, match="programs as drivers"):
        refuse_programs([(PROGRAM, tmp_path / "mine" / "x.foresee")], "ask")
