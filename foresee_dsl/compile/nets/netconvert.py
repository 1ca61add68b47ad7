"""Runs SUMO's netconvert, and SUMO itself to check whether it can load a net."""

from __future__ import annotations

import os
import re
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from foresee_dsl.errors import CompileError
from foresee_dsl.limits import most, raised_by

_FIVE_MB = 5e6
_NO_MEMORY = b"std::bad_alloc"
"""Message of netconvert 1.28 when it runs out of memory."""
_ONLY_LOAD = ("--end", "0", "--no-step-log", "true", "--no-warnings", "true")
_HEADER = re.compile(rb"\A(\s*<\?xml[^>]*\?>)?\s*(?:<!--.*?-->\s*)+", re.DOTALL)


class NetconvertError(CompileError):
    """Raised when netconvert made no network: the message holds its output."""


class NetconvertLimitError(NetconvertError):
    """Raised when netconvert exceeded its limit of memory, time or file size; it would do so again with the same
    input."""


class NetconvertDiedError(NetconvertError):
    """Raised when a signal ended netconvert, which is a fault of netconvert; other options may avoid the crash."""


@cache
def sumo_home() -> Path:
    """Return the folder of the installed `eclipse-sumo` wheel (its `bin/` and `data/`).

    The wheel's package is located and not imported, because its import would change this process's environment.
    """
    spec = find_spec("sumo")
    if spec is None or spec.origin is None:
        raise CompileError("netconvert is missing: install the package 'eclipse-sumo' (pip install eclipse-sumo)")
    return Path(spec.origin).parent


@cache
def tool_version() -> str:
    """Return the version of the installed netconvert, such as `1.28.0`."""
    named = list(sumo_home().parent.glob("eclipse_sumo-*.dist-info"))
    if len(named) == 1:  # one folder remains; its name contains the version
        return named[0].name.removesuffix(".dist-info").partition("-")[2]
    from importlib import metadata  # imported here: the import is slow

    try:
        return metadata.version("eclipse-sumo")
    except metadata.PackageNotFoundError as err:
        raise CompileError("netconvert is missing: install the package 'eclipse-sumo'") from err


def run_netconvert(arguments: Sequence[str], folder: Path) -> None:
    """Run netconvert in a folder, to which relative file names in `arguments` refer.

    Its memory is limited by the size of its input, its time by a constant (limits `netconvert-memory` and
    `netconvert-time`), and its output by the largest file that can be read (limit `file`).

    Raises:
        NetconvertLimitError: it exceeds a limit.
        NetconvertDiedError: a signal ended it.
        NetconvertError: it refuses its input; the message holds its output.
        CompileError: it is missing.
    """
    memory_mb = most("netconvert-memory") * (1 + _input_bytes(arguments, folder) / _FIVE_MB)
    code, complaint = _run("netconvert", arguments, folder, memory_mb)
    if code == 0:
        return
    if _NO_MEMORY in complaint:
        raise NetconvertLimitError(
            f"netconvert needs more than {memory_mb:.0f} MB of memory for the network, which a road of absurd length, "
            f"or a map that is too large, may cause; {raised_by('netconvert-memory', 4 * most('netconvert-memory'))}"
        )
    if code == -signal.SIGXFSZ:
        raise NetconvertLimitError(f"netconvert makes a network of more than {most('file'):g} MB from this map: "
                                   f"cut out the part that is needed; {raised_by('file')}")  # fmt: skip
    if code < 0:
        words = _complaint(complaint, 0)
        raise NetconvertDiedError(f"netconvert {tool_version()} crashed ({signal.Signals(-code).name}"
                                  f"{f', its last output: {words}' if words else ''})")  # fmt: skip
    raise NetconvertError(f"netconvert refused the network: {_complaint(complaint, code)}")


