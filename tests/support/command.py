"""The command line in processes of their own that begin with everything imported: each is a fork of one server.

Starting Python and importing SUMO, numba and pydantic costs 0.5 to 1.5 s of a core for each command, and the suite
calls hundreds. How the real program starts is tested by `tests/test_speed.py`, `tests/test_wheel.py`,
`tests/test_readme.py`, and wherever processes get signals.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import json
import os
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
FORESEE = Path(sys.executable).parent / "foresee"
LOADED = (
    "foresee_dsl.campaign.execution.preloading",
    "foresee_dsl.campaign.execution.engine",
    "foresee_dsl.cli.documents",
    "foresee_dsl.language.project.loading",
    "foresee_dsl.report.terminal.campaign",
    "foresee_dsl.simulate.runner",
    "foresee_dsl.compile",
)


def foresee(
    *arguments: object,
    cwd: Path | None = None,
    env: Mapping[str, str] | None = None,
    expect: int | None = 0,
) -> subprocess.CompletedProcess[str]:
    """Run a command, without colours; `env` is added to this process's environment, `expect` is its exit code."""
    words = [str(argument) for argument in arguments]
    with tempfile.TemporaryDirectory() as folder:
        out, err = Path(folder) / "out", Path(folder) / "err"
        code = _ask({
            "words": words,
            "cwd": str(cwd or Path.cwd()),
            "env": {**os.environ, "NO_COLOR": "1", **(env or {})},
            "out": str(out),
            "err": str(err),
        })  # fmt: skip
        texts = out.read_text(encoding="utf-8"), err.read_text(encoding="utf-8")
    assert expect is None or code == expect, f"{words}: {code}\n{texts[0]}\n{texts[1]}"
    assert "Traceback" not in texts[1], texts[1]
    return subprocess.CompletedProcess(words, code, *texts)


def _ask(request: dict[str, Any]) -> int:
    server = _server()
    assert server.stdin is not None and server.stdout is not None
    server.stdin.write(json.dumps(request) + "\n")
    server.stdin.flush()
    return int(server.stdout.readline())


@cache
def _server() -> subprocess.Popen[str]:
    server = subprocess.Popen(
        [sys.executable, "-m", __name__], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    atexit.register(_end, server)
    return server


def _end(server: subprocess.Popen[str]) -> None:
    assert server.stdin is not None
    server.stdin.close()
    server.wait()


def _serve() -> None:
    """Fork for each line of the standard input, wait for the fork, and print its exit code."""
    from foresee_dsl.cli import COMMANDS
    from foresee_dsl.cli.added import ADDED

    answers = os.fdopen(os.dup(1), "w")
    ours = (f"foresee_dsl.cli.{command.rpartition('.')[0]}" for _, _, command in COMMANDS)
    for name in {*LOADED, *ours, *(entry.module for entry in ADDED.entries())}:
        import_module(name)
    gc.freeze()
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            os._exit(_run(json.loads(line)))
        answers.write(f"{os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])}\n")
        answers.flush()


def _run(request: dict[str, Any]) -> int:
    """Be the command; return its exit code."""
    from foresee_dsl.cli import main

    for number, path, flags in (
        (0, os.devnull, os.O_RDONLY),
        (1, request["out"], os.O_WRONLY | os.O_CREAT),
        (2, request["err"], os.O_WRONLY | os.O_CREAT),
    ):
        opened = os.open(path, flags, 0o600)
        os.dup2(opened, number)
        os.close(opened)
    os.environ.clear()
    os.environ.update(request["env"])
    os.chdir(request["cwd"])
    sys.path[:0] = request["env"].get("PYTHONPATH", "").split(os.pathsep) if "PYTHONPATH" in request["env"] else []
    sys.argv = [str(FORESEE), *request["words"]]
    sys.modules["__main__"].__package__ = None  # or usage texts would say `python -m`
    code = 0
    try:
        main()
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except BaseException:
        traceback.print_exc()
        code = 1
    with contextlib.suppress(BaseException):
        atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    return code


if __name__ == "__main__":
    _serve()
