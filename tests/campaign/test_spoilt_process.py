"""A driver that changes the process which runs it, or leaves processes behind: undone, said, and no run suffers."""

from __future__ import annotations

import json
import os
import random
import time
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.campaign.workers.pool import BrokenTask, Task, WorkerPool
from foresee_dsl.drivers.process_state import ProcessState, put_back
from tests.campaign.test_isolation import alive
from tests.support import bad_driver
from tests.support.command import foresee
from tests.support.small_campaign import SMALL

SETERR = "changed how numpy handles floating-point errors (numpy.seterr)"
OPTIONS = (*SMALL, "--jobs", "1", "--risky-points", "1", "--children", "2", "--against", "none", "--quiet", "--json")


def campaign(folder: Path, how: str, expect: int = 0) -> tuple[dict[str, object], str]:
    """Run a campaign into the default folder, which is a relative path; return its JSON, and all that it printed."""
    env, file = bad_driver.install(folder)
    env["COLUMNS"] = "300"
    done = foresee("campaign", file.name, "--driver", f"bad:{how}", *OPTIONS, cwd=folder, env=env, expect=expect)
    return json.loads(done.stdout), done.stderr


@pytest.mark.parametrize(
    ("how", "changed"),
    [
        ("chdir", ["changed the working folder to /"]),
        ("random", ["replaced 2 names (numpy.random.Generator, numpy.random.default_rng)"]),
        ("strict", [SETERR, "turned warnings into errors"]),
        ("forks", ["left processes behind"]),
        ("clones", ["left processes behind"]),
    ],
)
def test_what_a_driver_changes_is_undone_and_said(tmp_path: Path, how: str, changed: list[str]) -> None:
    data, _ = campaign(tmp_path, how)
    runs = data["test_cases"]
    assert isinstance(runs, list) and [run["verdict"] for run in runs] == ["pass", "pass"] and not data["broken"]
    assert [run["notes"]["changed"] for run in runs] == [changed, changed]


def test_a_cleared_environment_is_put_back(tmp_path: Path) -> None:
    data, _ = campaign(tmp_path, "environ")
    first, second = data["test_cases"]  # type: ignore[misc]
    for run in (first, second):
        (phrase,) = run["notes"]["changed"]
        assert phrase.startswith("removed or changed ") and "environment variables (" in phrase


def test_a_run_says_what_its_driver_changed(tmp_path: Path) -> None:
    env, file = bad_driver.install(tmp_path)
    for more in ((), ("--debug",)):
        done = foresee("run", f"{file.name}::w60", "--driver", "bad:chdir", *more, cwd=tmp_path, env=env)
        assert "the driver changed the working folder to /; the change was undone" in " ".join(done.stdout.split())


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="it looks for processes in /proc")
def test_a_driver_that_forks_and_dies_neither_hangs_the_campaign_nor_leaves_a_process(tmp_path: Path) -> None:
    """Half of what it forks leaves its session, so that only its parents know of it."""
    data, _ = campaign(tmp_path, "forks_and_dies", expect=1)
    reasons = {run["reason"] for run in data["test_cases"]}  # type: ignore[attr-defined]
    assert reasons == {"its process died with exit code 3, 3 times"}
    pids = [int(pid) for pid in (tmp_path / "forked").read_text().split()]
    assert len(pids) == 2 * 3 * 50 and not alive(set(pids))


@pytest.mark.parametrize(("how", "name"), [("kill", "SIGKILL"), ("group", "SIGTERM")])
def test_a_signal_from_outside_is_no_crash_and_is_tried_again(tmp_path: Path, how: str, name: str) -> None:
    """No process can tell who sent SIGKILL: it is not booked for good, and the same command tries it again."""
    data, _ = campaign(tmp_path, how, expect=1)
    assert data["test_cases"] == [] and data["seeds"] == {"total": 0, "passed": 0, "failed": 0}
    broken = data["broken"]
    assert isinstance(broken, list) and len(broken) == 2
    assert all(f"was ended by {name}, 3 times" in what and "not count as a crash" in what for what in broken)
    good = (tmp_path / "bad" / "bad.py").read_text().replace(">= 0.5", ">= 1e9")
    (tmp_path / "bad" / "bad.py").write_text(good)
    env = {**os.environ, "PYTHONPATH": str(tmp_path / "bad")}
    done = foresee("campaign", "alone.foresee", "--driver", f"bad:{how}", *OPTIONS, cwd=tmp_path, env=env)
    assert json.loads(done.stdout)["seeds"] == {"total": 2, "passed": 2, "failed": 0}


def spoils_and_raises(file: str) -> str:
    """Change this process as a driver does, and then break; in another process, not."""
    with put_back(0):
        np.seterr(all="raise")
    if not Path(file).exists():
        Path(file).touch()
        raise ValueError("something is broken")
    return "done"


def test_a_step_that_breaks_after_a_driver_changed_its_process_is_run_again_in_another(tmp_path: Path) -> None:
    with WorkerPool(1) as pool:
        pool.add([Task("again", spoils_and_raises, str(tmp_path / "was"))])
        found = {task.name: outcome for task, outcome in pool.results()}
    assert found["again"] == "done"
    with WorkerPool(1, deaths=1) as pool:
        pool.add([Task("never", spoils_and_raises, str(tmp_path / "nowhere" / "was"))])
        ((_, outcome),) = pool.results()
    assert isinstance(outcome, BrokenTask) and outcome.how == "raised"
    assert outcome.reason.endswith(f"(before that, the driver {SETERR})")


def test_the_state_of_a_process_comes_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FORESEE_TEST", "1")
    before = ProcessState.now()
    assert before.put_back() == ()
    draws = random.Random(0).random(), np.random.RandomState(0).random()
    python, numpy = random.getstate(), np.random.get_state()[1]
    with put_back(0) as changed:
        assert (random.random(), np.random.random()) == draws
        (tmp_path / "gone").mkdir()
        os.chdir(tmp_path / "gone")
        (tmp_path / "gone").rmdir()
        os.environ["FORESEE_TEST"] = "2"
        os.environ["FORESEE_NEW"] = "3"  # a new one harms nothing
        time.monotonic, real = None, time.monotonic  # type: ignore[assignment]
    assert changed == [
        "replaced 1 name (time.monotonic)",
        "changed the working folder to one that is deleted",
        "removed or changed 1 environment variable (FORESEE_TEST)",
    ]
    assert Path.cwd() == tmp_path and os.environ["FORESEE_TEST"] == "1" and time.monotonic is real
    assert random.getstate() == python and (np.random.get_state()[1] == numpy).all()
    del os.environ["FORESEE_NEW"]


def test_reading_the_time_zone_again_changes_nothing() -> None:
    with put_back(0) as changed:
        time.tzset()  # as `import pandas` does: `time.tzname` is another tuple with the same names
    assert changed == []
    with put_back(0) as changed:
        time.tzname = ("here", "there")
    assert changed == ["replaced 1 name (time.tzname)"]


def test_the_path_of_libraries_is_put_back_without_a_word(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LD_LIBRARY_PATH", "/before")
    with put_back(0) as changed:
        os.environ["LD_LIBRARY_PATH"] = "/opencv:/before"  # as `import cv2` does
    assert changed == [] and os.environ["LD_LIBRARY_PATH"] == "/before"
