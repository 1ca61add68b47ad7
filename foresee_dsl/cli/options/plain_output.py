"""Makes output harmless, so that text from files cannot control the terminal or reverse the writing direction.

File names, documents and messages of drivers are printed in many places. So the two streams themselves replace control
codes and direction marks by Python's escapes (`\x1b`, `\u202e`); only our own colours pass.
"""

from __future__ import annotations

import io
import os
import re
import sys
import unicodedata
from collections.abc import Iterable
from functools import cache
from typing import IO, TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from rich.console import Console
    from typing_extensions import Buffer

_SUSPECT = re.compile(r"[^\n\t\x20-\x7e]")
_COLOUR = re.compile(r"(\x1b\[(?:\d{1,3}(?:;\d{1,3})*)?m)")
"""Escape sequences that set colours. Other sequences move the cursor, set titles or fill the clipboard, and do not
pass."""


def plain(text: str) -> str:
    """Return a text with control codes and invisible characters replaced by escapes; newlines and tabs remain."""
    return _SUSPECT.sub(_written, text) if _SUSPECT.search(text) else text


def _written(match: re.Match[str]) -> str:
    character = match.group()
    if unicodedata.category(character) in ("Cc", "Cf", "Cs", "Zl", "Zp"):
        return character.encode("unicode_escape", "surrogatepass").decode("ascii")
    return character


class PlainStream:
    """A text stream that makes everything it writes harmless; `trusted` is the underlying stream."""

    def __init__(self, stream: IO[str]) -> None:
        self.trusted = stream

    def write(self, text: str) -> int:
        """Write a text; colours pass if a terminal or git's pager shows them."""
        if "\x1b" in text and (self.trusted.isatty() or "GIT_PAGER_IN_USE" in os.environ):
            parts = _COLOUR.split(text)
            self.trusted.write("".join(part if k % 2 else plain(part) for k, part in enumerate(parts)))
        else:
            self.trusted.write(plain(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write several texts."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any attribute of the underlying stream
        return getattr(self.trusted, name)


def exact() -> IO[str]:
    """Return the unfiltered standard output, for a document that another program reads or for our own pictures."""
    return cast("IO[str]", getattr(sys.stdout, "trusted", sys.stdout))


NO_READER = 141
"""Exit code if the reader of the output has gone (`| head`): the same that a shell reports for a program that SIGPIPE
ends. The signal itself would also end a campaign when the process of a driver closes its pipe.
"""


class _UntilClosed(io.FileIO):
    """A standard stream: the first write after its reader has gone ends the command quietly, and later ones are
    dropped.

    Typer and rich catch a closed pipe themselves and exit with 1 (seen in typer 0.29 and rich 15), so this class raises
    `SystemExit` instead of `OSError`.
    """

    _gone = False

    def write(self, data: Buffer, /) -> int:
        """Write the data, or end the process if the reader has gone.

        Raises:
            SystemExit: the reader has just gone.
        """
        if not self._gone:
            try:
                return super().write(data)
            except BrokenPipeError:
                self._gone = True
                raise SystemExit(NO_READER) from None
        return memoryview(data).nbytes


def guard_streams() -> None:
    """Replace this process's standard output and error by streams that make text harmless, and that end the process
    quietly once they have no reader any more.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None or isinstance(stream, PlainStream):
            continue
        if isinstance(stream, io.TextIOWrapper):
            file = _UntilClosed(stream.fileno(), "w", closefd=False)
            buffer = cast("io.BufferedWriter", file) if stream.write_through else io.BufferedWriter(file)
            stream = io.TextIOWrapper(
                buffer,
                stream.encoding,
                stream.errors,
                line_buffering=stream.line_buffering,
                write_through=stream.write_through,
            )
        setattr(sys, name, PlainStream(stream))


def harmless_console(*, error: bool = False, **settings: Any) -> Console:  # noqa: ANN401 - rich's own
    """Return a rich console that makes texts harmless, while rich's own codes for colours and progress bars pass."""
    stream = sys.stderr if error else sys.stdout
    return cast("Console", _console_class()(file=getattr(stream, "trusted", None), stderr=error, **settings))


@cache
def _console_class() -> type[Any]:
    from rich.console import Console
    from rich.segment import Segment

    class Harmless(Console):
        def render(self, renderable: Any, options: Any = None) -> Any:  # noqa: ANN401 - rich's own type
            for segment in super().render(renderable, options):
                yield segment if segment.control else Segment(plain(segment.text), segment.style)

    return Harmless
