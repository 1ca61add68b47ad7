"""Between an editor's positions (0-based, UTF-16 or what was agreed on) and ours (1-based code points)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lsprotocol.types import Position, Range

from foresee_dsl.editor.syntax import plain
from foresee_dsl.errors import Span

if TYPE_CHECKING:
    from pygls.workspace import PositionCodec


class Positions:
    """The places of one text.

    Args:
        text: as the editor holds it.
        codec: counts the units that client and server agreed on.
    """

    def __init__(self, text: str, codec: PositionCodec) -> None:
        self.lines = plain(text).split("\n")
        self._codec = codec
        # A byte order mark is a character to the editor and none to the parser.
        self._mark = codec.client_num_units("\ufeff") if text.startswith("\ufeff") else 0

    def position(self, line: int, column: int) -> Position:
        """Return the editor's position of a line and column; a place behind the text is its end."""
        if line > len(self.lines):
            line, column = len(self.lines), len(self.lines[-1]) + 1
        before = self.lines[line - 1][: max(column - 1, 0)]
        return Position(line - 1, self._codec.client_num_units(before) + (self._mark if line == 1 else 0))

    def range(self, span: Span | None) -> Range:
        """Return the editor's range of a span; of None, the first line."""
        if span is None:
            return Range(self.position(1, 1), self.position(1, len(self.lines[0]) + 1))
        return Range(self.position(span.line, span.column), self.position(span.end_line, span.end_column))

    def whole(self) -> Range:
        """Return the range of the whole text, its byte order mark left out."""
        return Range(self.position(1, 1), self.position(len(self.lines), len(self.lines[-1]) + 1))

    def place(self, position: Position) -> tuple[int, int]:
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

    def offset(self, position: Position) -> int:
        """Return the offset in the plain text of an editor's position."""
        line, column = self.place(position)
        return sum(len(text) + 1 for text in self.lines[: line - 1]) + column - 1

    def text(self, where: Range) -> str:
        """Return what stands in a range."""
        return "\n".join(self.lines)[self.offset(where.start) : self.offset(where.end)]
