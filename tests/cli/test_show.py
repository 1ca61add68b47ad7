"""`foresee show`: what it takes, what it writes, and that a pipe gets plain text."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from foresee_dsl.cli import app
from foresee_dsl.report.show import film
from foresee_dsl.simulate.results.criticality import CriticalityMeasure
from foresee_dsl.simulate.results.near_misses import near_misses
from foresee_dsl.simulate.trace import SPEED, Trace, X
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


def test_a_finding_without_a_mutation_is_driven_as_in_its_campaign(tmp_path: Path) -> None:
    file, out = str(tmp_path / "hidden_walker.foresee"), str(tmp_path / "out")
    Path(file).write_text(TEXT.replace("< 32 m", "< 28 m"))
    options = ["--driver", "idm", "--seed", "3", "--children", "0", "--against", "none", "--jobs", "1"]
    _said(["campaign", file, *options, "--quiet", "--exit-zero", "--out", out])
    for finding in ("1", "hidden_walker"):
        text = _said(["show", finding, "--campaign", out])
        assert "\nF2 collision with walker" in text and "\ndriver idm 1, seed 3, from " in text
    assert "\ndriver idm 1, seed 3\n" in _said(["show", "1", "--campaign", out, "--fresh"])
    assert "\ndriver idm 1, seed 4\n" in _said(["show", "1", "--campaign", out, "--seed", "4"])
    review = _said(["review", "1", "--campaign", out])
    assert f"    foresee show {file} --driver idm --seed 3\n" in review
    assert f"    foresee run {file} --driver idm --seed 3\n" in review
    trace = str(tmp_path / "out" / "traces" / "hidden_walker.npz")
    clip = _said(["clip", trace, "--before", "2", "--after", "2", "--out", str(tmp_path)])
    assert "\n  a campaign does not use this clip: its own run without mutation ends with F2\n" in clip
    _said(["view", "1", "--campaign", out, "--output", str(tmp_path / "view.html")])
    assert "driver idm · seed 3" in (tmp_path / "view.html").read_text(encoding="utf-8")


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
    assert "it has changed" in str(result.exception)


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


@pytest.fixture(scope="module")
def written(project: Path) -> Path:
    """The files that `show` writes of a run with a contact."""
    folder = project / "written"
    options = [f"--{name}={folder / name}.{end}" for name, end in
               (("gif", "gif"), ("criticality", "csv"), ("csv", "csv"))]  # fmt: skip
    file = str(project / "hidden_walker.foresee")
    _said(["show", file, "--driver", "idm", "--campaign", str(project / "out"), *options])
    _said(["show", file, "--driver", "idm", "--criticality", str(folder / "criticality.json")])
    return folder


def test_the_criticality_of_each_step_is_that_of_the_run(project: Path, written: Path) -> None:
    trace = Trace.load(project / "out" / "traces" / "hidden_walker.npz")
    with (written / "criticality.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["time_s"]) for row in rows] == pytest.approx(trace.time_s.tolist())
    assert {row["with"] for row in rows} == {"walker"}
    values = {name: [float(row[name]) for row in rows if row[name]] for name in rows[0] if name != "with"}
    worst = near_misses(trace)
    assert min(values["distance_m"]) == pytest.approx(worst.distance_m and worst.distance_m.value, abs=1e-4)
    assert min(values["pet_s"]) == pytest.approx(worst.pet_s and worst.pet_s.value)
    for measure in (
        CriticalityMeasure.TTC,
        CriticalityMeasure.TTB,
        CriticalityMeasure.TTS,
        CriticalityMeasure.DELTA_V,
        CriticalityMeasure.RISK,
    ):
        expected = getattr(worst, measure.value).value
        assert max(measure.sign * value for value in values[measure.value]) == pytest.approx(
            measure.sign * expected, abs=1e-4
        )
    steps = json.loads((written / "criticality.json").read_text())["steps"]
    assert [step["ttc_s"] for step in steps] == [float(row["ttc_s"]) if row["ttc_s"] else None for row in rows]


def test_the_table_of_states_is_that_of_the_trace(project: Path, written: Path) -> None:
    trace = Trace.load(project / "out" / "traces" / "hidden_walker.npz")
    with (written / "csv.csv").open() as file:
        rows = list(csv.DictReader(file))
    present = ~np.isnan(trace.states[:, :, X])
    assert len(rows) == present.sum()
    ego = [float(row["speed_mps"]) for row in rows if row["actor"] == "ego"]
    assert ego == pytest.approx(trace.states[:, 0, SPEED].tolist(), abs=1e-4)


def test_the_film_lasts_as_long_as_what_it_shows(project: Path, written: Path) -> None:
    pictures = pytest.importorskip("PIL.Image", reason="Pillow is not installed")
    trace = Trace.load(project / "out" / "traces" / "hidden_walker.npz")
    shown_ms, colours = [], set()
    with pictures.open(written / "gif.gif") as image:
        for frame in range(image.n_frames):
            image.seek(frame)
            shown_ms.append(image.info["duration"])
            colours.add(image.convert("RGB").tobytes())
    nearest = near_misses(trace).distance_m
    assert nearest is not None
    first_s, last_s = nearest.time_s - film.BEFORE_S, min(nearest.time_s + film.AFTER_S, trace.duration_s)
    filmed_s = last_s - max(first_s, 0.0)
    assert sum(shown_ms) / 1000 == pytest.approx(filmed_s + film.HOLD_S, abs=film.EVERY_S)
    assert len(colours) > 10  # the actors move


def test_a_file_that_show_cannot_write_is_explained(project: Path, tmp_path: Path) -> None:
    base = ["show", str(project / "hidden_walker.foresee"), "--driver", "idm", "--campaign", str(project / "out")]
    for option, words in (
        (["--criticality", str(tmp_path / "a.txt")], "must end in .csv or .json"),
        (["--criticality", str(tmp_path / "a.csv"), "--actor", "nobody"], "has no actor 'nobody' beside the ego"),
        (["--csv", str(tmp_path / "a.json")], "must end in .csv"),
        (["--gif", str(tmp_path / "a.gif"), "--from", "900"], "there is no moment from 900 s"),
    ):
        result = CliRunner().invoke(app, base + option)
        assert result.exit_code != 0
        assert words in str(result.exception)
    assert not list(tmp_path.iterdir())
