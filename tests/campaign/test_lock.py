"""Two commands at once on one folder of results: the second is refused, and says which process has it."""

from __future__ import annotations

import fcntl
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from foresee_dsl.campaign.storage.lock import only_writer
from foresee_dsl.campaign.storage.store import Store, StoreError
from foresee_dsl.errors import ForeseeError
from tests.support.command import foresee
from tests.support.small_campaign import write_project

HOLDER = r"process \d+( of \S+)? on \S+, since \d{4}-\d\d-\d\d \d\d:\d\d:\d\d"
_HOLD = """
import sys, time
from pathlib import Path
from foresee_dsl.campaign.storage.lock import only_writer
with only_writer(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(600)
"""


def held(folder: Path) -> subprocess.Popen[str]:
    """Return a process that holds the lock of a folder."""
    process = subprocess.Popen([sys.executable, "-c", _HOLD, folder], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "held\n"
    return process


def test_a_second_campaign_into_one_folder_is_refused_before_it_runs_anything(tmp_path: Path) -> None:
    project, out = write_project(tmp_path / "project"), tmp_path / "out"
    process = held(out)
    try:
        for command in (("campaign",), ("fuzz", "--cycles", "1", "--mutations", "1")):
            words = (command[0], project, *command[1:], "--driver", "idm", "--out", out, "--store", tmp_path / "mine")
            refused = foresee(*words, expect=1)
            said = " ".join(refused.stderr.split())
            assert f"process {process.pid}" in said and "since 2" in said and "--out" in said
        assert {file.name for file in out.iterdir()} == {".lock"} and not (tmp_path / "mine").exists()
    finally:
        os.kill(process.pid, signal.SIGKILL)  # a holder that is dead holds nothing, whatever its file says
        process.communicate()
    assert f"process {process.pid}" in (out / ".lock").read_text()
    options = ("--before", "3", "--after", "3", "--children", "1", "--exit-zero", "--quiet")
    foresee("campaign", project, "--first", "1", "--driver", "idm", "--out", out, *options)
    assert json.loads((out / "campaign.json").read_text())["interrupted"] is False
    assert (out / ".lock").read_text() == "", "nobody has it any more"


def test_one_process_may_ask_again_and_lets_go_also_when_something_raises(tmp_path: Path) -> None:
    def locked() -> bool:
        with (tmp_path / "out" / ".lock").open() as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                return True
            return False

    with pytest.raises(ValueError, match="broken"), only_writer(tmp_path / "out"):
        with only_writer(tmp_path / "project" / ".." / "out"):
            assert locked()
        assert locked()
        raise ValueError("broken")
    assert not locked()


def test_others_may_lock_a_shared_folder_as_far_as_the_umask_allows(tmp_path: Path) -> None:
    before = os.umask(0o002)
    try:
        with only_writer(tmp_path):
            assert (tmp_path / ".lock").stat().st_mode & 0o777 == 0o664
    finally:
        os.umask(before)


def test_a_fork_does_not_keep_the_lock(tmp_path: Path) -> None:
    """A worker of a single run is a fork, and has all descriptors of the process that it was made of."""
    with Store(tmp_path):
        ours, theirs = os.pipe()
        child = os.fork()
        if not child:
            os.close(theirs)
            os.read(ours, 1)
            os._exit(0)
    try:
        with Store(tmp_path), pytest.raises(StoreError, match=HOLDER):
            Store(tmp_path)
    finally:
        os.write(theirs, b"x")
        os.waitpid(child, 0)


def test_a_file_system_without_locks_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_locks(*_: object) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(fcntl, "flock", no_locks)
    with pytest.raises(ForeseeError, match=r"Operation not supported.*--out"), only_writer(tmp_path):
        pass
