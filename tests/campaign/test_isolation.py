"""Drivers that break in every way, in a real campaign: each is a row with its reason, and all others are done."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from tests.support.command import program
from tests.support.plug_in import install, scenario
from tests.support.small_campaign import SMALL

FORESEE = Path(sys.executable).parent / "foresee"


def environment(plug_in: Path) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(plug_in)}


def run(plug_in: Path, *arguments: object, expect: int = 0) -> dict[str, Any]:
    done = subprocess.run(
        [program(), "campaign", *map(str, arguments), *SMALL, "--driver", "breaker", "--json"],
        capture_output=True,
        text=True,
        check=False,
        env=environment(plug_in),
        timeout=600,
    )
    assert done.returncode == expect, done.stderr
    assert "Traceback" not in done.stderr
    return json.loads(done.stdout)


def test_whatever_a_driver_does_is_one_row_and_the_rest_is_done(tmp_path: Path) -> None:
    plug_in = install(tmp_path)
    file = scenario(tmp_path, 78, 79, 80, 81, 82, 83, 84, 85)
    out = tmp_path / "out"
    options = (file, "--out", out, "--jobs", 2, "--step-deadline", 3, "--memory", 900)
    data = run(plug_in, *options, expect=1)
    found = {case["test_case"].rpartition("::w")[2]: (case["verdict"], case["reason"]) for case in data["test_cases"]}
    assert {found[way][0] for way in ("78", "79", "80")} == {"pass"}
    assert found["81"] == (
        "crash",
        "its process died of SIGSEGV (a crash inside a library), at breaker.py:25 (step), 3 times",
    )
    assert found["82"] == (
        "timeout",
        "timeout: the driver took longer than 3 s of wall time for step 21, at breaker.py:27 (Breaker.step); "
        "--step-deadline allows more",
    )
    assert found["83"] == (
        "crash",
        "the run took more than 900 MB of memory and was ended; --memory allows more",
    )
    assert found["84"] == ("crash", "the driver raised ValueError: no idea, at breaker.py:32 (Breaker.step)")
    died = "its process died of SIGABRT (a library ended the process), at breaker.py:34 (step), 3 times"
    assert found["85"] == ("crash", died)
    assert data["seeds"] == {"total": 8, "passed": 3, "failed": 5}

    log = tmp_path / "again.jsonl"
    again = run(plug_in, *options, "--log-json", log, expect=1)
    assert {**again, "wall_s": 0} == {**data, "wall_s": 0}
    # nothing broken is tried again unless --retry asks for it
    assert not [line for line in log.read_text().splitlines() if json.loads(line)["event"] == "done"]

    # With another driver's code, everything is run again.
    driver = plug_in / "breaker.py"
    driver.write_text(driver.read_text().replace(">= 1.0", ">= 1e9"))
    assert run(plug_in, *options)["seeds"] == {"total": 8, "passed": 8, "failed": 0}


def children_of(pid: int) -> set[int]:
    """All processes below one, by what /proc says."""
    parents = {}
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = status.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if fields[0] != "Z":
            parents[int(status.parent.name)] = int(fields[1])
    found, last = {pid}, set[int]()
    while found != last:
        last = set(found)
        found |= {child for child, parent in parents.items() if parent in found}
    return found - {pid}


def alive(pids: set[int]) -> set[int]:
    left = set()
    for pid in pids:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            continue
        if state != "Z":
            left.add(pid)
    return left


def steps(log: Path) -> int:
    """How many lines about test cases a log has."""
    return log.read_text().count('"stage": "seed"') if log.exists() else 0


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="it looks for processes in /proc")
def test_a_killed_campaign_leaves_no_process_not_even_one_that_hangs_in_c(tmp_path: Path) -> None:
    plug_in = install(tmp_path)
    out, log = tmp_path / "out", tmp_path / "log.jsonl"
    process = subprocess.Popen(
        [FORESEE, "campaign", scenario(tmp_path, 80, 86, 87), *SMALL, "--driver", "breaker", "--out", out, "--jobs",
         "2", "--log-json", log, "--quiet"],
        env=environment(plug_in),
        stdout=subprocess.DEVNULL,
    )  # fmt: skip
    deadline = time.monotonic() + 300
    while process.poll() is None and time.monotonic() < deadline and steps(log) < 5:
        time.sleep(0.05)  # three were planned and two are done: the third hangs
    below = children_of(process.pid)
    assert len(below) >= 3  # the fork server, its tracker, and a worker
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    for _ in range(1200):  # a minute: a loaded machine is slow to end what is killed
        if not alive(below):
            break
        time.sleep(0.05)
    assert not alive(below)
