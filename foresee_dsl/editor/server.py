"""The language server: handles the messages of a session and maps requests to functions."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, BinaryIO, Literal

from foresee_dsl import __version__
from foresee_dsl.editor.protocol.rpc import LATER, Connection, Handler, Json, RequestError, serve
from foresee_dsl.editor.protocol.tokens import TOKEN_MODIFIERS, TOKEN_TYPES
from foresee_dsl.editor.session import Session, path_of

if TYPE_CHECKING:
    from foresee_dsl.editor.protocol.positions import Encoding

COMMANDS = ("foresee.run", "foresee.forecast", "foresee.draw")
"""Commands that code lenses call; the editor's extension carries them out."""

ANSWERED = (
    "textDocument/completion",
    "textDocument/hover",
    "textDocument/definition",
    "textDocument/references",
    "textDocument/prepareRename",
    "textDocument/rename",
    "textDocument/formatting",
    "textDocument/documentSymbol",
    "textDocument/foldingRange",
    "textDocument/codeAction",
    "textDocument/semanticTokens/full",
    "textDocument/inlayHint",
    "textDocument/codeLens",
)
"""Requests that a function of `editor.features` answers. That module is imported at the first of them, so that errors
are shown before."""


class Server:
    """The server of one client: a session and its handlers."""

    def __init__(self, reader: BinaryIO, writer: BinaryIO) -> None:
        self._connection = Connection(reader, writer)
        self._session = Session(self._connection)
        self._drawing = ThreadPoolExecutor(max_workers=1, thread_name_prefix="drawing")

    def run(self) -> Literal[0, 1]:
        """Answer until the client leaves; return 0 if it left as the protocol requires, else 1."""
        handlers: dict[str, Handler] = {
            "initialize": self._initialize,
            "shutdown": lambda _: self._session.stop(),
            "textDocument/didOpen": self._opened,
            "textDocument/didChange": self._changed,
            "textDocument/didSave": lambda params: self._session.check_soon(params["textDocument"]["uri"], places=True),
            "textDocument/didClose": lambda params: self._session.close(params["textDocument"]["uri"]),
            "workspace/didChangeWorkspaceFolders": self._folders,
            "foresee/draw": self._draw,
            "foresee/page": self._page,
            **{method: self._feature(method) for method in ANSWERED},
        }
        try:
            return serve(self._connection, handlers, lambda: self._session.begun)
        finally:
            self._session.stop()
            self._drawing.shutdown(wait=False, cancel_futures=True)

    # ---- the session ----------------------------------------------------------------------------------------------

    def _initialize(self, params: Json) -> Json:
        capabilities = params.get("capabilities") or {}
        encodings = (capabilities.get("general") or {}).get("positionEncodings") or ()
        encoding: Encoding = "utf-32" if "utf-32" in encodings else "utf-16"
        folders = params.get("workspaceFolders") or []
        if not folders and params.get("rootUri"):
            folders = [{"uri": params["rootUri"]}]
        workspace = capabilities.get("workspace") or {}
        wanted = (("inlayHint", "workspace/inlayHint/refresh"), ("codeLens", "workspace/codeLens/refresh"))
        refreshes = tuple(method for key, method in wanted if (workspace.get(key) or {}).get("refreshSupport"))
        self._session.begin(encoding=encoding, folders=folders, refreshes=refreshes)
        return {"capabilities": _capabilities(encoding), "serverInfo": {"name": "foresee", "version": __version__}}

    def _folders(self, params: Json) -> None:
        for folder in params["event"].get("removed", ()):
            self._session.folders.pop(folder["uri"], None)
        for folder in params["event"].get("added", ()):
            self._session.folders[folder["uri"]] = path_of(folder["uri"])

    def _opened(self, params: Json) -> None:
        document = params["textDocument"]
        self._session.put(document["uri"], document["text"], document.get("version", 0))
        self._session.check_soon(document["uri"], places=True)

    def _changed(self, params: Json) -> None:
        document = params["textDocument"]
        for change in params["contentChanges"]:
            # We ask for whole texts, not changes: files are short, and lines then end by our rules.
            self._session.put(document["uri"], change["text"], document.get("version") or 0)
        self._session.check_soon(document["uri"], places=False)

    # ---- requests -------------------------------------------------------------------------------------------------

    def _feature(self, method: str) -> Handler:
        def handle(params: Json) -> object:
            self._session.answering = True
            try:
                from foresee_dsl.editor.features import ANSWERS

                return ANSWERS[method](self._session, params)
            finally:
                self._session.answering = False

        return handle

    def _page(self, params: Json) -> Json:
        from foresee_dsl.report.picture.draw import page_of

        nonce = str(params.get("nonce", ""))
        if not nonce.replace("-", "").replace("_", "").isalnum():
            raise RequestError("the page needs a nonce of letters and digits")
        return {"html": page_of(nonce, title="foresee", connect="")}

    def _draw(self, params: Json) -> object:
        """Draw in another thread, as netconvert takes some tenths of a second for a new network."""
        path, overlay, request = path_of(params["textDocument"]["uri"]), self._session.overlay(), params["foresee/id"]
        if isinstance(params.get("text"), str):
            overlay[path] = params["text"]

        def work() -> None:
            try:
                from foresee_dsl.report.picture.draw import answer

                case, width = str(params.get("case") or ""), float(params.get("width") or 720)
                picture = answer(path, overlay, case=case, width=width, whole=bool(params.get("whole")))
                self._connection.reply(request, picture)
            except Exception as error:  # our own faults are answered too, as the page would wait for ever
                message = f"foresee has a fault: {type(error).__name__}: {error}"
                mistake = {"message": message, "path": "", "line": 0, "column": 0}
                self._connection.reply(request, {"svg": None, "mistakes": [mistake]})

        self._drawing.submit(work)
        return LATER


def _capabilities(encoding: str) -> Json:
    return {
        "positionEncoding": encoding,
        "textDocumentSync": {"openClose": True, "change": 1, "save": {"includeText": False}},
        "completionProvider": {"triggerCharacters": [" ", ".", '"', "(", "[", "/"]},
        "hoverProvider": True,
        "definitionProvider": True,
        "referencesProvider": True,
        "renameProvider": {"prepareProvider": True},
        "documentFormattingProvider": True,
        "documentSymbolProvider": True,
        "foldingRangeProvider": True,
        "codeActionProvider": {"codeActionKinds": ["quickfix"]},
        "semanticTokensProvider": {
            "legend": {"tokenTypes": list(TOKEN_TYPES), "tokenModifiers": list(TOKEN_MODIFIERS)},
            "full": True,
        },
        "inlayHintProvider": True,
        "codeLensProvider": {"resolveProvider": False},
        "workspace": {"workspaceFolders": {"supported": True, "changeNotifications": True}},
        "experimental": {"foresee/draw": True, "foresee/page": True},
    }


def serve_streams(reader: BinaryIO, writer: BinaryIO) -> Literal[0, 1]:
    """Serve one client over two byte streams, until it leaves."""
    return Server(reader, writer).run()


def serve_port(host: str, port: int, listens: Callable[[], None]) -> Literal[0, 1]:
    """Serve the first client that connects to a port, until it leaves; `listens` is called as soon as a client can
    connect.
    """
    import socket

    with socket.create_server((host, port)) as listening:
        listens()
        client, _ = listening.accept()
    with client, client.makefile("rb") as reader, client.makefile("wb") as writer:
        return Server(reader, writer).run()
