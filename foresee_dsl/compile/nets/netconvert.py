"""Starts SUMO's netconvert, the only program that the compiler runs."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from foresee_dsl.errors import CompileError

TIMEOUT_S = 60.0
"""Ours: a CARLA town takes 0.2 to 3 s on a slow core; what takes a minute hangs."""

_HEADER = re.compile(rb"\A(\s*<\?xml[^>]*\?>)?\s*(?:<!--.*?-->\s*)+", re.DOTALL)


@cache
def sumo_home() -> Path:
    """Return the folder of the installed `eclipse-sumo` wheel (its `bin/` and `data/`).

    The wheel's package is located, not imported: importing it would change this process's environment.
    """
    spec = find_spec("sumo")
    if spec is None or spec.origin is None:
        raise CompileError("netconvert is missing: install the package 'eclipse-sumo' (pip install eclipse-sumo)")
    return Path(spec.origin).parent


@cache
def tool_version() -> str:
    """Return the version of the installed netconvert, such as `1.28.0`."""
    from importlib import metadata  # takes long to import, as `subprocess` does

    try:
        return metadata.version("eclipse-sumo")
    except metadata.PackageNotFoundError as err:
        raise CompileError("netconvert is missing: install the package 'eclipse-sumo'") from err


def run_netconvert(arguments: Sequence[str], folder: Path) -> None:
    """Run netconvert in a folder, in which relative file names in `arguments` are meant.

    A `CompileError` where it is missing, fails (the message holds what it printed) or takes over 60 s.
    """
    import shutil
    import subprocess

    home = sumo_home()
    program = shutil.which("netconvert", path=str(home / "bin"))
    if program is None:
        raise CompileError(f"netconvert is not in {home / 'bin'}: reinstall the package 'eclipse-sumo'")
    environment = {**os.environ, "SUMO_HOME": str(home)}
    try:
        done = subprocess.run(  # noqa: S603 - our own program, no shell
            [program, *arguments],
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired as err:
        raise CompileError(f"netconvert did not finish within {TIMEOUT_S:.0f} s") from err
    except OSError as err:
        raise CompileError(f"netconvert cannot be started: {err}") from err
    if done.returncode != 0:
        raise CompileError(f"netconvert refused the network: {_complaint(done.stderr, done.returncode)}")


def without_header(net: bytes) -> bytes:
    """Return a net file's text without the comments in front of its root.

    They hold the time and the paths of the call; the rest of netconvert's output is the same for the same input.
    """
    return _HEADER.sub(lambda m: (m.group(1) or b"") + b"\n", net, count=1)


def _complaint(stderr: bytes, code: int) -> str:
    """netconvert's own words, warnings left out where there are errors."""
    lines = [line.strip() for line in stderr.decode("utf-8", "replace").splitlines() if line.strip()]
    errors = [line.removeprefix("Error:").strip() for line in lines if not line.startswith(("Warning:", "Quitting"))]
    return " ".join(errors or lines)[:2000] or f"it ended with code {code} and said nothing"
