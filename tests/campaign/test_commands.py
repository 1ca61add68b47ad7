"""The commands `campaign`, `plan` and `store` as they are used: real processes, signals, and folders that refuse."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from foresee_dsl.campaign.storage.store import Store
from tests.support import command
from tests.support.small_campaign import SMALL, published, write_project

FORESEE = Path(sys.executable).parent / "foresee"
OPTIONS = (*SMALL, "--driver", "idm", "--before", "3", "--after", "3", "--children", "2")


def foresee(*arguments: object, expect: int = 0) -> subprocess.CompletedProcess[str]:
    return command.foresee(*arguments, env={"COLUMNS": "200"}, expect=expect)


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_project(tmp_path_factory.mktemp("commands") / "project")


def events(log: Path) -> list[dict[str, object]]:
    lines = log.read_text().splitlines() if log.exists() else []
    return [json.loads(line) for line in lines if line.endswith("}")]


def begun(project: Path, out: Path, log: Path) -> subprocess.Popen[str]:
    """Start a campaign and wait until something of it is done."""
    process = subprocess.Popen(
        [FORESEE, "campaign", project, *OPTIONS, "--out", out, "--log-json", log, "--jobs", "2"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 300
    while process.poll() is None and time.monotonic() < deadline and all(e["event"] != "done" for e in events(log)):
        time.sleep(0.02)
    return process


def test_signals_stop_it_and_the_same_command_goes_on(project: Path, tmp_path: Path) -> None:
    out, seen = tmp_path / "out", set[object]()
    for number, code, group in ((signal.SIGINT, 130, True), (signal.SIGTERM, 143, False)):
        log = tmp_path / f"{code}.jsonl"
        process = begun(project, out, log)
        if group:  # Ctrl-C reaches the whole group
            os.killpg(process.pid, number)
        else:
            os.kill(process.pid, number)
        text, _ = process.communicate(timeout=300)
        assert process.returncode == code, text
        assert "Traceback" not in text
        assert "The campaign was interrupted" in text and "same command continues from there" in text
        assert json.loads((out / "campaign.json").read_text())["interrupted"] is True
        done = {e["key"] for e in events(log) if e["event"] == "done"}
        assert done and not done & seen
        seen |= done
        assert not list(out.glob(".work-*"))
        with pytest.raises(ProcessLookupError):  # nothing of its group is left
            for _ in range(50):
                os.killpg(process.pid, 0)
                time.sleep(0.1)
    log = tmp_path / "last.jsonl"
    done = foresee("campaign", project, *OPTIONS, "--out", out, "--log-json", log, "--jobs", 2, "--exit-zero")
    assert published(out)["json"]["interrupted"] is False
    assert (out / "report.html").is_file()
    assert not {e["key"] for e in events(log) if e["event"] == "done"} & seen
    assert events(log)[0]["event"] == "begin" and events(log)[-1]["event"] == "end"
    _look_at_plan_and_store(project, out, tmp_path)


def _look_at_plan_and_store(project: Path, out: Path, tmp_path: Path) -> None:
    """Of a finished campaign there is nothing left to do; another driver's is all still to be done."""
    assert "nothing is left to run" in foresee("plan", project, *OPTIONS, "--out", out).stdout
    plan = json.loads(foresee("plan", project, *OPTIONS, "--out", out, "--format", "json").stdout)
    assert plan["runs"] == {"to_run": 0, "at_most_more": 0} and plan["measured"] is True
    other = json.loads(foresee("plan", project, "--driver", "pdm", "--out", out, "--format", "json").stdout)
    assert other["runs"] == {
        "to_run": 3,
        "at_most_more": 306,
    }  # 36 children, each with three references, also made smaller; and those of the three test cases
    assert foresee("plan", project, *OPTIONS, "--out", out, "--format", "dot").stdout.startswith("digraph campaign {")
    stat = json.loads(foresee("store", "stat", out / "store", "--json").stdout)
    assert sum(stat["kinds"]["child"].values()) == 6 and stat["broken"] == 0
    assert ": 0 results and 0 files" in foresee("store", "gc", out / "store").stdout
    assert foresee("store", "export", out / "store", "--to", tmp_path / "t.csv").stdout.endswith("rows\n")
    merged = foresee("store", "merge", out / "store", "--into", tmp_path / "m").stdout
    assert f"{sum(sum(v.values()) for v in stat['kinds'].values())} new results, 0 already there" in merged


def test_two_campaigns_on_one_store_at_once(project: Path, tmp_path: Path) -> None:
    with Store(tmp_path / "out" / "store"):
        second = foresee("campaign", project, *OPTIONS, "--out", tmp_path / "o2", "--store", tmp_path / "out" / "store",
                         expect=1)  # fmt: skip
        assert (
            f"another campaign (process {os.getpid()} of " in second.stderr
            and "is writing to the store" in second.stderr
        )
        foresee("plan", project, *OPTIONS, "--out", tmp_path / "out")  # looking is allowed


def test_a_folder_that_cannot_be_written(project: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = foresee("campaign", project, *OPTIONS, "--out", tmp_path / "file" / "out", expect=1)
    assert "file" in done.stderr and "Not a directory" in done.stderr


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes where nobody else may")
def test_a_read_only_folder(project: Path, tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    done = foresee("campaign", project, *OPTIONS, "--out", tmp_path / "out", expect=1)
    tmp_path.chmod(0o700)
    assert "Permission denied" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--shard", "3/2"), "the parts of 2 are 1 to 2"),
        (("--executor", "slurm"), "local, dask"),
        (("--scheduler", "tcp://127.0.0.1:1"), "--executor dask"),
    ],
)
def test_wrong_options_are_said(project: Path, arguments: tuple[str, ...], said: str) -> None:
    assert said in " ".join(foresee("campaign", project, *arguments, expect=2).stderr.split())


def test_a_store_that_is_none_is_said(tmp_path: Path) -> None:
    for action in ("stat", "gc"):
        assert "no store in" in foresee("store", action, tmp_path / "nowhere", expect=1).stderr
        assert not (tmp_path / "nowhere").exists()
    assert "is not one of: stat, gc, export, merge" in " ".join(foresee("store", "tidy", expect=2).stderr.split())
