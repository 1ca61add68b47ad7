"""The tutorial notebook is run as it is, and what `import foresee_dsl as fs` offers is shown in it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import foresee_dsl as fs
from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.errors import DriverError
from foresee_dsl.language.project.loading import load_test_case
from tests.support.first_project import foresee

nbformat = pytest.importorskip("nbformat", reason="nbformat reads the notebook")
nbclient = pytest.importorskip("nbclient", reason="nbclient runs the notebook")
pytest.importorskip("ipykernel", reason="ipykernel is the kernel in which the notebook runs")


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("notebook") / "crossroads"
    foresee("init", folder)
    return folder


@pytest.mark.filterwarnings("ignore")  # of the packages that run notebooks
def test_the_tutorial_runs_and_its_records_show_themselves(root: Path, project: Path) -> None:
    book = nbformat.read(root / "docs/examples/tutorial.ipynb", as_version=4)
    assert not any(cell.get("outputs") for cell in book.cells), "the notebook is kept without outputs"
    nbclient.NotebookClient(
        book, timeout=300, kernel_name="python3", resources={"metadata": {"path": project}}
    ).execute()
    shown = [output for cell in book.cells for output in cell.get("outputs", ()) if output.output_type != "stream"]
    pages = [output.data["text/html"] for output in shown if "text/html" in output.get("data", ())]
    case, run, finding, playback, own = pages
    assert "main_street.foresee::steps_out" in case and "<svg" in case
    assert "pass" in run and "0.71 m" in run and "<svg" in run
    assert "the driver&#39;s fault" in finding and "steps onto the road" in finding and "<svg" in finding
    assert playback.startswith("<iframe srcdoc=") and "&lt;script" in playback
    assert "F2" in own or "pass" in own


def test_the_package_offers_the_same_as_the_commands(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(project)
    address = "scenarios/main_street.foresee::steps_out"
    (case,) = fs.load(address)
    assert fs.load([case, "scenarios/main_street.foresee"])[1].id.endswith("car_just_after")
    theirs = run_test_case(load_test_case(address), "idm", 3)
    assert (
        fs.run(address, "idm", seed=3).trace.digest == fs.run(case, "idm", seed=3).trace.digest == theirs.trace.digest
    )
    (record,) = fs.assess(address, "idm", jobs=1, seed=3)
    assert (record.digest, record.verdict) == (theirs.trace.digest, fs.Verdict.PASS)
    # A Python prompt shows what a record is called and how a run ended, not its hundreds of kilobytes of content.
    assert repr(case).startswith(f"TestCase(id={address!r}, meaning=") and len(repr(case)) < 400
    assert repr(theirs).startswith("RunResult(verdict=<Verdict.PASS") and "trace=" not in repr(theirs)
    with pytest.raises(AttributeError, match="no attribute 'walk'"):
        fs.walk  # type: ignore[attr-defined]  # noqa: B018


@pytest.mark.parametrize("driver", [None, len, object, 5])
def test_what_is_no_driver_is_refused(project: Path, driver: Any) -> None:
    with pytest.raises(DriverError, match=r"is not a driver: it has no .*step; a driver has the texts `name` and"):
        fs.run(str(project / "scenarios" / "main_street.foresee::steps_out"), driver)


def test_the_package_is_imported_quickly_and_a_script_needs_no_guard(project: Path) -> None:
    script = project / "script.py"
    script.write_text(
        "import sys\n"
        "import foresee_dsl as fs\n"
        "print(len([name for name in sys.modules if name.startswith('foresee_dsl')]))\n"
        "print(fs.campaign('scenarios/main_street.foresee::steps_out', 'idm', out='out/script', children=1,"
        " before_s=4.0, after_s=4.0, risky_points=1, jobs=2).seeds[0].verdict)\n",
        encoding="utf-8",
    )
    done = subprocess.run([sys.executable, script], cwd=project, capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["1", "pass"], done.stderr
