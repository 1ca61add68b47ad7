"""What surrounds a campaign changes nothing of it: locale, time zone, hash seed, umask, home, and the folder's name."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Any

from tests.support.command import FORESEE, program
from tests.support.small_campaign import SMALL, published, write_project

OPTIONS = (*SMALL, "--driver", "idm", "--against", "none", "--first", "1", "--before", "3", "--after", "3",
           "--risky-points", "1", "--children", "3", "--jobs", "2", "--quiet", "--exit-zero")  # fmt: skip


def run_in(folder: Path, foresee: Path, *, umask: int = -1, **variables: str) -> dict[str, Any]:
    """Run the small campaign in a folder; return what it wrote."""
    write_project(folder)
    command = [foresee, "campaign", "crosser.foresee", *OPTIONS]
    environment = {**os.environ, **variables}
    done = subprocess.run(
        command, cwd=folder, env=environment, umask=umask, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return published(folder / "out")


def test_other_surroundings_give_the_same_campaign(tmp_path: Path) -> None:
    usual = run_in(tmp_path / "usual", program())
    other = run_in(
        tmp_path / "with spaces, ä and 道", FORESEE, umask=0o077,
        LC_ALL="C", LANG="C", TZ="Asia/Kathmandu", PYTHONHASHSEED="4711", HOME="/nonexistent/home",
    )  # fmt: skip
    assert usual["json"]["children"] == 3 and usual["files"]
    assert other == usual
