"""The limit of memory counts what a worker starts, and nothing that was started outlives it."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

from foresee_dsl.campaign.workers.pool import BrokenTask, Task, WorkerPool
from foresee_dsl.campaign.workers.processes import started_by

GROWS = "import os, time; x = bytearray(400_000_000); print(os.getpid(), flush=True); time.sleep(60)"
LEAVES = "import subprocess, sys; subprocess.Popen([sys.executable, '-c', sys.argv[1]], start_new_session=True)"


def with_a_program(file: str) -> None:
    """Start a program that starts another one, which leaves the group and takes memory; then wait."""
    with Path(file).open("w", encoding="utf-8") as out:
        subprocess.run([sys.executable, "-c", LEAVES, GROWS], stdout=out, check=True)
    time.sleep(60)


def test_what_a_program_starts_counts_and_ends_with_it(tmp_path: Path) -> None:
    file = tmp_path / "pid"
    with WorkerPool(1, memory_mb=350) as pool:
        pool.add([Task("grows", with_a_program, str(file))])
        ((_, outcome),) = pool.results()
    assert isinstance(outcome, BrokenTask) and outcome.how == "memory"
    assert "took more than 350 MB of memory" in outcome.reason
    left = file.read_text(encoding="utf-8").split()
    until = time.monotonic() + 20
    while left and _runs(int(left[0])) and time.monotonic() < until:
        time.sleep(0.05)
    assert not (left and _runs(int(left[0])))


def test_children_of_children_are_seen() -> None:
    code = "import subprocess, sys; subprocess.run(['sleep', '60'])"
    with subprocess.Popen([sys.executable, "-c", code]) as process:
        until = time.monotonic() + 20
        while len(started_by(process.pid)) < 1 and time.monotonic() < until:
            time.sleep(0.05)
        children = started_by(process.pid)
        assert len(children) == 1 and set(children) <= set(started_by(os.getpid()))
        for pid in (*children, process.pid):
            os.kill(pid, 9)


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
