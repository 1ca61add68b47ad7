"""Cuts a text, with or without errors, into statements by its braces and lines, so that each can be parsed on its
own."""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass, field
from functools import cache
from typing import get_args

from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.helps import HelpText, close_block, meant_code, remove, write
from foresee_dsl.language import model as m

_PIECE = re.compile(r'"[^"\n]*"?|#[^\n]*|\n|[{};\[\]]|[^ \t\n"#{};\[\]]+')
_HAS_BLOCK = re.compile(r"(?:when|if|while|whenever|upon|then(?!\s+joins\b))\b(?!\s*=(?!=))")
"""First words of statements whose block is recognised by its indentation even without braces, because the actions in it
are not allowed elsewhere. In a case, `when = 3 s` gives a value to a parameter of that name."""
_SECOND_WORD = re.compile(r"\w+\s+(\w+)")
_NEXT_LINE = re.compile(r"(?:\n[ \t]*(?:#[^\n]*)?)*\n(?P<indent> +)(?=[^\s#}])")
_ALLOW = re.compile(r"#\s*foresee:\s*allow\b([^\n]*)")
_ENDS_OF_LISTS = ("]", "{", "}", ";")
MOST = 100
"""Number of errors after which a text is not searched further (ours: more are not read, and a broken file must not take
minutes)."""
_SHOWN = 3
"""Maximum number of unclosed blocks that are reported one by one (ours: one missing brace can leave all blocks
open)."""
_PLAUSIBLE = 3
"""If the indentation suggests more missing braces than this, the file counts as not indented (ours)."""


@cache
def _verbs() -> frozenset[str]:
    """Return the words that follow the name of an actor or a signal in an action."""
    actions: tuple[type[m.Item], ...] = get_args(get_args(m.Action)[0])
    verbs = (re.match(r"\{\w+\} (\w+)", kind.pattern) for kind in actions)
    return frozenset(verb[1] for verb in verbs if verb is not None)


@dataclass(slots=True)
class Raw:
    """A statement as text: the offsets of its head, and the statements in its braces (None if it has no braces)."""

    start: int
    end: int
    block: list[Raw] | None = None
    open: int = -1
    close: int = -1


@dataclass(frozen=True, slots=True)
class Comment:
    """A comment with its `#`, and the 1-based line and column at which it begins."""

    text: str
    line: int
    column: int

    @property
    def allow(self) -> re.Match[str] | None:
        """The match of `# foresee: allow FS301`, with what follows `allow` as its group; None for another comment."""
        return _ALLOW.match(self.text)


class Lines:
    """Turns offsets into lines and columns."""

    def __init__(self, text: str) -> None:
        self._starts = [0, *(m.end() for m in re.finditer(r"\n", text))]
        self._length = len(text)

    def place(self, offset: int) -> tuple[int, int]:
        """Return the 1-based line and column of an offset."""
        offset = min(max(offset, 0), self._length)
        line = bisect_right(self._starts, offset)
        return line, offset - self._starts[line - 1] + 1

    def offset(self, line: int, column: int) -> int:
        """Return the offset of a 1-based line and column."""
        return min(self._starts[min(line, len(self._starts)) - 1] + column - 1, self._length)

    def span(self, start: int, end: int) -> Span:
        """Return the span between two offsets."""
        return Span(*self.place(start), *self.place(end))


@dataclass(frozen=True, slots=True)
class CutText:
    """A text that was cut: its lines, its statements, the errors of its braces, and its comments, in order."""

    text: str
    lines: Lines
    statements: list[Raw]
    errors: list[Diagnostic]
    comments: list[Comment]


@dataclass(slots=True)
class _Frame:
    """An open block: its statement, the indentation of the statement in columns, and the block's statements so far."""

    raw: Raw
    indent: int
    statements: list[Raw] = field(default_factory=list)
    without_brace: bool = False
    """True if its opening brace is missing, so that the indentation determines where it ends."""


def scan(text: str) -> CutText:
    """Cut a text into statements.

    If the braces do not balance, the indentation tells where each block should end.
    """
    lines = Lines(text)
    scanner = _Scanner(text, lines, trust_indentation=False)
    cut = scanner.run()
    if scanner.balanced:
        return cut
    repaired = _Scanner(text, lines, trust_indentation=True)
    by_indentation = repaired.run()
    indented = 0 < repaired.wrong <= max(_PLAUSIBLE, scanner.wrong)
    return by_indentation if indented else cut


