"""What a command prints, made harmless: texts from files cannot steer a terminal or turn what is shown around.

File names, documents and drivers' words are printed in many places. So the two streams themselves write a control code
or a sign that changes the direction of writing as Python does (`\\x1b`, `\\u202e`); only our own colours pass.
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
"""Of all that a terminal obeys, the sequences that set colours: others move the cursor, set titles, fill the
clipboard."""


def plain(text: str) -> str:
    """Return a text without control codes and hidden signs, which are written out; line ends and tabs stay."""
    return _SUSPECT.sub(_written, text) if _SUSPECT.search(text) else text


def _written(found: re.Match[str]) -> str:
    sign = found.group()
    if unicodedata.category(sign) in ("Cc", "Cf", "Cs", "Zl", "Zp"):
        return sign.encode("unicode_escape", "surrogatepass").decode("ascii")
    return sign


class PlainStream:
    """A text stream that writes what it is given in harmless form; `trusted` is the stream behind it."""

    def __init__(self, stream: IO[str]) -> None:
        self.trusted = stream

    def write(self, text: str) -> int:
        """Write a text; colours pass where somebody sees them."""
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

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the stream behind it has
        return getattr(self.trusted, name)


def exact() -> IO[str]:
    """Return standard output as it is, for a document that another program reads, or for pictures of our own."""
    return cast("IO[str]", getattr(sys.stdout, "trusted", sys.stdout))


NO_READER = 141
"""Exit code where the reader of the output has gone (`| head`): what a shell reports of a program that SIGPIPE ends.
The signal itself would also end a campaign whose driver's process closes its pipe."""


class _UntilClosed(io.FileIO):
    """A standard stream: the first write without a reader ends the command quietly, later ones are dropped.

    Typer and rich catch a closed pipe themselves and end with 1 (seen in typer 0.29 and rich 15), so that it is no
    `OSError` here.
    """

    _gone = False

    def write(self, data: Buffer, /) -> int:
        """Write, or leave.

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
    """Make this process's standard output and error harmless; without a reader they end the process quietly."""
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
    """Return a rich console whose texts are harmless, while what rich itself writes for colours and bars passes."""
    stream = sys.stderr if error else sys.stdout
    return cast("Console", _console_class()(file=getattr(stream, "trusted", None), stderr=error, **settings))


@cache
def _console_class() -> type[Any]:
    from rich.console import Console
    from rich.segment import Segment

    class Harmless(Console):
        def render(self, renderable: Any, options: Any = None) -> Any:  # noqa: ANN401 - as rich has it
            for segment in super().render(renderable, options):
                yield segment if segment.control else Segment(plain(segment.text), segment.style)

    return Harmless
