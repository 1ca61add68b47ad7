"""The command line where the plug-ins of the repository are not installed."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

from conftest import ROOT


def installed_without(folder: Path) -> Path:
    """Link into a folder everything that is installed here but the plug-ins of the repository; return the folder."""
    for place in Path(sysconfig.get_paths()["purelib"]).iterdir():
        if place.name.startswith("foresee_dsl") or not place.name.startswith("foresee_"):
            (folder / place.name).symlink_to(place)
    return folder


def foresee_of(site: Path, *words: str | Path, code: int) -> subprocess.CompletedProcess[str]:
    """Run the command line with what is installed in a folder; check its exit code."""
    start = f"import sys; sys.path += [{str(ROOT)!r}, {str(site)!r}]; from foresee_dsl.cli import main; main()"
    environment = {**os.environ, "COLUMNS": "200", "NO_COLOR": "1"}
    command = [sys.executable, "-S", "-c", start, *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == code, done.stdout + done.stderr
    return done