class _Scanner:
    def __init__(self, text: str, lines: Lines, *, trust_indentation: bool) -> None:
        self.errors: list[Diagnostic] = []
        self.balanced = True
        self._text = text
        self._lines = lines
        self._trusting = trust_indentation
        self._open_blocks: list[Raw] = []
        self._stack = [_Frame(Raw(0, 0), -1)]  # the file itself
        self._current: Raw | None = None
        self._after_brace = False
        self._in_list = False
        self._list_end, self._list_closed = -1, False
        self._line_start, self._first_on_line = 0, -1
        self._comments: list[Comment] = []

    @property
    def wrong(self) -> int:
        """Return the number of errors, including those that are not reported."""
        return len(self.errors) + max(len(self._open_blocks) - _SHOWN - 1, 0)

    def run(self) -> CutText:
        for piece in _PIECE.finditer(self._text):
            self._take(piece[0], piece.start())
        while len(self._stack) > 1:
            self._unclosed(len(self._text))
        self._few_of_the_unclosed()
        return CutText(self._text, self._lines, self._stack[0].statements, self.errors, self._comments)

    def _take(self, piece: str, at: int) -> None:
        if piece[0] == "#":
            self._comments.append(Comment(piece, *self._lines.place(at)))
            return
        if piece == "\n":
            if not (self._in_list and self._list_continues(at)):
                if self._current is not None:
                    self._open_without_brace(self._current, at)
                self._end()
            self._line_start, self._first_on_line = at + 1, -1
            return
        if self._first_on_line < 0:
            self._first_on_line = at
        if piece == ";":
            self._end()
        elif piece == "{":
            self._open(at)
        elif piece == "}":
            self._close(at)
        else:
            if piece in "[]":
                self._in_list = piece == "["
            self._word(at, at + len(piece))

    def _end(self) -> None:
        self._current, self._after_brace, self._in_list = None, False, False

    def _list_continues(self, at: int) -> bool:
        """Return whether the list that is open at the end of a line is closed on a later line."""
        if at > self._list_end:  # one search serves all lines of a list
            pieces = _PIECE.finditer(self._text, at)
            end = next((piece for piece in pieces if piece[0] in _ENDS_OF_LISTS), None)
            self._list_end = end.start() if end is not None else len(self._text)
            self._list_closed = end is not None and end[0] == "]"
        return self._list_closed

    def _word(self, start: int, end: int) -> Raw:
        if self._current is None:
            indent = self._indent(start)
            while self._stack[-1].without_brace and indent is not None and indent <= self._stack[-1].indent:
                self._stack.pop().raw.close = start
            while self._trusting and indent is not None and len(self._stack) > 1 and indent <= self._stack[-1].indent:
                self._unclosed(start)
            if self._after_brace and len(self.errors) < MOST:
                help = "begin a new line, or write " + write(";") + " between them"
                self.errors.append(
                    Diagnostic.of("FS003", "this line has two statements", help, span=self._lines.span(start, end))
                )
                self._after_brace = False
            self._current = Raw(start, end)
            self._stack[-1].statements.append(self._current)
        self._current.end = end
        return self._current

    def _open(self, at: int) -> None:
        raw = self._current or self._word(at, at)
        raw.block, raw.open = [], at
        self._stack.append(_Frame(raw, self._first_on_line - self._line_start, raw.block))
        self._end()

    def _open_without_brace(self, raw: Raw, at: int) -> None:
        """Open the block of a trigger whose brace is missing (or is Python's `:`), if the next line is indented
        further."""
        if raw.block is not None or _HAS_BLOCK.match(self._text, raw.start, raw.end) is None:
            return
        second = _SECOND_WORD.match(self._text, raw.start, raw.end)
        if second is not None and second[1] in _verbs():
            return  # it may be an action of an actor that is called `if`
        ahead = _NEXT_LINE.match(self._text, at)
        indent = self._first_on_line - self._line_start
        if ahead is None or len(ahead["indent"]) <= indent or raw.start != self._first_on_line:
            return
        colon = self._text[raw.end - 1] == ":"
        place = self._lines.span(raw.end - colon, raw.end + (not colon))
        message = "a block needs braces" if colon else "the `{` of this block is missing"
        help: HelpText = "write `{` instead" if colon else "write `{` at the end of this line"
        closing = re.compile(rf"(?:\n[ \t]*(?:#[^\n]*)?)*(?:\n {{{indent + 1},}}[^\n]*|\n[ \t]*)*\n {{{indent}}}\}}")
        if closing.match(self._text, at) is None:
            help += ", and a `}` below the block"
        elif colon:
            help = meant_code("{")
        self.errors.append(Diagnostic.of("FS003", message, help, span=place))
        raw.end -= colon
        while raw.end > raw.start and self._text[raw.end - 1] == " ":
            raw.end -= 1
        raw.block, raw.open = [], raw.end
        self._stack.append(_Frame(raw, indent, raw.block, without_brace=True))

    def _close(self, at: int) -> None:
        indent = self._indent(at)
        while self._stack[-1].without_brace and indent is not None and indent < self._stack[-1].indent:
            self._stack.pop().raw.close = at
        while self._trusting and indent is not None and len(self._stack) > 2 and indent < self._stack[-1].indent:
            self._unclosed(at)
        self._end()
        if len(self._stack) == 1 or (self._trusting and indent is not None and indent > self._stack[-1].indent):
            self.balanced = False
            if not any(error.code == "FS007" for error in self.errors):
                place = self._lines.span(at, at + 1)
                self.errors.append(
                    Diagnostic.of("FS007", "this `}` has no `{`", remove("remove it") + ", or add the `{`", span=place)
                )
            return
        self._stack.pop().raw.close = at + 1
        self._after_brace = True

    def _unclosed(self, at: int) -> None:
        raw = self._stack.pop().raw
        raw.close = at
        self.balanced = False
        self._end()
        self._open_blocks.append(raw)

    def _few_of_the_unclosed(self) -> None:
        """Report the outermost unclosed blocks one by one, and the number of the others."""
        unclosed = sorted(self._open_blocks, key=lambda raw: raw.start)
        for raw in unclosed[:_SHOWN]:
            name = self._text[raw.start : raw.end].split(" ", maxsplit=1)[0].rstrip(":")[:40]
            message = f"the block of `{name}` is not closed"
            help = close_block("add a `}` where it ends")
            self.errors.append(Diagnostic.of("FS007", message, help, span=self._head(raw)))
        more = len(unclosed) - _SHOWN
        if more > 0:
            what = "1 more block is" if more == 1 else f"{more} more blocks are"
            help = close_block("close the outermost ones first", more)
            self.errors.append(Diagnostic.of("FS007", f"{what} not closed", help, span=self._head(unclosed[_SHOWN])))

    def _head(self, raw: Raw) -> Span:
        """Return the span of a statement up to its opening brace."""
        return self._lines.span(raw.start, raw.open + 1)

    def _indent(self, at: int) -> int | None:
        """Return the indentation at an offset, in columns; None if other text is before it on its line."""
        return at - self._line_start if at == self._first_on_line else None
