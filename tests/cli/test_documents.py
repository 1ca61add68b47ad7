"""JSON documents: their schemas as they are published, what commands print against them, mistakes, and `--output`."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import pytest
from foresee_recordings import documents as recordings
from foresee_study import documents as study

from foresee_dsl.cli.documents import DOCUMENTS, schemas
from tests.support.first_project import ROOT, checked, foresee
from tests.support.goldens import Golden

TWO = 'foresee 1\n\ncampaign two {{\n  seeds "{}"\n  drivers [pdm, idm]\n}}\n'
FOLDER = ROOT / "docs" / "schemas"


def test_the_published_schemas_are_those_of_the_code(golden: Golden) -> None:
    texts = schemas({**DOCUMENTS, **recordings.DOCUMENTS, **study.DOCUMENTS})
    for name, text in texts.items():
        jsonschema.Draft202012Validator.check_schema(json.loads(text))
        golden(text, FOLDER / name)
    assert {file.name for file in FOLDER.glob("*.json")} == set(texts)


@pytest.fixture(scope="module")
def trace(scenarios: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    address = f"{scenarios / 'scenario7.foresee'}::r01"
    return str(checked(foresee("run", address, "--json", "--out", tmp_path_factory.mktemp("runs")).stdout)["trace"])


def test_what_commands_print_is_as_their_schemas_say(scenarios: Path, trace: str, tmp_path: Path) -> None:
    file = scenarios / "scenario7.foresee"
    clip = checked(foresee("clip", trace, "--out", tmp_path, "--json").stdout)
    printed = [
        foresee("check", file, "--json"),
        foresee("explain", "FS012", "--json"),
        foresee("forecast", trace, "--json"),
        foresee("mutate", clip["clip"], "--children", "1", "--json"),
        foresee("compile", f"{file}::r01", "--out", tmp_path / "sumo", "--json"),
        foresee("sample", file, "--format", "json"),
        foresee("diff", f"{file}::r01", f"{file}::r02", "--json"),
        foresee("repin", clip["clip"], "--json"),
        foresee("plan", f"{file}::r01", "--out", tmp_path / "out", "--format", "json"),
        foresee("drivers", "--json"),
        foresee("models", "--json"),
    ]
    (tmp_path / "two.foresee").write_text(TWO.format(file))
    options = ("--out", tmp_path / "out", "--format", "json", "--allow-outside")
    printed.append(foresee("plan", tmp_path / "two.foresee", *options))
    names = [checked(done.stdout)["document"] for done in printed]
    assert set(names) <= set(DOCUMENTS)
    assert len(set(names)) == len(printed)


def test_a_mistake_is_json_where_json_was_asked_for(tmp_path: Path) -> None:
    (tmp_path / "s.foresee").write_text("foresee 1\n\nscenario s {\n  end after 5 kmh\n}\n")
    for command in ("run", "campaign", "assess", "compile"):
        data = checked(foresee(command, tmp_path / "s.foresee", "--json", expect=1).stdout)
        (found,) = data["diagnostics"]
        assert (data["document"], data["ok"], found["code"], found["span"]["line"]) == ("error", False, "FS005", 4)
    data = checked(foresee("forecast", tmp_path / "s.foresee", "--json", expect=1).stdout)
    assert "is not a trace" in data["message"] and data["diagnostics"] == []
    data = checked(foresee("verify", tmp_path / "nothing", "--json", expect=1).stdout)
    assert data["document"] == "error"


def test_output_is_a_file_and_people_have_theirs(tmp_path: Path) -> None:
    file = tmp_path / "s.foresee"
    file.write_text("foresee 1\n\nscenario s {\n  end after 5 kmh\n}\n")
    out = tmp_path / "new" / "check.json"
    done = foresee("check", file, "--json", "--output", out, expect=1)
    assert checked(out.read_text())["ok"] is False
    assert done.stdout == "" and "FS005" in done.stderr
    assert foresee("drivers", "--output", tmp_path / "d.txt").stdout == ""
    assert "pdm" in (tmp_path / "d.txt").read_text()
    foresee("run", file, "--json", "--output", out, expect=1)
    assert checked(out.read_text())["document"] == "error"
    assert sorted(path.name for path in out.parent.iterdir()) == ["check.json"]
