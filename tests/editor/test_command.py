"""The commands: `foresee lsp` over a port and without pygls, and `foresee expand` in colours."""

from __future__ import annotations

import asyncio
import os
import pty
import socket
import subprocess
import sys
from pathlib import Path

from lsprotocol import types
from pygls.lsp.client import LanguageClient

from tests.support.editor_client import FORESEE, PATIENCE_S


def test_over_a_port(tmp_path: Path) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]

    async def talk() -> None:
        server = await asyncio.create_subprocess_exec(
            FORESEE, "lsp", "--tcp", str(port), stderr=asyncio.subprocess.PIPE
        )
        try:
            assert server.stderr is not None
            said = await asyncio.wait_for(server.stderr.readline(), PATIENCE_S)
            assert said.decode() == f"foresee lsp listens on 127.0.0.1:{port}\n"
            client = LanguageClient("test editor", "1")
            for _ in range(200):
                try:
                    await client.start_tcp("127.0.0.1", port)
                    break
                except ConnectionRefusedError:
                    await asyncio.sleep(0.02)
            params = types.InitializeParams(capabilities=types.ClientCapabilities(), root_uri=tmp_path.as_uri())
            found = await asyncio.wait_for(client.initialize_async(params), PATIENCE_S)
            assert found.server_info is not None and found.server_info.name == "foresee"
            await asyncio.wait_for(client.shutdown_async(None), PATIENCE_S)
            client.exit(None)
            assert await asyncio.wait_for(server.wait(), PATIENCE_S) == 0
        finally:
            if server.returncode is None:
                server.kill()
                await server.wait()

    asyncio.run(talk())


def test_without_pygls_it_says_what_to_install() -> None:
    code = (
        "import sys; sys.modules['pygls'] = None; sys.argv = ['foresee', 'lsp']\n"
        "from foresee_dsl.cli import main; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=False, capture_output=True, text=True, stdin=subprocess.DEVNULL
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == "error: the language server needs pygls: pip install 'foresee-dsl[lsp]'\n"


def shown_on_a_terminal(file: Path, **environment: str) -> str:
    ours, theirs = pty.openpty()
    try:
        keep = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR")}
        process = subprocess.Popen(
            [FORESEE, "expand", file], stdout=theirs, env=keep | {"TERM": "xterm-256color"} | environment
        )
        os.close(theirs)
        found = b""
        while True:
            try:
                piece = os.read(ours, 65536)
            except OSError:  # how Linux says that the other end is closed
                break
            if not piece:
                break
            found += piece
        assert process.wait() == 0
    finally:
        os.close(ours)
    return found.decode().replace("\r\n", "\n")


def test_expand_has_colours_on_a_terminal_only(root: Path) -> None:
    file = root / "tests" / "cases" / "language" / "inline_network.foresee"
    piped = subprocess.run([FORESEE, "expand", file], capture_output=True, text=True, check=True).stdout
    assert "\x1b" not in piped and piped.startswith("foresee 1\n")
    assert shown_on_a_terminal(file, NO_COLOR="1") == piped
    assert "\x1b[1;36mscenario" in shown_on_a_terminal(file)
