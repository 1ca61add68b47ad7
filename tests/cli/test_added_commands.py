"""Commands of other packages: real distributions on the path of real processes, with docs/reference/plug-ins.md."""

from __future__ import annotations

import json
import os
import re
import subprocess
from pathlib import Path

import pytest

from foresee_dsl.cli.completion import VARIABLE
from tests.support.command import FORESEE, program

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "plug-ins.md").read_text(encoding="utf-8")
MORE = '''
from pathlib import Path

Path(__file__).with_name("imported").touch()

from typing import Annotated

import typer

from foresee_dsl.cli.options.common import DriverOption
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import ForeseeError
from foresee_dsl.cli.completion import VARIABLE
from tests.support.command import FORESEE, program

NUMBER = 3


def weigh(file: Annotated[Path, typer.Argument()], driver: DriverOption = "idm") -> None:
    """Weigh a file, in bytes.

    [dim]foresee weigh a.foresee[/dim]
    """
    if not file.exists():
        raise ForeseeError(f"{file} does not exist")
    load_driver(driver if file.suffix != ".txt" else file.read_text())
    typer.echo(f"{10 // len(file.read_text())} bytes")


def wrong(what: int | str) -> None:
    """Take what no command line has."""
'''
ENTRIES = """
weigh = acme_more:weigh
wrong = acme_more:wrong
number = acme_more:NUMBER
gone = acme_gone:gone
check = acme_more:weigh
"""


def install(folder: Path, package: str, entries: str, **modules: str) -> None:
    for name, text in modules.items():
        (folder / f"{name}.py").write_text(text)
    info = folder / f"{package.replace('-', '_')}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\nSummary: Of {package}\n")
    (info / "entry_points.txt").write_text(entries)


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A folder of packages, for PYTHONPATH: the page's example, and one with good and broken commands."""
    ((name, text),) = re.findall(r"`(\w+)\.py`,[^`\n]*:\n\n```python\n(.*?)```", PAGE, re.S)
    (entry,) = re.findall(r"```toml\n.*?\]\n(.*?)```", PAGE, re.S)
    folder = tmp_path / "site"
    folder.mkdir()
    install(folder, "acme-count", "[foresee_dsl.commands]\n" + entry.replace('"', ""), **{name: text})
    install(folder, "acme-more", f"[foresee_dsl.commands]{ENTRIES}", acme_more=MORE)
    return folder


def foresee(site: Path, *words: object, code: int = 0, **settings: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(site), "NO_COLOR": "1", "COLUMNS": "200", **settings}
    # The command line looks for a shell's question when it is imported, so a fork of the server would not notice it.
    called = FORESEE if VARIABLE in settings else program()
    done = subprocess.run([called, *map(str, words)], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == code, f"{words}: {done.returncode}\n{done.stdout}\n{done.stderr}"
    assert "Traceback" not in done.stderr, done.stderr
    return done


def completed(site: Path, line: str) -> list[str]:
    settings = {VARIABLE: "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(line.split()) - 1)}
    return foresee(site, **settings).stdout.split()


def test_a_package_adds_a_command(site: Path, scenarios: Path) -> None:
    file = scenarios / "scenario7.foresee"
    assert foresee(site, "count", file).stdout == "4 test cases\n"
    assert json.loads(foresee(site, "count", file, "--json").stdout) == {
        "schema": 1, "document": "count", "test_cases": 4,
    }  # fmt: skip
    foresee(site, "count", file, "--json", "--output", site / "count.json")
    assert json.loads((site / "count.json").read_text())["test_cases"] == 4
    missing = json.loads(foresee(site, "count", site / "no.foresee", "--json", code=1).stdout)
    assert (missing["document"], missing["ok"]) == ("error", False)
    assert "Scenario files or folders." in foresee(site, "count", "--help").stdout
    assert "Missing argument" in foresee(site, "count", code=2).stderr


def test_the_help_and_other_commands_import_no_plug_in(site: Path, scenarios: Path) -> None:
    shown = foresee(site, "--help")
    listed = dict(re.findall(r"^│ (\w+) +(\S.*?) +│$", shown.stdout.partition("Plug-ins")[2], re.M))
    assert listed["weigh"] == "Weigh a file, in bytes."
    assert listed["count"] == "Count test cases."
    assert listed["number"] == "Of acme-more"
    assert listed["gone"].startswith("command 'gone' of package acme-more cannot be loaded: ModuleNotFoundError")
    assert "check" not in listed
    refused = "the command 'check' of package acme-more is refused, because foresee-dsl has a command of this name"
    assert shown.stderr == f"warning: {refused}\n"
    assert "no errors" in foresee(site, "check", scenarios / "scenario7.foresee").stdout
    assert "Did you mean 'weigh'?" in foresee(site, "wiegh", code=2).stderr
    assert completed(site, "foresee wei") == ["weigh"]
    assert not (site / "imported").exists()
    assert completed(site, "foresee weigh --dri") == ["--driver"]
    assert (site / "imported").exists()


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("gone", "error: command 'gone' of package acme-more cannot be loaded: ModuleNotFoundError"),
        ("number", "error: command 'number' of package acme-more is not usable: acme_more:NUMBER is not a function"),
        ("wrong", "error: command 'wrong' of package acme-more cannot be loaded: AssertionError: Typer"),
    ],
)
def test_a_broken_command_is_named_with_its_package(name: str, why: str, site: Path) -> None:
    assert why in foresee(site, name, code=1).stderr
    assert completed(site, f"foresee {name} --") == ["--help"]


def test_a_mistake_is_1_and_a_fault_is_3_and_names_the_package(site: Path) -> None:
    assert foresee(site, "weigh", site / "none", code=1).stderr == f"error: {site / 'none'} does not exist\n"
    (site / "empty").touch()
    fault = foresee(site, "weigh", site / "empty", code=3).stderr.splitlines()
    assert fault[0].startswith("foresee has a fault: ZeroDivisionError")
    assert fault[1] == "It happened in the command 'weigh' of package acme-more."


def test_a_program_starts_when_an_option_names_it_and_not_when_a_file_does(site: Path) -> None:
    (site / "a.foresee").write_text("x")
    foresee(site, "weigh", site / "a.foresee", "--driver", "external:true")
    (site / "a.txt").write_text("external:true")
    assert "starts only with your consent" in foresee(site, "weigh", site / "a.txt", code=1).stderr


def test_one_name_of_two_packages_is_refused_with_both_named(site: Path) -> None:
    install(site, "zulu-tools", "[foresee_dsl.commands]\nweigh = zulu:weigh\n")
    both = "command 'weigh' is offered by more than one package: acme-more, zulu-tools"
    assert both in foresee(site, "weigh", "x", code=1).stderr
    assert both in foresee(site, "--help").stdout


def test_doctor_names_what_cannot_be_used(site: Path) -> None:
    install(site, "acme-risk", "[foresee_dsl.rankers]\nfastest = acme_risk:Fastest\n")
    said = {f["what"]: f for f in json.loads(foresee(site, "doctor", "--json", code=1).stdout)["findings"]}
    assert not said["commands of plug-ins"]["ok"]
    assert "the command 'check' of package acme-more is refused" in said["commands of plug-ins"]["detail"]
    assert not said["other plug-ins"]["ok"]
    assert "ranker 'fastest' of package acme-risk cannot be loaded" in said["other plug-ins"]["detail"]
