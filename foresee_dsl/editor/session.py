"""One editor's session: the open texts, the places in them, and the diagnostics that are sent as they change."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from lsprotocol import types
from pygls.lsp.server import LanguageServer
from pygls.uris import from_fs_path, to_fs_path

from foresee_dsl import __version__
from foresee_dsl.editor.files import Files
from foresee_dsl.errors import Diagnostic, ForeseeError, InputError, Span
from foresee_dsl.language.checks.documents import check_document
from foresee_dsl.language.parser import parse, plain
from foresee_dsl.language.project.addresses import absolute
from foresee_dsl.language.project.checked_files import check_paths

if TYPE_CHECKING:
    from pygls.workspace import PositionCodec

SOURCE = "foresee"
_NO_CODE = "FS001"
_PAUSE_S = 0.2
"""So long after the last letter the text is checked (ours: shorter than a pause between words)."""
_AT_ONCE_S = 0.0


class Positions:
    """The places of one text: an editor counts from 0, in UTF-16 or what was agreed on; we from 1, in code points."""

    def __init__(self, text: str, codec: PositionCodec) -> None:
        self.lines = plain(text).split("\n")
        self._codec = codec
        # A byte order mark is a character to the editor and none to the parser.
        self._mark = codec.client_num_units("\ufeff") if text.startswith("\ufeff") else 0

    def position(self, line: int, column: int) -> types.Position:
        """Return the editor's position of a line and column; a place behind the text is its end."""
        if line > len(self.lines):
            line, column = len(self.lines), len(self.lines[-1]) + 1
        before = self.lines[line - 1][: max(column - 1, 0)]
        return types.Position(line - 1, self._codec.client_num_units(before) + (self._mark if line == 1 else 0))

    def range(self, span: Span | None) -> types.Range:
        """Return the editor's range of a span; of None, the first line."""
        if span is None:
            return types.Range(self.position(1, 1), self.position(1, len(self.lines[0]) + 1))
        return types.Range(self.position(span.line, span.column), self.position(span.end_line, span.end_column))

    def whole(self) -> types.Range:
        """Return the range of the whole text, its byte order mark left out."""
        return types.Range(self.position(1, 1), self.position(len(self.lines), len(self.lines[-1]) + 1))

    def place(self, position: types.Position) -> tuple[int, int]:
        """Return the line and column (1-based) of an editor's position; a place behind a line is its end."""
        if position.line >= len(self.lines):
            return len(self.lines), len(self.lines[-1]) + 1
        line = self.lines[position.line]
        left = position.character - (self._mark if position.line == 0 else 0)
        column = 0
        while column < len(line) and left > 0:
            left -= self._codec.client_num_units(line[column])
            column += 1
        return position.line + 1, column + 1

    def offset(self, position: types.Position) -> int:
        """Return the offset in the plain text of an editor's position."""
        line, column = self.place(position)
        return sum(len(text) + 1 for text in self.lines[: line - 1]) + column - 1

    def text(self, where: types.Range) -> str:
        """Return what stands in a range."""
        return "\n".join(self.lines)[self.offset(where.start) : self.offset(where.end)]


