"""The commands: `foresee lsp` over a port and with nothing more installed, and `foresee expand` in colours."""

from __future__ import annotations

import asyncio
import json
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


def framed(**message: object) -> bytes:
    body = json.dumps({"jsonrpc": "2.0", **message}).encode()
    return b"Content-Length: %d\r\n\r\n%s" % (len(body), body)


def test_it_needs_no_other_package_and_answers_what_is_no_message() -> None:
    code = (
        "import sys; sys.modules['pygls'] = sys.modules['lsprotocol'] = None; sys.argv = ['foresee', 'lsp']\n"
        "from foresee_dsl.cli import main; main()"
    )
    sent = (
        framed(id=1, method="textDocument/hover", params={}),
        framed(id=2, method="initialize", params={"capabilities": {"general": {"positionEncodings": ["utf-32"]}}}),
        b"Content-Length: 9\r\n\r\nnot JSON!",
        framed(id=3, method="no/such", params={}),
        framed(id=4, method="textDocument/hover", params={"textDocument": {"uri": "untitled:a"}}),
        framed(id=5, method="shutdown"),
        framed(id=6, method="textDocument/hover", params={}),
        framed(method="exit"),
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, input=b"".join(sent))
    assert done.returncode == 0
    bodies = [json.loads(part.partition(b"\r\n\r\n")[2]) for part in done.stdout.split(b"Content-Length:")[1:]]
    answers = {body["id"]: body for body in bodies if "method" not in body}
    assert answers[2]["result"]["capabilities"]["positionEncoding"] == "utf-32"
    errors = {k: answers[k]["error"]["code"] for k in (None, 1, 3, 4, 6)}
    assert errors == {None: -32700, 1: -32600, 3: -32601, 4: -32603, 6: -32600}


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
