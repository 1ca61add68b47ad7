"""Converts places of a text: an editor counts from 0, in UTF-16 units or code points; we count from 1, in code
points."""

from __future__ import annotations

from typing import Literal

from foresee_dsl.editor.protocol.rpc import Json
from foresee_dsl.errors import Span
from foresee_dsl.language.parser import plain

Encoding = Literal["utf-16", "utf-32"]
_BEYOND_16 = "\uffff"


class Positions:
    """Converts an editor's positions in one text to ours, and back."""

    def __init__(self, text: str, encoding: Encoding = "utf-16") -> None:
        self.lines = plain(text).split("\n")
        self._wide = encoding == "utf-16"
        # A byte order mark is a character for the editor, but not for the parser.
        self._mark = 1 if text.startswith("\ufeff") else 0

    def _units(self, text: str) -> int:
        if not self._wide or text.isascii():
            return len(text)
        return len(text) + sum(letter > _BEYOND_16 for letter in text)

    def position(self, line: int, column: int) -> Json:
        """Return the editor's position of a line and column; a place behind the text is its end."""
        if line > len(self.lines):
            line, column = len(self.lines), len(self.lines[-1]) + 1
        before = self.lines[line - 1][: max(column - 1, 0)]
        return {"line": line - 1, "character": self._units(before) + (self._mark if line == 1 else 0)}

    def range(self, span: Span | None) -> Json:
        """Return the editor's range of a span; for None, the range of the first line."""
        if span is None:
            span = Span(1, 1, 1, len(self.lines[0]) + 1)
        return {
            "start": self.position(span.line, span.column),
            "end": self.position(span.end_line, span.end_column),
        }

    def whole(self) -> Json:
        """Return the range of the whole text, its byte order mark left out."""
        return self.range(Span(1, 1, len(self.lines), len(self.lines[-1]) + 1))

    def place(self, position: Json) -> tuple[int, int]:
        """Return the line and column (1-based) of an editor's position; a place behind a line is its end."""
        row = int(position["line"])
        if row >= len(self.lines):
            return len(self.lines), len(self.lines[-1]) + 1
        line = self.lines[row]
        left = int(position["character"]) - (self._mark if row == 0 else 0)
        column = 0
        while column < len(line) and left > 0:
            left -= self._units(line[column])
            column += 1
        return row + 1, column + 1

    def offset(self, position: Json) -> int:
        """Return the offset in the plain text of an editor's position."""
        line, column = self.place(position)
        return sum(len(text) + 1 for text in self.lines[: line - 1]) + column - 1

    def span(self, where: Json) -> Span:
        """Return the span of an editor's range."""
        return Span(*self.place(where["start"]), *self.place(where["end"]))
