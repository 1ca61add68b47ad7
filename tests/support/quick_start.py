"""A server with everything imported, of which commands are forks: `tests.support.command` starts it.

Fork servers of campaigns are forks of it too: `multiprocessing` starts them with the program that `set_executable`
names, which is `quick_client`.
"""

from __future__ import annotations

import atexit
import contextlib
import fcntl
import gc
import json
import multiprocessing
import os
import select
import socket
import sys
import traceback
import zlib
from importlib import import_module
from pathlib import Path
from typing import Any, get_args

import pytest

from tests.support.quick_client import HEAD

FORESEE = Path(sys.executable).parent / "foresee"
LOADED = (
    "foresee_dsl.campaign.execution.preloading",
    "foresee_dsl.campaign.execution.engine",
    "foresee_dsl.cli.documents",
    "foresee_dsl.language.project.loading",
    "foresee_dsl.report.terminal.campaign",
    "foresee_dsl.simulate.runner",
    "foresee_dsl.compile.compiler",
    "foresee_dsl.language.checks",
    "foresee_dsl.report.page.html",
    "foresee_dsl.report.page.running",
    "foresee_dsl.report.terminal.live",
    "foresee_dsl.report.terminal.runs",
    "traci",  # with the packages that libsumo imports; libsumo itself starts a thread, and is imported by each worker
    "sumolib",
)
_MOST_FILES = 253
"""Number of descriptors that Linux passes in a message at most (`SCM_MAX_FD`)."""
_HIGH = 600
"""A descriptor above all that a process opens here: what was received waits there for its place."""


def serve(address: str) -> None:
    """Fork for each connection, until the standard input ends."""
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(address)
    listener.listen(64)
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    from foresee_dsl.cli import COMMANDS
    from foresee_dsl.cli.added import ADDED

    ours = (f"foresee_dsl.cli.{command.rpartition('.')[0]}" for _, _, command in COMMANDS)
    for name in {*LOADED, *ours, *(entry.module for entry in ADDED.entries())}:
        import_module(name)
    warm_up()
    gc.freeze()
    while True:
        ready, _, _ = select.select([listener, sys.stdin], [], [])
        _forget_ended()
        if sys.stdin in ready:
            return
        connection, _ = listener.accept()
        if os.fork() == 0:
            os._exit(_answer(listener, connection))
        connection.close()


def warm_up() -> None:
    """Compute what a process computes once, so that forks need not: parser, hashes of code, templates, validators."""
    from foresee_dsl.campaign import keys, stages
    from foresee_dsl.campaign.records import Record, decode
    from foresee_dsl.files import data_folder, templates
    from foresee_dsl.language.project.loading import load_test_cases
    from foresee_dsl.report.page.html import page_style, page_templates

    load_test_cases([data_folder("scenarios") / "scenario7.foresee"])
    for step in stages.STEPS:
        keys.step_code(step.__module__)
    for driver in ("pdm", "idm"):
        keys.driver_identity(driver)
    keys.ranker_identity("foresee", "pdm")
    keys.views_identity()
    keys.views_identity.cache_clear()  # a fork may have more packages on its path
    for kind in get_args(Record):
        with contextlib.suppress(ValueError):
            decode(zlib.compress(b"null"), kind)
    page_style()
    for environment in (page_templates(), templates("draw"), templates("draw", markup=False)):
        for name in environment.list_templates(extensions=["j2"]):
            environment.get_template(name)


def _forget_ended() -> None:
    """Wait for the processes that have ended, so that their time counts as this one's."""
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


def _answer(listener: socket.socket, connection: socket.socket) -> int:
    """Fork the process that is asked for, wait for it, and send its exit code."""
    listener.close()
    head, files, _, _ = socket.recv_fds(connection, HEAD, _MOST_FILES)
    text = connection.makefile("rb").read(int.from_bytes(head, "big"))
    child = os.fork()
    if child == 0:
        connection.detach()
        os._exit(_run(json.loads(text), files))
    for file in files:
        os.close(file)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    with contextlib.suppress(OSError):  # the asker has gone
        connection.sendall(f"{code}\n".encode())
    return 0


def _run(request: dict[str, Any], files: list[int]) -> int:
    """Be the process that is asked for; return its exit code."""
    waiting = [fcntl.fcntl(file, fcntl.F_DUPFD_CLOEXEC, _HIGH) for file in files]
    os.closerange(0, _HIGH)
    for number, file in zip(request["files"], waiting, strict=True):
        os.dup2(file, number)
        os.close(file)
    os.environ.clear()
    os.environ.update(request["env"])
    os.chdir(request["cwd"])
    sys.path[:0] = request["env"].get("PYTHONPATH", "").split(os.pathsep) if "PYTHONPATH" in request["env"] else []
    code = 0
    try:
        if request.get("code"):
            sys.argv = ["-c", *request["words"]]
            exec(request["code"], {"__name__": "__main__"})
        elif request.get("kind") == "pytest":
            sys.argv = ["pytest", *request["words"]]
            sys.path.insert(0, str(Path.cwd()))  # as `python -m pytest` does
            code = pytest.console_main()
        else:
            _command(request)
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except BaseException:
        traceback.print_exc()
        code = 1
    with contextlib.suppress(BaseException):
        atexit._run_exitfuncs()
    with contextlib.suppress(OSError):
        sys.stdout.flush()
        sys.stderr.flush()
    return code


def _command(request: dict[str, Any]) -> None:
    """Be the command line."""
    from foresee_dsl.cli import main

    multiprocessing.set_executable(str(Path(sys.argv[1]).with_name(request.get("python", "python"))))
    sys.argv = [str(FORESEE), *request["words"]]
    sys.modules["__main__"].__package__ = None  # or usage texts would say `python -m`
    main()


if __name__ == "__main__":
    serve(sys.argv[1])
