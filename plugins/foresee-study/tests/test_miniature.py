"""A whole small study: two test cases, one repetition, rq1 to rq3, killed on the way; its tables are golden files."""

from __future__ import annotations

import contextlib
import csv
import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest
from foresee_study.folder import StudyFolder
from foresee_study.halves import Half
from foresee_study.measured import Counted
from foresee_study.report import write_report
from foresee_study.results import Results

from tests.support.command import program
from tests.support.goldens import Golden

FORESEE = Path(sys.executable).parent / "foresee"
GOLDEN = Path(__file__).parent / "cases"
OPTIONS = ("--half", "all", "--repetitions", "1", "--drivers", "idm", "--rankers", "foresee,proximity,random,nobody",
           "--children", "2", "--against", "pdm", "--jobs", "1", "--quiet")  # fmt: skip


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, str]:
    """The folder of a study whose process was killed once and that was then asked again, and what that printed."""
    folder = tmp_path_factory.mktemp("study")
    out = folder / "out"
    (folder / "beside.foresee").write_bytes((GOLDEN / "beside.foresee").read_bytes())
    command = [FORESEE, "study", "rq1,rq2,rq3", folder / "beside.foresee", "--out", out, *OPTIONS]
    began = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while _stored(out / "store" / "runs.sqlite") < 20:
        assert began.poll() is None, "it ended before it could be killed"
        time.sleep(0.02)
    os.kill(began.pid, signal.SIGKILL)
    began.wait()
    before = _stored(out / "store" / "runs.sqlite")
    assert not (out / "tables").exists()
    done = subprocess.run([program(), *command[1:], "--json"], check=True, capture_output=True, text=True)
    assert _stored(out / "store" / "runs.sqlite") > before
    return out, done.stdout, done.stderr


def _stored(database: Path) -> int:
    with (
        contextlib.suppress(sqlite3.Error),
        contextlib.closing(sqlite3.connect(f"{database.as_uri()}?mode=ro", uri=True)) as found,
    ):
        return int(found.execute("SELECT count(*) FROM runs").fetchone()[0])
    return 0


def test_the_tables_of_a_study_that_was_killed_are_the_golden_ones(
    study: tuple[Path, str, str], golden: Golden
) -> None:
    tables = {file.name: file for file in (study[0] / "tables").iterdir() if not file.stem.endswith("_wall")}
    shown = [name for name in tables if name.endswith(".csv")] + ["rq2.md", "rq1.tex"]
    for name in sorted(shown):
        golden(tables[name].read_text(), GOLDEN / "tables" / name)
    assert {file.name for file in (GOLDEN / "tables").iterdir()} == set(shown)


def test_json_has_what_the_tables_have(study: tuple[Path, str, str]) -> None:
    out, printed, said = study
    data = json.loads(printed)
    assert data["document"] == "study"
    names = {table["name"] for table in data["tables"]}
    assert names == {file.stem for file in (out / "tables").iterdir()}
    assert "ranker nobody: left out" in said
    assert "rq3: 0:0" in said  # its runs are those of rq1 and rq2


def test_two_test_cases_are_not_tested_and_it_says_why(study: tuple[Path, str, str]) -> None:
    tables = study[0] / "tables"
    assert "2 test cases are too few for a test" in (tables / "rq2_statistics.md").read_text()
    with (tables / "rq2_statistics.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert rows and {row["p, signed rank"] + row["p, permutation"] for row in rows} == {""}
    assert {row["units"] for row in rows} == {"2"}


def test_everything_is_made_again_from_what_is_kept(study: tuple[Path, str, str], tmp_path: Path) -> None:
    folder = StudyFolder(study[0])
    kept = (*folder.tables.iterdir(), *folder.figures.iterdir(), folder.page)
    before = {file: file.read_bytes() for file in kept}
    assert {file.suffix for file in before} == {".csv", ".md", ".tex", ".svg", ".pdf"}
    write_report(folder, page=tmp_path / "pages" / "results.md")
    assert {file: file.read_bytes() for file in kept} == before
    page = (tmp_path / "pages" / "results.md").read_text()
    assert "(results/rq3_curves.svg)" in page and (tmp_path / "pages" / "results" / "rq3_curves.svg").is_file()
    assert "no number in it is typed by hand" in page


def test_fewer_points_and_halves_are_parts_of_what_was_run(study: tuple[Path, str, str]) -> None:
    folder = StudyFolder(study[0])
    every = Results.of(folder)
    four, one = (every.of_campaign("idm", "random", points=n)[0] for n in (4, 1))
    assert one.clips == len(one.usable) < four.clips
    assert one.count(Counted.COLLISIONS) <= four.count(Counted.COLLISIONS)
    halves = [Results.of(folder, half).of_campaign("idm", "random")[0] for half in (Half.EVEN, Half.ODD)]
    assert sum(len(half.cases) for half in halves) == len(four.cases)