def check_loads(net: Path) -> None:
    """Load a foreign network in a separate SUMO process, so that a network that crashes SUMO does not end our process.

    It takes 0.07 s for a small net, and 1.7 s for a net of 23 MB.

    Raises:
        CompileError: SUMO cannot load it; the message holds SUMO's output.
    """
    memory_mb = most("netconvert-memory") * (1 + net.stat().st_size / _FIVE_MB)
    code, complaint = _run("sumo", ["--net-file", net.name, *_ONLY_LOAD], net.parent, memory_mb)
    if code == 0:
        return
    words = _complaint(complaint, max(code, 0))
    if code < 0:
        died = f"SUMO {tool_version()} crashes when it loads the network ({signal.Signals(-code).name})"
        raise CompileError(f"{died}{f', its last output: {words}' if words else ''}")
    raise CompileError(f"SUMO {tool_version()} cannot load it: {words}")


def _run(tool: str, arguments: Sequence[str], folder: Path, memory_mb: float) -> tuple[int, bytes]:
    """Run one of SUMO's programs; return its exit code and its standard error output."""
    import shutil

    home = sumo_home()
    program = shutil.which(tool, path=str(home / "bin"))
    if program is None:
        raise CompileError(f"{tool} is not in {home / 'bin'}: reinstall the package 'eclipse-sumo'")
    # SUMO 1.28 links OpenBLAS, which allocates 150 MB of data for each core at the start (2.4 GB on 16 cores, more than
    # the limit) and crashes with SIGSEGV if it does not get them. Both programs need only one thread of OpenBLAS.
    environment = {**os.environ, "SUMO_HOME": str(home), "OMP_NUM_THREADS": "1"}
    return _watched([program, *arguments], folder, environment, memory_mb=memory_mb, time_s=most("netconvert-time"))


def _watched(
    command: Sequence[str], folder: Path, environment: dict[str, str], *, memory_mb: float, time_s: float
) -> tuple[int, bytes]:
    """Run a program with limits of memory and time; return its exit code and its standard error output."""
    import subprocess

    try:
        with subprocess.Popen(  # noqa: S603 - our own program, no shell
            command,
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        ) as running:
            try:
                _limit(running.pid, memory_mb)
                _, complaint = running.communicate(timeout=time_s)
            except subprocess.TimeoutExpired as err:
                raise NetconvertLimitError(
                    f"{Path(command[0]).stem} did not finish within {time_s:g} s; {raised_by('netconvert-time')}"
                ) from err
            finally:
                running.kill()  # this has no effect if the program has ended
            return running.returncode, complaint
    except OSError as err:
        raise CompileError(f"{Path(command[0]).stem} cannot be started: {err}") from err


def _limit(pid: int, memory_mb: float) -> None:
    """Limit the data memory and file size of a process. Linux only: other systems cannot limit another process.

    The limit is on data, not on address space: netconvert's libraries alone map some 600 MB, most of it never used.
    """
    if sys.platform != "linux":
        return
    import resource

    wanted = {
        resource.RLIMIT_DATA: round(memory_mb * 1e6),
        resource.RLIMIT_FSIZE: round(most("file") * 1e6),
        resource.RLIMIT_CORE: 0,
    }
    for what, most_bytes in wanted.items():
        with suppress(ProcessLookupError):  # the process has ended
            _, hard = resource.prlimit(pid, what)
            least = most_bytes if hard == resource.RLIM_INFINITY else min(most_bytes, hard)
            resource.prlimit(pid, what, (least, hard))


def _input_bytes(arguments: Sequence[str], folder: Path) -> int:
    """Return the size of all files named in the arguments, including the output of an earlier run."""
    files = (folder / name for argument in arguments for name in argument.split(","))
    return sum(file.stat().st_size for file in files if file.is_file())


def without_header(net: bytes) -> bytes:
    """Return a net file's text without the comments before its root.

    The comments hold the time and the paths of the call; the rest of netconvert's output depends only on the input.
    """
    return _HEADER.sub(lambda m: (m.group(1) or b"") + b"\n", net, count=1)


def _complaint(stderr: bytes, code: int) -> str:
    """Return the message of a program, without warnings if it has errors."""
    lines = [line.strip() for line in stderr.decode("utf-8", "replace").splitlines() if line.strip()]
    lines = [
        line for line in lines if not line.startswith(("proj_create", "pj_obj_create"))
    ]  # harmless messages of PROJ
    errors = [line.removeprefix("Error:").strip() for line in lines if not line.startswith(("Warning:", "Quitting"))]
    return " ".join(errors or lines)[:2000] or (f"it ended with code {code} and said nothing" if code else "")
