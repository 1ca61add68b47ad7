"""`foresee init --driver KIND`: the driver that is written is built, completes a scenario, and passes its tests."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from foresee_dsl.cli import app
from foresee_dsl.exchange.driver_kinds import DriverKindError, driver_kinds
from tests.support.command import program, pytest_program
from tests.support.first_project import foresee

BUNDLED = ("external-cpp", "external-python", "external-rust", "python", "trajectory")


def run(folder: Path, *command: str) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.mark.parametrize("name", BUNDLED)
def test_a_written_driver_completes_its_scenarios(name: str, tmp_path: Path) -> None:
    kind = driver_kinds()[name]
    if kind.missing:
        pytest.skip(f"{', '.join(kind.missing)} is not installed, which {name} needs")
    folder = tmp_path / "project"
    written = foresee("init", folder, "--driver", name).stdout
    commands = [line.split("  #")[0].strip() for line in written.partition("Next:")[2].splitlines()]
    assert [command for command in commands if command in kind.build] == list(kind.build)
    for command in kind.build:
        run(folder, *command.split())
    assert "4 passed" in run(folder, str(pytest_program()), "-p", "no:cacheprovider")
    page = (folder / "README.md").read_text(encoding="utf-8")
    assert kind.about in page and f"foresee conform {kind.driver.split()[0]}".rstrip("'") in page.replace("'", "")
    run(folder, str(program()), "check", ".")


def test_the_kinds_are_listed_and_an_unknown_one_names_them(tmp_path: Path) -> None:
    listed = foresee("init", "--kinds").stdout
    assert all(f"{kind.name} " in listed and kind.about in listed for kind in driver_kinds().values())
    done = foresee("init", tmp_path / "x", "--driver", "pyhton", expect=1)
    assert "kinds of drivers that can be written: external-cpp, external-python" in str(done.exception)
    assert not (tmp_path / "x").exists()


def test_a_package_adds_a_kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kind = tmp_path / "their_kind"
    shutil.copytree(driver_kinds()["external-python"].folder, kind)
    (kind / "__init__.py").touch()
    (kind / "notes.txt.j2").write_text("{{ name }} is driven by {{ address }}\n", encoding="utf-8")
    info = tmp_path / "theirs-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1\n", encoding="utf-8")
    (info / "entry_points.txt").write_text("[foresee_dsl.driver_kinds]\ntheirs = their_kind\n", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["init", "yours", "--driver", "theirs"])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "yours/notes.txt").read_text() == "yours is driven by external:python3 my_driver.py\n"
    assert not (tmp_path / "yours/__init__.py").exists() and not (tmp_path / "yours/kind.toml").exists()
    (kind / "kind.toml").write_text("about = 1", encoding="utf-8")
    with pytest.raises(DriverKindError, match="'theirs' has no sound"):
        driver_kinds()


def test_the_stored_run_of_a_program_is_shown_without_starting_it(tmp_path: Path) -> None:
    folder, tool = tmp_path / "project", str(program())
    foresee("init", folder, "--driver", "external-python")
    options = ("--run-programs", "--children", "1", "--risky-points", "1", "--exit-zero")
    run(folder, tool, "campaign", "campaign.foresee", *options)
    (child,) = (file for file in (folder / "out/children").rglob("*_hurries_out_p1_m1.foresee"))
    (folder / "my_driver.py").unlink()
    shown = run(folder, tool, "show", str(child.relative_to(folder)))
    assert "external:python3 my_driver.py" in shown and "from out/" in " ".join(shown.split())
