"""A client that speaks the protocol to a real `foresee lsp` process."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Coroutine
from functools import partial
from pathlib import Path
from typing import Any

from lsprotocol import types
from pygls.lsp.client import LanguageClient

FORESEE = Path(sys.executable).parent / "foresee"
PATIENCE_S = 60.0
"""So long an answer may take on a busy machine."""


class Editor:
    """Simulates an editor: opens files, types, sends requests."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.client = LanguageClient("test editor", "1")
        self.diagnostics: dict[str, list[types.PublishDiagnosticsParams]] = {}
        self.messages: list[str] = []
        self.capabilities: types.ServerCapabilities | None = None
        self._versions: dict[str, int] = {}
        self._news = asyncio.Event()
        self.client.feature(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)(
            partial(self._published)
        )  # pygls marks what it is given, which methods refuse
        self.client.feature(types.WINDOW_SHOW_MESSAGE)(partial(self._said))

    async def start(self) -> None:
        await self.client.start_io(str(FORESEE), "lsp")
        params = types.InitializeParams(
            capabilities=types.ClientCapabilities(),
            workspace_folders=[types.WorkspaceFolder(self.folder.as_uri(), "work")],
        )
        self.capabilities = (await self.client.initialize_async(params)).capabilities
        self.client.initialized(types.InitializedParams())

    async def stop(self) -> int | None:
        """End the session as the protocol says, and return the server's exit code."""
        await self.client.shutdown_async(None)
        self.client.exit(None)
        process = self.client._server
        assert process is not None
        code = await asyncio.wait_for(process.wait(), PATIENCE_S)
        await self.client.stop()
        return code

    def uri(self, name: str) -> str:
        return (self.folder / name).as_uri()

    def open(self, name: str, text: str | None = None) -> str:
        uri = self.uri(name)
        self._versions[uri] = 1
        text = (self.folder / name).read_text(encoding="utf-8") if text is None else text
        self.client.text_document_did_open(
            types.DidOpenTextDocumentParams(types.TextDocumentItem(uri, "foresee", 1, text))
        )
        return uri

    def edit(self, uri: str, text: str) -> None:
        self._versions[uri] += 1
        self.client.text_document_did_change(
            types.DidChangeTextDocumentParams(
                types.VersionedTextDocumentIdentifier(self._versions[uri], uri),
                [types.TextDocumentContentChangeWholeDocument(text)],
            )
        )

    def save(self, uri: str) -> None:
        self.client.text_document_did_save(types.DidSaveTextDocumentParams(types.TextDocumentIdentifier(uri)))

    async def until(self, uri: str, holds: Callable[[list[types.Diagnostic]], bool]) -> list[types.Diagnostic]:
        """Wait until the last diagnostics of a document's newest version are as wished, and return them."""

        async def wait() -> list[types.Diagnostic]:
            while True:
                last = self.diagnostics.get(uri, [])[-1:]
                if last and last[0].version in (None, self._versions[uri]) and holds(list(last[0].diagnostics)):
                    return list(last[0].diagnostics)
                self._news.clear()
                await self._news.wait()

        try:
            return await asyncio.wait_for(wait(), PATIENCE_S)
        except TimeoutError:
            raise AssertionError(f"the last diagnostics are {self.diagnostics.get(uri, [])[-1:]}") from None

    def _published(self, params: types.PublishDiagnosticsParams) -> None:
        self.diagnostics.setdefault(params.uri, []).append(params)
        self._news.set()

    def _said(self, params: types.ShowMessageParams) -> None:
        self.messages.append(params.message)


def session(folder: Path, steps: Callable[[Editor], Coroutine[Any, Any, None]]) -> None:
    """Run a whole session against a new server process, and see that it ends well."""

    async def run() -> None:
        editor = Editor(folder)
        await editor.start()
        try:
            await steps(editor)
        finally:
            code = await editor.stop()
        assert code == 0

    asyncio.run(run())


def at(text: str, word: str, *, after: bool = False) -> types.Position:
    """Return the place of a word's first letter, or the place behind it (UTF-16 units)."""
    offset = text.index(word) + (len(word) if after else 0)
    line = text.count("\n", 0, offset)
    before = text[text.rfind("\n", 0, offset) + 1 : offset]
    return types.Position(line, len(before.encode("utf-16-le")) // 2)


def applied(text: str, edits: list[types.TextEdit]) -> str:
    """Return a text after edits (UTF-16 units)."""
    lines = text.split("\n")
    for edit in sorted(edits, key=lambda e: (e.range.start.line, e.range.start.character), reverse=True):
        first, last = lines[edit.range.start.line], lines[edit.range.end.line]
        new = _cut(first, edit.range.start.character)[0] + edit.new_text + _cut(last, edit.range.end.character)[1]
        lines[edit.range.start.line : edit.range.end.line + 1] = new.split("\n")
    return "\n".join(lines)


def _cut(line: str, units: int) -> tuple[str, str]:
    data = line.encode("utf-16-le")
    return data[: units * 2].decode("utf-16-le"), data[units * 2 :].decode("utf-16-le")
