"""Expected results: what a file says of a driver, beside what it means."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest

from foresee_dsl.errors import InputError
from foresee_dsl.language import model as m
from foresee_dsl.language.checked_files import check_paths
from foresee_dsl.language.diff.compare import diff_models
from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.model.scenario import FailureName
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.loading import load_test_case
from tests.support.repin_project import Repository
from tests.support.small_campaign import write_project

LINES = (
    "expected pdm passes",
    "expected idm fails",
    "expected pdm fails F2 with other",
    'expected "pdm 2" fails stuck',
    'expected "external:python3 mine.py" in case after fails F4 with other',
)


def with_line(file: Path, line: str) -> Path:
    text = file.read_text()
    file.write_text(text.replace("  param gap", f"  {line}\n  param gap").replace("  change", f"  {line}\n  change"))
    return file


@pytest.mark.parametrize("line", LINES)
def test_a_scenario_means_the_same_with_it(tmp_path: Path, line: str) -> None:
    file = write_project(tmp_path)
    before = load_test_case(f"{file}::after")
    after = load_test_case(f"{with_line(file, line)}::after")
    assert after.scenario.first(m.Expected) is not None
    assert pin_of(after) == pin_of(before)
    assert [d for d in check_paths([str(file)]).diagnostics if d.severity == "error"] == []


def test_clips_and_mutants_mean_the_same_with_it(tmp_path: Path) -> None:
    project = Repository(tmp_path, git=False)
    before = [pin_of(load_test_case(file)) for file in (project.clip, *project.mutants)]
    text = project.clip.read_text()
    project.clip.write_text(text.replace("  goal", "  expected pdm passes\n  goal"))
    with_line(project.mutants[0], "expected pdm fails F5 with lead")
    assert [pin_of(load_test_case(file)) for file in (project.clip, *project.mutants)] == before
    assert diff_models(parse(text, "a").model, parse(project.clip.read_text(), "a").model) == ()


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("expected pdm passes\n  expected pdm fails", "FS013"),
        ("expected pdm in case laterr passes", "FS100"),
        ("expected pdm passes F2", "FS003"),
        ("expected pdm fails F9", "FS012"),
        ("expected pdm fails crash", "FS012"),
    ],
)
def test_mistakes(tmp_path: Path, line: str, code: str) -> None:
    file = with_line(write_project(tmp_path), line)
    with pytest.raises(InputError) as error:
        load_test_case(f"{file}::after")
    assert [found.code for found in error.value.diagnostics] == [code]


def test_the_help_for_an_unknown_failure_names_every_failure(tmp_path: Path) -> None:
    file = with_line(write_project(tmp_path), "expected pdm fails F9")
    with pytest.raises(InputError) as error:
        load_test_case(f"{file}::after")
    assert set(get_args(FailureName)) <= set(re.findall(r"\w+", error.value.diagnostics[0].help))


def test_an_extension_has_its_own(tmp_path: Path) -> None:
    with_line(write_project(tmp_path), "expected pdm passes")
    file = tmp_path / "slower.foresee"
    file.write_text(
        'foresee 1\n\nscenario slower extends "crosser.foresee" {\n'
        "  expected idm fails\n  change param.gap: 1.5 s => 1.4 s\n}\n"
    )
    found = load_test_case(f"{file}::after").scenario.all(m.Expected)
    assert [(item.driver, item.outcome) for item in found] == [("idm", "fails")]
