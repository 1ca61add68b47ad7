"""`foresee show`: what it takes, what it writes, and that a pipe gets plain text."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from foresee_dsl.cli import app
from foresee_dsl.simulate.trace import Trace
from tests.support.hidden_walker import TEXT

CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scenario, a trace of it, a clip and two mutants."""
    folder = tmp_path_factory.mktemp("project")
    (folder / "hidden_walker.foresee").write_text(TEXT)
    _said(
        [
            "run",
            str(folder / "hidden_walker.foresee"),
            "--driver",
            "idm",
            "--exit-zero",
            "--out",
            str(folder / "out" / "traces"),
        ]
    )
    trace = folder / "out" / "traces" / "hidden_walker.npz"
    _said(["clip", str(trace), "--before", "2", "--after", "2", "--out", str(folder)])
    _said(["mutate", str(folder / "hidden_walker_p1.foresee"), "--driver", "idm", "--children", "1", "--exit-zero"])
    return folder


def _said(arguments: list[str], *, code: int = 0, **environment: str) -> str:
    result = CliRunner().invoke(app, arguments, env={"COLUMNS": "80", **environment})
    assert result.exit_code == code, result.output
    return result.output


def test_a_scenario_is_shown_from_its_kept_trace(project: Path) -> None:
    file = str(project / "hidden_walker.foresee")
    text = _said(["show", file, "--driver", "idm", "--campaign", str(project / "out")])
    assert f"from {project / 'out' / 'traces' / 'hidden_walker.npz'}" in text
    assert "ego speed" in text
    assert "█" in text
    assert f"foresee run {file} --driver idm" in text
    assert not CONTROL.search(text)
    fresh = _said(["show", file, "--driver", "idm", "--campaign", str(project / "out"), "--fresh"])
    assert fresh == text.replace(f", from {project / 'out' / 'traces' / 'hidden_walker.npz'}", "")


def test_a_trace_is_shown_without_its_case_being_named(project: Path) -> None:
    text = _said(["show", str(project / "out" / "traces" / "hidden_walker.npz")])
    assert text.startswith(str(project / "hidden_walker.foresee"))


def test_a_mutant_is_shown_beside_its_parent(project: Path, tmp_path: Path) -> None:
    (mutant,) = project.glob("hidden_walker_p1_m*.foresee")
    pytest.importorskip("resvg_py", reason="resvg-py is not installed")
    svg, png = tmp_path / "strip.svg", tmp_path / "strip.png"
    text = _said(["show", str(mutant), "--svg", str(svg), "--png", str(png), "--up", "north"])
    assert "Its parent" in text
    assert "in its parent" in text
    assert re.search(r"from \d+\.\d\d s \w+ is ", text)
    assert svg.read_text().startswith("<svg")
    assert png.read_bytes().startswith(b"\x89PNG")
    assert max(len(line) for line in text.splitlines() if line.startswith(("┌", "│", "└"))) <= 80


def test_a_forced_picture_is_sent_in_the_terminal_s_words(project: Path) -> None:
    file = str(project / "hidden_walker.foresee")
    text = _said(["show", file, "--driver", "idm", "--campaign", str(project / "out"), "--picture", "sixel"])
    assert "\x1bPq" in text
    assert "█▲" not in text


def test_a_name_that_is_nothing_is_explained(project: Path) -> None:
    result = CliRunner().invoke(app, ["show", "no_such_finding", "--campaign", str(project / "nothing")])
    assert result.exit_code != 0
    assert "no_such_finding" in str(result.exception)


def test_a_trace_of_another_meaning_is_refused(project: Path, tmp_path: Path) -> None:
    file = tmp_path / "hidden_walker.foresee"
    file.write_text(TEXT)
    _said(["run", str(file), "--driver", "idm", "--exit-zero", "--out", str(tmp_path)])
    file.write_text(TEXT.replace("1.8 m/s", "1.7 m/s"))
    result = CliRunner().invoke(app, ["show", str(tmp_path / "hidden_walker.npz")])
    assert "means something else now" in str(result.exception)


def test_a_trace_that_was_tampered_with_is_harmless(project: Path, tmp_path: Path) -> None:
    trace = Trace.load(project / "out" / "traces" / "hidden_walker.npz")
    nasty = "\x1b[2J\u202e<script>" + "x" * 10_000
    file = tmp_path / "reason.npz"
    replace(trace, meta={**trace.meta, "reason": nasty, "driver_version": nasty}).save(file)
    text = _said(["show", str(file)])
    assert not CONTROL.search(text)
    assert len(text) < 20_000
    actors = tuple(replace(actor, id=nasty) for actor in trace.actors)
    replace(trace, actors=actors).save(file)
    result = CliRunner().invoke(app, ["show", str(file)])
    assert "is damaged" in str(result.exception)
