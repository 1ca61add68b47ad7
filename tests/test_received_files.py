"""No command starts a program that something received names: every command, every kind of file.

The rows below are compared with the registry of commands, so that a new command without a row fails.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from foresee_dsl.cli import COMMANDS, app
from foresee_dsl.cli.added import ADDED
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError
from foresee_dsl.files import cache_folder
from foresee_dsl.plugins import PluginGroup
from tests.support.received import Received

Row = Callable[[str, Path], list[list[str]]]
"""The command lines, less the command, for a received file and a folder to write into."""


def alone(*options: str) -> Row:
    """The file is the argument."""
    return lambda file, _: [[file, *options]]


def into(option: str, *options: str) -> Row:
    """The same, with a file or folder that is written."""
    return lambda file, out: [[file, option, str(out / "written"), *options]]


SHORT = ("--before", "0.5", "--after", "0.5", "--risky-points", "1", "--children", "0", "--first", "1")
READ: dict[str, Row] = {
    "init": lambda file, out: [["network", file, "--out", str(out / "net.foresee")]],
    "check": alone("--places"),
    "fmt": alone("--check"),
    "draw": into("--svg"),
    "sample": alone("--count", "2"),
    "compile": into("--out"),
    "expand": alone(),
    "diff": lambda file, _: [[file], [file, file]],
    "textconv": alone(),
    "git-diff": lambda file, _: [["a.foresee", file, "0" * 40, "100644", file, "1" * 40, "100644"]],
    "run": into("--out", "--first", "1"),
    "show": lambda file, _: [[file, "--fresh"], [file, "--step", "--to", "0.1"], [Path(file).stem, "--campaign", file]],
    "forecast": alone(),
    "clip": into("--out", "--before", "1", "--after", "1"),
    "mutate": alone("--children", "1"),
    "repin": lambda file, _: [[file], [file, "--run"]],
    "minimise": lambda file, out: [
        [file, "--out", str(out / "small"), "--budget", "2"],
        ["crosser_after_p1_m2", "--campaign", file, "--out", str(out / "small")],
    ],
    "diagnose": lambda file, _: [[file], ["--all", "--campaign", file], ["crosser_after_p1_m2", "--campaign", file]],
    "assess": alone("--first", "1"),
    "campaign": lambda file, out: [
        [file, "--out", str(out / "a"), *SHORT],
        *([[file, "--out", str(out / "b"), "--driver", "idm", *SHORT]] if file.endswith("against.foresee") else []),
    ],
    "plan": into("--out", *SHORT),
    "mine": into("--write"),
    "study": into("--out", "--plan"),
    "fuzz": into("--out", "--cycles", "1", "--mutations", "1", "--driver", "idm"),
    "sure": lambda file, out: [
        [file],
        ["crosser_after_p1_m2", "--campaign", file, "--out", str(out / "region")],
    ],
    "triage": lambda file, _: [["--campaign", file], ["1", "known", "--note", "x", "--campaign", file]],
    "history": into("--html"),
    "review": lambda file, _: [[file], ["crosser_after_p1_m2", "--campaign", file]],
    "store": lambda file, out: [
        ["stat", file],
        ["gc", file, "--damaged"],
        ["export", file, "--to", str(out / "runs.csv")],
        ["merge", file, "--into", str(out / "merged")],
    ],
    "keep": lambda file, out: [[file, "--to", str(out / "kept")], ["crosser_after_p1_m2", "--campaign", file]],
    "verify": lambda file, _: [[file], [file, "--driver", "idm"]],
    "compare": lambda file, _: [[file, file], ["--drivers", "idm,idm", file]],
    "report": alone("--format", "text"),
    "view": into("--output"),
    "import carla": lambda file, out: [["--map", file, "--routes", file, "--out", str(out / "carla")]],
    "import opendrive": into("--out"),
    "import openscenario": into("--out"),
    "import osm": into("--out"),
    "import sumo": into("--out"),
    "export carla-route": into("--out"),
    "export commonroad": into("--out"),
    "export fcd": into("--out"),
    "export levelx": into("--out"),
    "export osi": into("--out"),
    "export openscenario": into("--out"),
    "models": alone(),
}
"""Every command that reads files."""
READ_NOTHING = {"explain", "conform", "drivers", "completion", "doctor"}
OVER_A_PIPE = {"lsp"}
"""Tested below: it reads the files that an editor opens."""
SIMULATED = {"run", "assess", "mutate", "fuzz", "compare"}
"""Commands that drive with named drivers alone: single files are enough."""


@pytest.fixture(scope="module")
def received(tmp_path_factory: pytest.TempPathFactory) -> Received:
    """What somebody sent."""
    return Received(tmp_path_factory.mktemp("received"))


@pytest.fixture
def folder(received: Received, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Received]:
    """The same, with nothing started yet, in a user's home without a configuration.

    Of the cache only what is computed without files that name programs is shared by the tests.
    """
    cache = tmp_path / "cache"
    cache.mkdir()
    for name in ("grammar", "imports", "nets", "types"):
        (cache / name).symlink_to(cache_folder(name))
    monkeypatch.setenv("FORESEE_CONFIG", str(tmp_path / "config.toml"))
    monkeypatch.setenv("FORESEE_CACHE", str(cache))
    monkeypatch.chdir(tmp_path)
    received.mark.unlink(missing_ok=True)
    yield received
    received.mark.unlink(missing_ok=True)


def commands() -> set[str]:
    """Every command there is, those of plug-ins too."""
    names = {*(name for _, name, _ in COMMANDS), *ADDED.names()} - {"import", "export"}
    for group in ("importer", "exporter"):
        plugins = PluginGroup(f"foresee_dsl.{group}s", group, DriverError)
        names |= {f"{group.removesuffix('er')} {name}" for name in plugins.names()}
    return names


def test_every_command_has_a_row() -> None:
    assert commands() == READ.keys() | READ_NOTHING | OVER_A_PIPE


@pytest.mark.parametrize("command", READ)
def test_nothing_is_started_unasked(command: str, folder: Received, tmp_path: Path) -> None:
    for kind, file in folder.kinds().items():
        if command in SIMULATED and kind in ("repository", "campaign.json"):
            continue
        out = tmp_path / re.sub(r"\W+", "_", kind)
        out.mkdir()
        for words in READ[command](str(file), out):
            done = CliRunner().invoke(app, [*command.split(), *words])
            assert not folder.mark.exists(), (command, kind, words, folder.mark.read_text(), done.output)


def test_the_language_server_starts_nothing(folder: Received) -> None:
    messages: list[dict[str, object]] = [
        {"id": 1, "method": "initialize", "params": {"capabilities": {}, "rootUri": folder.root.as_uri()}},
        {"method": "initialized", "params": {}},
    ]
    for file in folder.kinds().values():
        if file.suffix == ".foresee":
            document = {"uri": file.as_uri(), "languageId": "foresee", "version": 1, "text": file.read_text()}
            messages.append({"method": "textDocument/didOpen", "params": {"textDocument": document}})
    messages += [{"id": 2, "method": "shutdown"}, {"method": "exit"}]
    texts = [json.dumps({"jsonrpc": "2.0", **message}) for message in messages]
    sent = "".join(f"Content-Length: {len(text.encode())}\r\n\r\n{text}" for text in texts)
    program = [str(Path(sys.executable).parent / "foresee"), "lsp"]
    done = subprocess.run(program, input=sent.encode(), capture_output=True, timeout=60, check=False)
    assert b'"id": 2' in done.stdout or b'"id":2' in done.stdout
    assert not folder.mark.exists()


@pytest.mark.parametrize("consent", [False, True])
def test_pytest_starts_nothing_that_a_suite_records(folder: Received, *, consent: bool) -> None:
    words = ["--foresee-driver", "recorded", *(["--foresee-run-programs"] if consent else [])]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(folder.suite), *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert folder.mark.exists() == consent, done.stdout
    assert ("--foresee-run-programs starts the programs that the files name" in done.stdout) != consent, done.stdout


@pytest.mark.parametrize(
    "words",
    [
        ["verify", "MUTANT", "--run-programs"],
        ["show", "TRACE", "--step", "--to", "0.1", "--driver", "PROGRAM"],
        ["show", "MUTANT", "--fresh", "--driver", "PROGRAM"],
        ["clip", "TRACE", "--run-programs", "--out", "clips", "--before", "1", "--after", "1"],
        ["campaign", "DRIVERS", "--run-programs"],
        ["compare", "--drivers", "idm,PROGRAM", "MUTANT"],
    ],
)
def test_with_consent_the_program_runs(folder: Received, words: list[str]) -> None:
    named = {"MUTANT": folder.mutant, "TRACE": folder.trace, "DRIVERS": folder.drivers}
    told = [str(named.get(word, word)).replace("PROGRAM", folder.address) for word in words]
    done = CliRunner().invoke(app, told)
    assert folder.mark.exists(), (done.output, done.exception)


def test_references_of_a_campaigns_file_run_with_consent_only(folder: Received, tmp_path: Path) -> None:
    for words in ([], ["--driver", "idm"]):
        done = CliRunner().invoke(app, ["plan", str(folder.against), *words])
        assert isinstance(done.exception, DriverError)
        assert "--run-programs starts the programs that the file names, --against names other" in str(done.exception)
    assert not (tmp_path / "out").exists()
    for words in (["--run-programs"], ["--against", "none"], ["--against", folder.address]):
        done = CliRunner().invoke(app, ["plan", str(folder.against), *words])
        assert done.exit_code == 0, done.exception


def test_a_trace_is_shown_without_its_program(folder: Received, tmp_path: Path) -> None:
    for command in (["show"], ["view", "--output", str(tmp_path / "page.html")]):
        done = CliRunner().invoke(app, [*command, str(folder.child_trace)])
        assert done.exit_code == 0, done.exception
        assert "its parent is not shown: running it would start the program" in done.stderr
    assert (tmp_path / "page.html").is_file()
    done = CliRunner().invoke(app, ["show", str(folder.trace), "--step"])
    assert isinstance(done.exception, DriverError) and "only with your consent" in str(done.exception)
    assert not folder.mark.exists()


def test_a_program_is_no_driver_until_it_is_allowed(folder: Received) -> None:
    for address in (folder.address, folder.address.replace(":", "+ideal:", 1)):
        with pytest.raises(DriverError, match=r"starts only with your consent.*consent\.allow"):
            load_driver(address)


def test_git_runs_nothing_that_a_repository_names(folder: Received) -> None:
    """Git itself runs the program in this repository; what we call does not, and finds the old versions too."""
    work = folder.repository
    subprocess.run(["git", "-C", str(work), "log", "--", "crosser.foresee"], capture_output=True, check=False)
    assert folder.mark.exists()
    folder.mark.unlink()
    done = CliRunner().invoke(app, ["repin", str(work / "out" / "children")])
    assert "git has no version" not in done.output and "after 12 s => after 11 s" in done.output, done.output
    assert not folder.mark.exists()