class ForeseeServer(LanguageServer):
    """The language server: pygls' protocol, our files, and one worker for the checks."""

    def __init__(self) -> None:
        # Whole texts, not changes: files are short, and we decide what ends a line.
        super().__init__("foresee", __version__, text_document_sync_kind=types.TextDocumentSyncKind.Full)
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="checks")
        self._waiting: dict[str, asyncio.Task[None]] = {}

    # ---- files ----------------------------------------------------------------------------------------------------

    def path(self, uri: str) -> Path:
        """Return the file of a document; one that was never saved has a name that no file has."""
        found = to_fs_path(uri) if uri.startswith("file:") else None
        return absolute(Path(found)) if found else Path("/") / uri.replace("/", "_").replace(":", "_")

    def uri(self, path: Path) -> str:
        """Return a file's address, as the editor writes it where the file is open."""
        for uri in self.workspace.text_documents:
            if self.path(uri) == path:
                return str(uri)
        return from_fs_path(str(path)) or path.as_uri()

    def overlay(self) -> dict[Path, str]:
        """Return the texts of all open documents, by their absolute paths."""
        return {self.path(uri): document.source for uri, document in self.workspace.text_documents.items()}

    def files(self, uri: str) -> Files:
        """Return the files of the workspace; where no folder is open, those beside the document."""
        folders = [Path(p) for f in self.workspace.folders.values() if (p := to_fs_path(f.uri))]
        return Files(self.overlay(), folders or [self.path(uri).parent])

    def text(self, uri: str) -> str:
        """Return a document's text, the editor's or else the disk's."""
        document = self.workspace.text_documents.get(uri)
        if document is not None:
            return str(document.source)
        return Files({}).text(self.path(uri)) or ""

    def positions(self, uri: str) -> Positions:
        """Return the places of a document's text."""
        return Positions(self.text(uri), self.workspace.position_codec)

    # ---- diagnostics ----------------------------------------------------------------------------------------------

    def check_soon(self, uri: str, *, places: bool) -> None:
        """Check a document, and the open ones that build on it, once nothing has changed for a moment; with `places` at
        once, and also where things stand, which takes longer."""
        changed, files = self.path(uri), self.files(uri)
        for other in list(self.workspace.text_documents):
            if other == uri or changed in files.scope(self.path(other)):
                self._forget(other)
                pause = _AT_ONCE_S if places else _PAUSE_S
                self._waiting[other] = asyncio.ensure_future(self._check(other, pause, places=places))

    def close(self, uri: str) -> None:
        """Remove the diagnostics of a document that is not open any more."""
        self._forget(uri)
        self.text_document_publish_diagnostics(types.PublishDiagnosticsParams(uri, []))

    def stop(self) -> None:
        """Check nothing more."""
        for uri in list(self._waiting):
            self._forget(uri)
        self._worker.shutdown(wait=False, cancel_futures=True)

    def _forget(self, uri: str) -> None:
        task = self._waiting.pop(uri, None)
        if task is not None:
            task.cancel()

    async def _check(self, uri: str, pause_s: float, *, places: bool) -> None:
        await asyncio.sleep(pause_s)
        for also_places in (False, True) if places else (False,):
            document = self.workspace.text_documents.get(uri)
            if document is None:
                return
            version, text, path = document.version, document.source, self.path(uri)
            if uri.startswith("file:"):
                work = partial(find, path, text, self.overlay(), places=also_places)
            else:
                work = partial(find_alone, text, str(path))
            found = await asyncio.get_running_loop().run_in_executor(self._worker, work)
            # A newer text's check cancels this one, so what is sent is about the text of that version.
            shown = list(self._shown(uri, path, found))
            self.text_document_publish_diagnostics(types.PublishDiagnosticsParams(uri, shown, version))

    def _shown(self, uri: str, path: Path, found: tuple[Diagnostic, ...]) -> Iterator[types.Diagnostic]:
        here = self.positions(uri)
        elsewhere: dict[Path, list[Diagnostic]] = {}
        for diagnostic in found:
            file = absolute(Path(diagnostic.path)) if diagnostic.path else path
            if file == path:
                yield _diagnostic(diagnostic, here.range(diagnostic.span))
            else:
                elsewhere.setdefault(file, []).append(diagnostic)
        for file, errors in elsewhere.items():
            yield self._of_another(uri, path, file, errors)

    def _of_another(self, uri: str, path: Path, file: Path, found: list[Diagnostic]) -> types.Diagnostic:
        """What is wrong in a file that this one names, shown where it names it."""
        files = self.files(uri)
        uses = (o.span for o in files.names(path) if o.kind == "file" and absolute(path.parent / o.name) == file)
        there = Positions(files.text(file) or "", self.workspace.position_codec)
        related = [
            types.DiagnosticRelatedInformation(
                types.Location(self.uri(file), there.range(d.span)), f"{d.code}: {d.message}"
            )
            for d in found
        ]
        first = next((d for d in found if d.severity == "error"), found[0])
        message = f"'{file.name}' has an error: {first.message}"
        moved = Diagnostic(first.code, message, "", str(path), severity=first.severity)
        shown = _diagnostic(moved, self.positions(uri).range(next(uses, None)))
        shown.related_information = related
        return shown


def _diagnostic(diagnostic: Diagnostic, where: types.Range) -> types.Diagnostic:
    help = f"\n{diagnostic.help}" if diagnostic.help else ""
    warning = diagnostic.severity == "warning"
    return types.Diagnostic(
        range=where,
        message=diagnostic.message + help,
        severity=types.DiagnosticSeverity.Warning if warning else types.DiagnosticSeverity.Error,
        code=diagnostic.code,
        source=SOURCE,
    )


# ---- what is wrong with a text --------------------------------------------------------------------------------------


def find(path: Path, text: str, overlay: Mapping[Path, str], *, places: bool) -> tuple[Diagnostic, ...]:
    """Return what is wrong with a file and with the files that it builds on.

    The file need not exist on the disk; `overlay` are the texts that the editor holds, by absolute path. With `places`
    the network is built and every actor placed, which takes up to some seconds. Nothing is raised for what is in the
    text, nor where SUMO's programs are missing.
    """
    try:
        result = check_paths([str(path)], {**overlay, path: text})
        if not places:
            return result.diagnostics
        from foresee_dsl.compile import placement_mistakes

        return (*result.diagnostics, *placement_mistakes(result.cases))
    except InputError as error:
        return error.diagnostics
    except ForeseeError as error:
        return (Diagnostic(_NO_CODE, str(error), "", str(path), severity="warning"),)


def find_alone(text: str, name: str) -> tuple[Diagnostic, ...]:
    """Return what is wrong with a text that is no file yet."""
    try:
        return check_document(parse(text, name))
    except InputError as error:
        return error.diagnostics
