"""The session of an editor: holds the open texts by their addresses (`file:`, or of texts that were never saved),
checks them when they change, and sends their diagnostics."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote, unquote, urlsplit
from urllib.request import url2pathname

from foresee_dsl.editor.protocol.rpc import Connection, Json
from foresee_dsl.errors import Diagnostic
from foresee_dsl.files import absolute

if TYPE_CHECKING:
    from foresee_dsl.editor.files import Files
    from foresee_dsl.editor.protocol.positions import Encoding, Positions


def is_file(uri: str) -> bool:
    """Return whether an address is that of a file."""
    return uri.startswith("file:")


def path_of(uri: str) -> Path:
    """Return the path of a document; for one that was never saved, a path that does not exist."""
    if not is_file(uri):
        return Path("/") / uri.replace("/", "_").replace(":", "_")
    parts = urlsplit(uri)
    host = f"//{parts.netloc}" if parts.netloc and parts.netloc != "localhost" else ""
    path = unquote(parts.path) if os.name != "nt" else url2pathname(parts.path)
    return absolute(Path(host + path))


def _uri_of(path: Path) -> str:
    """Return a file's address."""
    return "file://" + quote(path.as_posix(), safe="/:@-._~!$&'()*+,;=") if os.name != "nt" else path.as_uri()


SOURCE = "foresee"
_PAUSE_S = 0.2
"""Time from the last letter to the check of the text, s. Ours: shorter than a pause between words."""
_AT_ONCE_S = 0.0
_ERROR, _WARNING = 1, 2
"""Severities of the protocol (3.17, `DiagnosticSeverity`)."""


@dataclass(frozen=True)
class Open:
    """A document that the editor holds."""

    uri: str
    path: Path
    text: str
    version: int


@dataclass
class _Due:
    """A document that waits to be checked, with the time of its check."""

    at_s: float
    places: bool


