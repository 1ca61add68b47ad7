"""Programs that files name as drivers start only where the user said so."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from foresee_dsl.cli import app
from foresee_dsl.drivers.consent import refuse_programs
from foresee_dsl.errors import DriverError
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


@pytest.mark.parametrize("command", ["campaign", "plan"])
def test_a_campaigns_file_starts_no_program_unasked(campaign: Path, command: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, [command, str(campaign), "--out", str(tmp_path / "out")])
    assert isinstance(done.exception, DriverError)
    assert "name programs as drivers: external:python3" in str(done.exception)
    assert "--run-programs starts what the file says, --driver names another driver" in str(done.exception)
    assert not (tmp_path / "mark").exists() and not (tmp_path / "out").exists()


def test_an_option_or_another_driver_is_consent_enough(campaign: Path) -> None:
    for consent in (["--run-programs"], ["--driver", "idm"]):
        done = CliRunner().invoke(app, ["plan", str(campaign), *consent])
        assert done.exit_code == 0, done.exception


def test_a_line_in_the_configuration_allows_a_folder(campaign: Path, tmp_path: Path) -> None:
    config = tmp_path / "config.toml"
    config.write_text(f'run-programs-in = ["{campaign.parent}"]\n', encoding="utf-8")
    refuse_programs([(PROGRAM, campaign), ("pdm", tmp_path / "x.foresee")], "ask")
    with pytest.raises(DriverError, match=r"programs as drivers: external:python3 mine.py. ask; or write"):
        refuse_programs([(PROGRAM, campaign), (PROGRAM, tmp_path / "x.foresee")], "ask")
    for wrong in ('run-programs-in = "everywhere"', 'run-programs-in = ["here"]', "run-programs-in = ["):
        config.write_text(wrong, encoding="utf-8")
        with pytest.raises(DriverError, match="the configuration"):
            refuse_programs([(PROGRAM, campaign)], "ask")
