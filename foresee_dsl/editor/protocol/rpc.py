"""Implements JSON-RPC 2.0 with the framing of the Language Server Protocol over two byte streams; any thread may
answer.

This implementation is our own, because importing pygls 2.1 with lsprotocol, which creates 500 classes, takes 0.3 s: as
long as importing the whole language.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from typing import Any, BinaryIO, Literal

Json = dict[str, Any]
Handler = Callable[[Any], object]
"""A function that takes a message's parameters and returns the result (None for a notification)."""

METHOD_NOT_FOUND, INTERNAL_ERROR, INVALID_REQUEST, REQUEST_FAILED = -32601, -32603, -32600, -32803
"""Codes of JSON-RPC 2.0 (5.1) and of the protocol (3.17, `ErrorCodes`)."""
LARGEST_BYTES = 64_000_000
"""Largest message that is read, bytes. Ours: ten times the largest file of the language with all escapes."""


class RequestError(Exception):
    """Raised for a request that cannot be answered; the message is shown to the user."""


class LATER:
    """The return value of a handler that answers later, by `Connection.reply`."""


class Connection:
    """Both directions of one client."""

    def __init__(self, reader: BinaryIO, writer: BinaryIO) -> None:
        self._reader, self._writer = reader, writer
        self._lock = threading.Lock()

    def messages(self) -> Iterator[Json]:
        """Yield the client's messages until it disconnects; a message that is not JSON is answered with an error."""
        while (body := self._body()) is not None:
            try:
                message = json.loads(body)
            except ValueError:
                self._send({"id": None, "error": {"code": -32700, "message": "this is not JSON"}})
                continue
            if isinstance(message, dict):
                yield message

    def notify(self, method: str, params: Json) -> None:
        """Send a notification."""
        self._send({"method": method, "params": params})

    def ask(self, number: int, method: str) -> None:
        """Send a request without parameters and do not wait for its answer."""
        self._send({"id": number, "method": method, "params": None})

    def reply(self, request: int | str, result: object) -> None:
        """Answer a request."""
        self._send({"id": request, "result": result})

    def fail(self, request: int | str, code: int, message: str) -> None:
        """Answer a request with an error."""
        self._send({"id": request, "error": {"code": code, "message": message}})

    def _body(self) -> bytes | None:
        length = -1
        while True:
            line = self._reader.readline(10_000)
            if not line:
                return None
            if line in (b"\r\n", b"\n"):
                if length >= 0:
                    break
                continue
            name, _, value = line.partition(b":")
            if name.strip().lower() == b"content-length" and value.strip().isdigit():
                length = int(value)
        if length > LARGEST_BYTES:
            return None
        body = self._reader.read(length)
        return body if len(body) == length else None

    def _send(self, message: Json) -> None:
        body = json.dumps({"jsonrpc": "2.0", **message}, ensure_ascii=False, separators=(",", ":")).encode()
        with self._lock:
            try:
                self._writer.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
                self._writer.flush()
            except (OSError, ValueError):
                pass  # the client has disconnected; reading ends too


def serve(connection: Connection, handlers: dict[str, Handler], ready: Callable[[], bool]) -> Literal[0, 1]:
    """Answer a client until it sends `exit` or disconnects; return 0 if it sent `shutdown` before, else 1.

    `ready` returns whether the session has begun; before that, requests are refused. A handler gets the request's
    parameters; they contain the request's number as `"foresee/id"`, for a handler that returns `LATER`.
    """
    stopped = False
    for message in connection.messages():
        method, request = message.get("method"), message.get("id")
        if not isinstance(method, str):
            continue  # this is an answer to one of our requests
        if method == "exit":
            return 0 if stopped else 1
        handler = handlers.get(method)
        if request is None:
            if handler is not None and not stopped:
                _quietly(handler, message.get("params"))
            continue
        if stopped or (not ready() and method != "initialize"):
            connection.fail(request, INVALID_REQUEST, "the session has not begun, or is over")
        elif handler is None:
            connection.fail(request, METHOD_NOT_FOUND, f"no method {method}")
        else:
            _answer(connection, request, handler, message.get("params"))
            stopped = method == "shutdown"
    return 0 if stopped else 1


def _answer(connection: Connection, request: int | str, handler: Handler, params: object) -> None:
    numbered = {**params, "foresee/id": request} if isinstance(params, dict) else params
    try:
        result = handler(numbered)
    except RequestError as error:
        connection.fail(request, REQUEST_FAILED, str(error))
    except Exception as error:
        connection.fail(request, INTERNAL_ERROR, f"foresee has a fault: {type(error).__name__}: {error}")
        _report(error)
    else:
        if result is not LATER:
            connection.reply(request, result)


def _quietly(handler: Handler, params: object) -> None:
    try:
        handler(params)
    except Exception as error:  # a fault in one notification must not end the session
        _report(error)


def _report(error: Exception) -> None:
    import sys
    import traceback

    traceback.print_exception(error, file=sys.stderr)
