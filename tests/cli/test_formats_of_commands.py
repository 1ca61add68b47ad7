"""One set of formats for all commands that report, also those of plug-ins: `--format`, and `--json` as a short form."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from foresee_dsl.cli import app
from foresee_dsl.report.formats import PEOPLE
from tests.support import small_campaign
from tests.support.first_project import foresee

OTHER_FORMATS = {
    "export carla-route": "its --format is the version of CARLA that reads the file",
    "export osi": "its --format is the format of the file: messages or mcap",
}
"""Commands with `--json` alone, and why."""
CASE, TRACE, CLIP = "crosser.foresee::last", "runs/crosser_last.npz", "clips/crosser_last_p1.foresee"
AROUND = ("--before", "3", "--after", "3")
CALLS = {
    "check": ("crosser.foresee",),
    "explain": ("FS012",),
    "sample": ("crosser.foresee", "--count", "3"),
    "compile": (CASE,),
    "diff": (CASE, "crosser.foresee::later"),
    "run": (CASE, "--exit-zero"),
    "forecast": (TRACE, *AROUND),
    "clip": (TRACE, *AROUND),
    "mutate": (CLIP, "--children", "1", "--driver", "idm", "--exit-zero"),
    "repin": (CLIP,),
    "plan": ("crosser.foresee",),
    "review": (),
    "triage": (),
    "history": (),
    "store": ("stat",),
    "keep": ("1",),
    "compare": ("out", "out"),
    "report": (),
    "drivers": (),
    "models": (),
}
"""Arguments of commands that report in a second; the others report that this file is missing."""
MISSING = "missing.foresee"
MISTAKES = {
    "diagnose": (MISSING, "--driver", "idm"),
    "conform": ("no_such_driver",),
    "study": ("rq1", MISSING),
    "import carla": ("--map", MISSING, "--routes", MISSING, "--out", "town"),
}
"""Arguments with an error in the input for the other commands that need more than a file."""


@pytest.fixture(scope="module")
def commands() -> dict[str, Any]:
    """All commands that report, with those of plug-ins and the formats of `import` and `export`, by their words."""
    group = typer.main.get_command(app)
    return dict(_inside(group, group.make_context("foresee", [], resilient_parsing=True), ()))


def _inside(group: Any, context: Any, words: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
    for name in group.list_commands(context):
        _, command, _ = group.resolve_command(context, [name])
        if hasattr(command, "list_commands"):
            inside = command.make_context(name, [], parent=context, resilient_parsing=True)
            yield from _inside(command, inside, (*words, name))
        elif {"--json", "--format"} & _options(command):
            yield " ".join((*words, name)), command


def _options(command: Any) -> set[str]:
    return {option for parameter in command.params for option in parameter.opts}


def test_every_command_that_reports_has_the_three_options(commands: dict[str, Any]) -> None:
    assert {*CALLS, *MISTAKES, *OTHER_FORMATS, "mine", "export fcd", "doctor"} <= commands.keys()
    for words, command in commands.items():
        assert _options(command) >= {"--json", "--output", "--format"}, words
        if words in OTHER_FORMATS:
            continue
        refused = CliRunner().invoke(app, [*words.split(), "--format", "nonsense"], env={"COLUMNS": "400"}).output
        assert "'nonsense' is not one of '" in refused and "'json'" in refused, words
        (option,) = (parameter for parameter in command.params if "--format" in parameter.opts)
        offered = {
            item.value for item in option.shell_complete(command.make_context(words, [], resilient_parsing=True), "")
        }
        assert "json" in offered and offered & {*PEOPLE, "html"}, words


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a campaign, a kept finding, the trace of a run and a clip."""
    folder = tmp_path_factory.mktemp("project")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        small_campaign.finished(small_campaign.write_project(Path()), Path("out"))
        foresee("run", CASE, "--driver", "idm", "--out", "runs", "--exit-zero")
        foresee("clip", TRACE, *AROUND)
        foresee("keep", "1")
    return folder


def test_json_is_a_short_form_of_a_format(
    commands: dict[str, Any], project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(project)
    for words in commands.keys() - OTHER_FORMATS.keys() - {"doctor"}:
        fails = words not in CALLS
        arguments = MISTAKES.get(words, (MISSING, "--out", "new") if " " in words else (MISSING,))
        printed = {
            foresee(*words.split(), *CALLS.get(words, arguments), *form, expect=int(fails)).stdout
            for form in (("--json",), ("--format", "json"))
        }
        assert len(printed) == 1, words
        assert (json.loads(*printed)["document"] == "error") == fails, words


def test_mutants_of_another_preset_are_not_replaced(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(project)
    options = ("mutate", CLIP, "--driver", "idm", "--exit-zero", "--out", tmp_path)
    first = foresee(*options, "--children", "2")
    assert "asked for" not in first.stdout
    assert foresee(*options, "--children", "2").stdout == first.stdout  # equal content may be written again
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    refused = foresee(*options, "--children", "9", "--preset", "avoidable", expect=1)
    assert f"nothing was written: {tmp_path}" in str(refused.exception)
    assert "_m1.foresee" in str(refused.exception) and "there already with other content" in str(refused.exception)
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_it_is_said_why_there_are_fewer_mutants_than_asked_for(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(project)
    options = ("--driver", "idm", "--exit-zero", "--out", tmp_path, "--preset", "avoidable", "--children", "90")
    printed = foresee("mutate", CLIP, *options).stdout
    count = len([*tmp_path.iterdir()])
    assert 0 < count < 90
    assert f"{count} of the 90 mutants asked for: the preset avoidable makes one for each candidate" in printed


def test_a_file_in_the_place_of_the_folder_is_named_with_its_option(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    refused = foresee("campaign", MISSING, "--out", tmp_path / "taken", expect=2)
    assert "Invalid value for '--out'" in refused.output


def test_a_scenario_is_not_mutated(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(project)
    for address in ("crosser.foresee", CASE):
        refused = foresee("mutate", address, "--driver", "idm", expect=1)
        assert f"{address} is not a clip: write one with `foresee clip`" in str(refused.exception)
