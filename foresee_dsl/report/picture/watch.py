"""`foresee draw --watch`: a local page that updates the picture whenever a file is saved."""

from __future__ import annotations

import json
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Lock
from typing import Any
from urllib.parse import parse_qs, urlsplit

from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import absolute, stamp_of, write_whole
from foresee_dsl.language.project import addresses as a
from foresee_dsl.report.drawing.svg import svg_of
from foresee_dsl.report.picture.draw import answer, draw, page_of

LOCAL = "127.0.0.1"
"""Only this machine may connect, because the page shows the contents of its files."""
_LOOK_S = 0.15
"""Time between two checks of the files, s. Ours: shorter than a blink; the checks of a few files take a thousandth of
the time of one core."""
_ALIVE_S = 15.0
"""Time after which an empty event is sent, s, because sending fails if the page was closed. Ours."""


@dataclass
class WatchedFile:
    """A file with all files on which its picture depends, and the answers that were computed for their current
    state.
    """

    file: Path
    case: str
    whole: bool
    allow_outside: bool
    _files: tuple[Path, ...] = ()
    _answers: dict[tuple[str, float, bool], dict[str, Any]] = field(default_factory=dict)
    _state: tuple[tuple[int, int] | None, ...] = ()
    _lock: Lock = field(default_factory=Lock)

    def state(self) -> tuple[tuple[int, int] | None, ...]:
        """Return the modification times and sizes of the files, which change when a file is saved."""
        return tuple(stamp_of(file) for file in (self.file, *self._files))

    def answer(self, case: str, width: float, *, whole: bool) -> dict[str, Any]:
        """Return the picture of the current files, computed once for each combination of arguments."""
        with self._lock:
            if (now := self.state()) != self._state:
                self._answers.clear()
            key = (case, width, whole)
            if key not in self._answers:
                self._answers[key] = reply = answer(
                    self.file, case=case, width=width, whole=whole, allow_outside=self.allow_outside
                )
                self._files = tuple(map(Path, reply["files"])) if reply["svg"] else self._files
                self._state = self.state() if reply["svg"] else now
            return self._answers[key]


def watch(
    address: str, *, svg: Path | None, whole: bool, port: int, allow_outside: bool, say: Callable[[str], None]
) -> None:
    """Serve the picture of an address until the process ends; `svg`: a file that is updated too.

    Raises:
        InputError: the file does not exist. ForeseeError: the port cannot be used.
    """
    file, case = a.parse_address(address)
    if not a.is_file(file):
        raise a.missing(file)
    watched = WatchedFile(absolute(file), case or "", whole, allow_outside)
    token = secrets.token_urlsafe(24)
    try:
        server = ThreadingHTTPServer((LOCAL, port), _handler(watched, token))
    except OSError as err:
        raise ForeseeError(f"port {port} cannot be used: {err.strerror}; --port 0 chooses a free port") from err
    server.daemon_threads = True
    say(f"the picture is at http://{LOCAL}:{server.server_port}/{token}/ (Ctrl-C ends)")
    if svg is not None:
        from threading import Thread

        Thread(target=_rewrite, args=(watched, address, svg, allow_outside, say), daemon=True).start()
    with server:
        server.serve_forever(poll_interval=0.2)


def _rewrite(watched: WatchedFile, address: str, svg: Path, allow_outside: bool, say: Callable[[str], None]) -> None:
    """Write the SVG file again whenever a file of the picture has changed."""
    last: object = None
    while True:
        watched.answer(watched.case, 720.0, whole=watched.whole)  # finds all files on which the picture depends
        if (now := watched.state()) != last:
            last = now
            try:
                drawing = draw(address, whole=watched.whole, allow_outside=allow_outside)
                write_whole(svg, svg_of(drawing.sheet))
            except (ForeseeError, OSError) as err:
                say(f"{svg} was not written again: {err}")
            else:
                say(f"wrote {svg}")
        time.sleep(_LOOK_S)


def _handler(watched: WatchedFile, token: str) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        """Serves the page and its events.

        It answers only requests that contain the token and address this machine by one of its own names.
        """

        protocol_version = "HTTP/1.1"
        server_version = "foresee"
        sys_version = ""

        def do_GET(self) -> None:
            """Answer a request."""
            parts = urlsplit(self.path)
            _, path_token, *rest = (*parts.path.split("/"), "", "")
            host = (self.headers.get("Host") or "").rpartition(":")[0]
            # A page of another site may reach this port under a host name of its own; such a request is refused.
            if host not in (LOCAL, "localhost") or not secrets.compare_digest(path_token.encode(), token.encode()):
                self._send(404, "text/plain; charset=utf-8", b"nothing is here\n")
            elif rest[0] == "events":
                self._events({key: values[-1] for key, values in parse_qs(parts.query).items()})
            elif rest[0] == "":
                nonce = secrets.token_urlsafe(18)
                page = page_of(nonce, title=watched.file.name, connect="events")
                self._send(200, "text/html; charset=utf-8", page.encode())
            else:
                self._send(404, "text/plain; charset=utf-8", b"nothing is here\n")

        def _send(self, status: int, kind: str, body: bytes) -> None:
            self.send_response(status)
            self._safe_headers(kind)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def _safe_headers(self, kind: str) -> None:
            self.send_header("Content-Type", kind)
            self.send_header("Cache-Control", "no-store")
            self.send_header("X-Content-Type-Options", "nosniff")
            self.send_header("Referrer-Policy", "no-referrer")
            self.send_header("X-Frame-Options", "DENY")
            self.send_header("Cross-Origin-Resource-Policy", "same-origin")

        def _events(self, wish: dict[str, str]) -> None:
            self.send_response(200)
            self._safe_headers("text/event-stream; charset=utf-8")
            self.send_header("Connection", "close")
            self.end_headers()
            self.close_connection = True
            width = float(wish["width"]) if wish.get("width", "").isdigit() else 720.0
            case, whole = wish.get("case") or watched.case, watched.whole or bool(wish.get("whole"))
            sent: object = None
            spoke_s = time.monotonic()
            try:
                while True:
                    reply = watched.answer(case, width, whole=whole)
                    if reply is not sent:
                        sent = reply
                        self.wfile.write(f"data: {json.dumps(reply)}\n\n".encode())
                        self.wfile.flush()
                        spoke_s = time.monotonic()
                    elif time.monotonic() - spoke_s > _ALIVE_S:
                        self.wfile.write(b": still here\n\n")
                        self.wfile.flush()
                        spoke_s = time.monotonic()
                    time.sleep(_LOOK_S)
            except OSError:
                return  # the user has closed the page

        def log_message(self, format: str, *args: object) -> None:
            """Write no log, because the address contains the token."""

    return Handler
