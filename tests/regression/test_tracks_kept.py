"""A test case with recorded tracks takes its tracks file along: into a suite, into a folder above it, into a diff."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from foresee_dsl.campaign.regression.keeping import prune
from foresee_dsl.cli import app
from foresee_dsl.errors import InputError
from foresee_dsl.language.diff.addresses import compare_addresses
from foresee_dsl.language.project.loading import load_test_case
from tests.support.recorded import samples, write_case


def test_a_kept_test_case_has_its_tracks_beside_it(tmp_path: Path) -> None:
    source = tmp_path / "work"
    source.mkdir()
    file, suite = write_case(source), tmp_path / "suite"
    result = CliRunner().invoke(app, ["keep", str(file), "--to", str(suite)])
    assert result.exit_code == 0, result.output
    (kept,) = suite.glob("*.foresee")
    copy = suite / "parents" / "cut.tracks.csv"
    assert load_test_case(kept, allow_outside=False).tracks == copy
    assert load_test_case(kept).meaning == load_test_case(file).meaning
    assert prune(suite) == ()
    kept.unlink()
    assert prune(suite) == (copy,)


def test_a_file_of_tracks_outside_the_project_is_refused(tmp_path: Path) -> None:
    (tmp_path / "inside").mkdir()
    (tmp_path / "inside" / "pyproject.toml").write_text("")
    write_case(tmp_path)
    inside = tmp_path / "inside" / "cut.foresee"
    text = (tmp_path / "cut.foresee").read_text(encoding="utf-8").replace('"cut.tracks.csv"', '"../cut.tracks.csv"')
    inside.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as raised:
        load_test_case(inside, allow_outside=False)
    assert [d.code for d in raised.value.diagnostics] == ["FS138"]
    assert load_test_case(inside).tracks == tmp_path / "cut.tracks.csv"


def test_an_extension_in_another_folder_has_the_same_tracks(tmp_path: Path) -> None:
    write_case(tmp_path)
    (tmp_path / "wet").mkdir()
    wet = tmp_path / "wet" / "wet.foresee"
    wet.write_text('foresee 1\n\nscenario wet extends "../cut.foresee" {\n  add weather wetness 0.5\n}\n')
    assert load_test_case(wet).tracks == tmp_path / "cut.tracks.csv"


def test_a_diff_names_other_tracks(tmp_path: Path) -> None:
    files = []
    for name, rows in (("old", samples()), ("new", samples()[:-1])):
        (tmp_path / name).mkdir()
        files.append(str(write_case(tmp_path / name, rows=rows)))
    (change,) = compare_addresses(*files).changes
    assert (change.path, change.note) == ("tracks", "other content")
    assert compare_addresses(files[0], files[0]).changes == ()
