"""Stands in for a program that takes a second to start: the server of `quick_start` forks it instead.

It passes its arguments, environment, folder and open files to the server, waits for the fork, and ends as it does.
Called as `python -S -I quick_client.py ADDRESS KIND ARGUMENT...`. Of the kind `python` it is an interpreter, and only
what `FORKED` names is forked; all else is left to a real one.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import sys

FORKED = {
    "foresee": "",
    "pytest": "",
    "python": "from multiprocessing.",
    "python-fresh": "from multiprocessing.forkserver import main",
}
"""Beginning of the code that is forked, by the kind of program."""
HEAD = 8
"""Bytes that give the length of a request."""


def ask(address: str, request: dict[str, object], files: dict[int, int]) -> int:
    """Let the server fork a process with these open files (descriptor there: descriptor here); return its exit code."""
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(address)
        text = json.dumps({**request, "files": [*files]}).encode()
        socket.send_fds(connection, [len(text).to_bytes(HEAD, "big")], [*files.values()])
        connection.sendall(text)
        return int(connection.makefile().readline())


def _open_files() -> dict[int, int]:
    numbers = [int(name) for name in os.listdir("/dev/fd")]  # noqa: PTH208 - pathlib takes long to import
    files = {}
    for number in numbers:
        try:
            os.fstat(number)
        except OSError:  # the folder that was listed
            continue
        files[number] = number
    return files


def main(address: str, kind: str, *arguments: str) -> int:
    """Be the program."""
    code = arguments[arguments.index("-c") + 1] if FORKED[kind] and "-c" in arguments else ""
    if not code.startswith(FORKED[kind]) or "resource_tracker" in code:
        os.execv(sys.executable, [sys.executable, *arguments])
    words = arguments[arguments.index("-c") + 2 :] if code else arguments
    request = {"kind": kind, "code": code, "words": words, "cwd": os.getcwd(), "env": dict(os.environ)}  # noqa: PTH109 - as above
    return ask(address, request, _open_files())


if __name__ == "__main__":
    ended = main(*sys.argv[1:])
    if ended < 0:
        signal.signal(-ended, signal.SIG_DFL)
        os.kill(os.getpid(), -ended)
    sys.exit(ended)
