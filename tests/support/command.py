"""The command line in processes of their own that begin with everything imported: each is a fork of one server.

Starting Python and importing SUMO, numba and pydantic costs 0.5 to 1.5 s of a core for each command, and starting the
fork server of a campaign's workers 2 s; the suite calls hundreds. How the real program starts is tested by
`tests/test_speed.py`, `tests/test_wheel.py`, `tests/campaign/test_chaos.py`, and wherever processes get signals.
"""

from __future__ import annotations

import atexit
import multiprocessing
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from tests.support import quick_client
from tests.support.quick_start import FORESEE

__all__ = [
    "FORESEE",
    "SERVER",
    "foresee",
    "fork_interpreters",
    "program",
    "pytest_program",
    "quick_path",
    "start_server",
]

ROOT = Path(__file__).parents[2]
SERVER = "FORESEE_TESTS_SERVER"
"""Environment variable with the address of a server that another process has started."""


def foresee(
    *arguments: object,
    cwd: Path | None = None,
    env: Mapping[str, str] | None = None,
    expect: int | None = 0,
    fresh: bool = False,
) -> subprocess.CompletedProcess[str]:
    """Run a command, without colours; `env` is added to this process's environment, `expect` is its exit code.

    Args:
        fresh: the new interpreters in which the command repeats findings are real ones, each with a seed of its own for
            the hashes of strings; else they are forks of the server too.
    """
    words = [str(argument) for argument in arguments]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        request = {
            "words": words,
            "cwd": str(cwd or Path.cwd()),
            "env": {**os.environ, "NO_COLOR": "1", **(env or {})},
            "python": "python-fresh" if fresh else "python",
        }
        with Path(os.devnull).open() as nothing, (folder / "out").open("w") as out, (folder / "err").open("w") as err:
            code = quick_client.ask(_address(), request, {0: nothing.fileno(), 1: out.fileno(), 2: err.fileno()})
        texts = [(folder / file).read_text(encoding="utf-8") for file in ("out", "err")]
    assert expect is None or code == expect, f"{words}: {code}\n{texts[0]}\n{texts[1]}"
    assert "Traceback" not in texts[1], texts[1]
    return subprocess.CompletedProcess(words, code, *texts)


def quick_path() -> str:
    """Return a value of `PATH` with this environment's programs, in which `foresee` is forked from the server."""
    return os.pathsep.join((str(program().parent), str(FORESEE.parent), os.environ["PATH"]))


def _write_programs(folder: Path) -> None:
    """Write the programs that ask the server: `foresee` in `bin`, interpreters beside it."""
    (folder / "bin").mkdir()
    for kind in quick_client.FORKED:
        program = folder / ("bin" if kind == "foresee" else "") / kind
        call = f"'{sys.executable}' -S -I '{quick_client.__file__}' '{folder / 'server'}' {kind}"
        program.write_text(f'#!/bin/sh\nexec {call} "$@"\n', encoding="utf-8")
        program.chmod(0o755)


def program() -> Path:
    """Return the program `foresee` that is forked from the server, for `subprocess`.

    Signals reach only the program that waits for the fork: tests that send some start the real one, `FORESEE`.
    """
    return Path(_address()).with_name("bin") / "foresee"


def pytest_program() -> Path:
    """Return a `pytest` that is forked from the server, in whose process the plug-in and the tool are imported."""
    return Path(_address()).with_name("pytest")


def fork_interpreters() -> None:
    """Let `multiprocessing` fork the interpreters of this process from the server: fork servers and workers.

    They begin without what drivers did to this process, as real ones do, but have the server's seed for the hashes of
    strings (`foresee` has `fresh` for that).
    """
    multiprocessing.set_executable(str(Path(_address()).with_name("python")))


@cache
def _address() -> str:
    """Return where the server listens: the one of all workers, else one of this process."""
    return os.environ.get(SERVER) or start_server()


def start_server() -> str:
    """Start a server, which ends with this process; return where it listens. The first answer waits for its imports."""
    folder = tempfile.TemporaryDirectory(prefix="quick")  # not pytest's: the path of a socket has 107 bytes at most
    atexit.register(folder.cleanup)
    _write_programs(Path(folder.name))
    address = str(Path(folder.name) / "server")
    server = subprocess.Popen(
        [sys.executable, "-m", "tests.support.quick_start", address],
        cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert server.stdout is not None and server.stdout.readline() == "ready\n"
    atexit.register(_end, server)
    return address


def _end(server: subprocess.Popen[str]) -> None:
    assert server.stdin is not None and server.stdout is not None
    server.stdin.close()
    server.wait()
    server.stdout.close()