class Session:
    """The open documents, the folders, and a worker thread that checks documents and sends the results."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.begun = False
        self.encoding: Encoding = "utf-16"
        self.folders: dict[str, Path] = {}
        self.refreshes: tuple[str, ...] = ()
        """Requests to the client to refresh its hints and lenses; sent when a change of a text may make them stale."""
        self._open: dict[str, Open] = {}
        self._due: dict[str, _Due] = {}
        self._requests = 0
        self._news = threading.Condition()
        self._stopped = self._checked = False
        self.answering = False
        """True while a request is being answered; meanwhile no files are read ahead."""
        self._worker = threading.Thread(target=self._work, name="checks", daemon=True)

    # ---- files ----------------------------------------------------------------------------------------------------

    def begin(self, *, encoding: Encoding, folders: list[Json], refreshes: tuple[str, ...] = ()) -> None:
        """Begin the session with the editor's unit of columns and its folders."""
        self.encoding, self.refreshes, self.begun = encoding, refreshes, True
        for folder in folders:
            self.folders[folder["uri"]] = path_of(folder["uri"])
        self._worker.start()

    def put(self, uri: str, text: str, version: int) -> None:
        """Remember a document's text."""
        with self._news:
            self._open[uri] = Open(uri, path_of(uri), text, version)

    def documents(self) -> tuple[Open, ...]:
        """Return the open documents."""
        with self._news:
            return tuple(self._open.values())

    def uri(self, path: Path) -> str:
        """Return a file's address, in the editor's own spelling if the file is open."""
        return next((document.uri for document in self.documents() if document.path == path), _uri_of(path))

    def overlay(self) -> dict[Path, str]:
        """Return the texts of all open documents, by their absolute paths."""
        return {document.path: document.text for document in self.documents()}

    def files(self, uri: str) -> Files:
        """Return the files of the workspace; without an open folder, those beside the document."""
        from foresee_dsl.editor.files import Files

        return Files(self.overlay(), self.folders.values() or [path_of(uri).parent])

    def text(self, uri: str) -> str:
        """Return a document's text from the editor, else from the disk."""
        document = self._open.get(uri)
        if document is not None:
            return document.text
        return self.files(uri).text(path_of(uri)) or ""

    def positions(self, uri: str) -> Positions:
        """Return the places of a document's text."""
        return self._places(self.text(uri))

    def _places(self, text: str) -> Positions:
        from foresee_dsl.editor.protocol.positions import Positions

        return Positions(text, self.encoding)

    # ---- diagnostics ----------------------------------------------------------------------------------------------

    def check_soon(self, uri: str, *, places: bool) -> None:
        """Check a document, and the open ones that build on it, after a pause without changes; with `places` at once,
        and with the placing of actors, which takes longer."""
        changed = path_of(uri)
        others = [document for document in self.documents() if document.uri != uri]
        files = self.files(uri) if others else None
        uris = [uri, *(o.uri for o in others if files is not None and changed in files.scope(o.path))]
        at_s = time.monotonic() + (_AT_ONCE_S if places else _PAUSE_S)
        with self._news:
            for due_uri in uris:
                self._due[due_uri] = _Due(at_s, places)
            self._news.notify()

    def find(self, uri: str, text: str, *, places: bool) -> tuple[Diagnostic, ...]:
        """Return the diagnostics of a text of a document, and of the files on which it builds; see `diagnosing`."""
        from foresee_dsl.editor.diagnosing import find, find_alone

        if is_file(uri):
            return find(path_of(uri), text, self.overlay(), places=places)
        return find_alone(text, str(path_of(uri)))

    def close(self, uri: str) -> None:
        """Forget a document that was closed, and remove its diagnostics."""
        with self._news:
            self._open.pop(uri, None)
            self._due.pop(uri, None)
        self._publish(uri, [], None)

    def stop(self) -> None:
        """Stop all checks."""
        with self._news:
            self._stopped = True
            self._due.clear()
            self._news.notify()

    def _work(self) -> None:
        """Check documents that are due, as long as the session lasts."""
        # Import the language while the editor still reads the server's capabilities.
        import foresee_dsl.editor.diagnosing as _  # noqa: F401

        warm: Iterator[None] | None = None
        while True:
            with self._news:
                if self._stopped:
                    return
                uri = min(self._due, key=lambda due_uri: self._due[due_uri].at_s, default=None)
                wait_s = self._due[uri].at_s - time.monotonic() if uri is not None else None
                due = self._due.pop(uri) if uri is not None and wait_s is not None and wait_s <= 0 else None
                idle = uri is None and self._checked and bool(self._open)
                if due is None and (not idle or self.answering):
                    self._news.wait(_PAUSE_S if idle else wait_s)
                    continue
            if uri is not None and due is not None:
                self._checked = True
                try:
                    self._check(uri, places=due.places)
                except Exception as error:  # a fault in one check must not end all
                    self.connection.notify("window/logMessage", {"type": _ERROR, "message": f"{error!r}"})
                continue
            warm = self._warm() if warm is None else warm
            if next(warm, self) is self:  # all files are read: wait for the next check
                self._checked, warm = False, None

    def _warm(self) -> Iterator[None]:
        """Read the workspace's files one by one while the worker is idle, as a rename needs them all."""
        uri = next(iter(self._open), "")
        files = self.files(uri)
        for path in files.all():
            files.names(path)
            yield

    def _check(self, uri: str, *, places: bool) -> None:
        for also_places in (False, True) if places else (False,):
            document = self._open.get(uri)
            if document is None:
                return
            diagnostics = self.find(uri, document.text, places=also_places)
            with self._news:
                now = self._open.get(uri)
                if now is None or now.version != document.version or self._stopped:
                    return  # the text has changed meanwhile; its own check is due
            self._publish(uri, list(self._published(document, diagnostics)), document.version)
        for method in self.refreshes:
            self._requests += 1
            self.connection.ask(self._requests, method)

    def _publish(self, uri: str, diagnostics: list[Json], version: int | None) -> None:
        params: Json = {"uri": uri, "diagnostics": diagnostics}
        if version is not None:
            params["version"] = version
        self.connection.notify("textDocument/publishDiagnostics", params)

    def _published(self, document: Open, diagnostics: tuple[Diagnostic, ...]) -> Iterator[Json]:
        here = self._places(document.text)
        elsewhere: dict[Path, list[Diagnostic]] = {}
        for diagnostic in diagnostics:
            file = absolute(Path(diagnostic.path)) if diagnostic.path else document.path
            if file == document.path:
                yield diagnostic_json(diagnostic, here.range(diagnostic.span))
            else:
                elsewhere.setdefault(file, []).append(diagnostic)
        for file, errors in elsewhere.items():
            yield self._of_another(document, here, file, errors)

    def _of_another(self, document: Open, here: Positions, file: Path, diagnostics: list[Diagnostic]) -> Json:
        """Return the diagnostic of another file's errors, at the place where this document names that file."""
        files = self.files(document.uri)
        folder = document.path.parent
        uses = (o.span for o in files.names(document.path) if o.kind == "file" and absolute(folder / o.name) == file)
        there = self._places(files.text(file) or "")
        first = next((d for d in diagnostics if d.severity == "error"), diagnostics[0])
        message = f"'{file.name}' has an error: {first.message}"
        moved = Diagnostic(first.code, message, "", str(document.path), severity=first.severity)
        pointer = diagnostic_json(moved, here.range(next(uses, None)))
        pointer["relatedInformation"] = [
            {
                "location": {"uri": self.uri(file), "range": there.range(d.span)},
                "message": f"{d.code}: {d.message}",
            }
            for d in diagnostics
        ]
        return pointer


def with_help(diagnostic: Diagnostic) -> str:
    """Return a diagnostic's message, and its help on the next line."""
    return f"{diagnostic.message}\n{diagnostic.help}" if diagnostic.help else diagnostic.message


def diagnostic_json(diagnostic: Diagnostic, where: Json) -> dict[str, Any]:
    """Return a diagnostic in the protocol's form."""
    return {
        "range": where,
        "message": with_help(diagnostic),
        "severity": _WARNING if diagnostic.severity == "warning" else _ERROR,
        "code": diagnostic.code,
        "source": SOURCE,
    }
