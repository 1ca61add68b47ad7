"""Odd layouts of a text, and a reading of where its comments and blank lines are that is no part of the formatter.

A text is cut into units: the head of a block with its `{`, a statement, or `}`. Behind a unit is a comment, and before
the next one a gap of comments and blank lines. The formatter may move units to other lines, but not comments and groups
to other units.
"""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

_PIECE = re.compile(r'"[^"\n]*"|#[^\n]*|\n|[{}();\[\],]|[^\s"#{}();\[\],]+|[ \t\r]+')


@dataclass
class Unit:
    """A unit of a text.

    Attributes:
        words: its text without blanks.
        behind: the comment behind it on its line; of a list over several lines, those inside it too.
        gap: the comments on lines of their own before the next unit; an empty string is a blank line or more.
        breaks: whether the next unit is on another line.
        spread: whether it stands on several lines itself (a list).
    """

    words: str
    behind: list[str] = field(default_factory=list)
    gap: list[str] = field(default_factory=list)
    breaks: bool = False
    spread: bool = False


class _Reader:
    def __init__(self) -> None:
        self.units = [Unit("")]
        self._words: list[str] = []
        self._inner: list[str] = []
        self._spread = False
        self._brackets = 0
        self._line_empty = True

    def take(self, piece: str) -> None:
        if piece == "\n":
            self._newline()
            return
        if piece.isspace():
            return
        if piece.startswith("#"):
            self._comment(piece[1:].strip())
        elif piece == ";":
            self.end()
        elif piece == "}":
            self.end()
            self.units.append(Unit("}"))
        else:
            self._brackets += {"[": 1, "]": -1}.get(piece, 0)
            self._words.append(piece)
            if piece == "{":
                self.end()
        self._line_empty = False

    def end(self) -> None:
        if self._words:
            words = "".join(self._words).replace(",]", "]")
            self.units.append(Unit(words, behind=self._inner, spread=self._spread))
        self._words, self._inner, self._spread = [], [], False

    def _comment(self, text: str) -> None:
        if self._brackets:
            self._inner.append(text)
        elif self._line_empty:
            self.units[-1].gap.append(text or "#")
        else:
            self.end()
            self.units[-1].behind.append(text)

    def _newline(self) -> None:
        if self._brackets:
            self._spread = True
            return
        self.end()
        if self._line_empty and self.units[-1].gap[-1:] != [""]:
            self.units[-1].gap.append("")
        self._line_empty = True
        self.units[-1].breaks = True


def read(text: str) -> list[Unit]:
    """Return the units of a text. A comment behind a block on one line is behind its head."""
    reader = _Reader()
    for piece in _PIECE.findall(text.replace("\r\n", "\n")):
        reader.take(piece)
    reader.end()
    open_blocks: list[int] = []
    for k, unit in enumerate(reader.units):
        if unit.words.endswith("{"):
            open_blocks.append(k)
        elif unit.words == "}":
            start = open_blocks.pop()
            if not any(inner.breaks or inner.spread for inner in reader.units[start:k]):
                reader.units[start].behind += unit.behind
                unit.behind = []
    return reader.units


def gaps(units: Sequence[Unit], shown: Sequence[Unit]) -> list[list[str]]:
    """Return the gaps behind all units, without the blank lines that no layout keeps.

    Those are the ones at the start and end of a block and of the file, below the first line, above what stands behind
    the last brace, and in a block that `shown` has on one line.
    """
    found = []
    for k, unit in enumerate(units):
        gap = list(unit.gap)
        first = k == 0 or unit.words.endswith("{") or k in (1, len(units) - 1)
        last = k == len(units) - 1 or units[k + 1].words == "}"
        if first and gap[:1] == [""]:
            gap = gap[1:]
        if last and gap[-1:] == [""]:
            gap = gap[:-1]
        found.append(gap if shown[k].breaks else [text for text in gap if text])
    return found


def moved(before: str, after: str) -> list[str]:
    """Return what a formatter has done to a text that it must not do: comments and groups at other units, or lost."""
    old, new = read(before), read(after)
    if [unit.words for unit in old] != [unit.words for unit in new]:
        return ["the statements are not the same"]
    wrong = []
    old_gaps, new_gaps = gaps(old, new), gaps(new, new)
    for k, (was, now) in enumerate(zip(old, new, strict=True)):
        if was.behind != now.behind and not _are_before(was, now, new_gaps[k - 1], old_gaps[k - 1]):
            wrong.append(f"behind `{was.words}`: {was.behind} => {now.behind}")
    for k, (was_gap, now_gap) in enumerate(zip(old_gaps, new_gaps, strict=True)):
        following = old[k + 1].behind if k + 1 < len(old) else []
        lifted = [text for text in now_gap if text not in was_gap and text in following]
        if was_gap != [text for text in now_gap if text not in lifted]:
            wrong.append(f"after `{old[k].words}`: {was_gap} => {now_gap}")
    return wrong


def _are_before(was: Unit, now: Unit, now_gap: Sequence[str], was_gap: Sequence[str]) -> bool:
    """Whether several comments of one statement (a list over several lines) are all behind or right before it."""
    lifted = [text for text in now_gap if text and text not in was_gap]
    return len(was.behind) > len(now.behind) and sorted([*lifted, *now.behind]) == sorted(was.behind)


# ---- odd layouts ----------------------------------------------------------------------------------------------------


class _Odd:
    def __init__(self, rng: random.Random) -> None:
        self._rng = rng
        self._number = 0

    def text(self, canonical: str) -> str:
        """Return a canonical text in another layout, with comments."""
        out: list[str] = [self._lines()]
        depth = brackets = round_ones = 0
        at_separator = True
        for piece in _PIECE.findall(canonical):
            if piece in ("\n", ";"):
                if not at_separator:
                    out.append(f"\n{self._lines()}" if out[-1].startswith("#") else self._separator(depth))
                at_separator = True
                continue
            if piece == "}":
                depth -= 1
                if not at_separator:
                    out.append(self._separator(depth + 1))
            if piece.isspace():
                out.append("" if at_separator else self._rng.choice((" ", " ", " ", "  ", "\t")))
                continue
            out.append(piece)
            brackets += {"[": 1, "]": -1}.get(piece, 0)
            round_ones += {"(": 1, ")": -1}.get(piece, 0)
            at_separator = piece == "{"
            if piece == "{":
                depth += 1
                out.append(self._separator(depth) if self._rng.random() < 0.7 else " ")
            elif brackets and not round_ones and piece in "[," and self._rng.random() < 0.1:
                out.append(f"{self._comment()}\n{self._lines()}\t")
        return "".join(out)

    def _separator(self, depth: int) -> str:
        if depth and self._rng.random() < 0.15:
            return self._rng.choice((";", "; ", " ;; "))
        semicolon = self._rng.choice(("", "", "", ";", " ; ")) if depth else ""
        comment = self._comment() if self._rng.random() < 0.2 else self._rng.choice(("", "", "  ", "\t"))
        return f"{semicolon}{comment}\n{self._lines()}{self._rng.choice(('', '', ' ', '    ', chr(9)))}"

    def _comment(self) -> str:
        self._number += 1
        form = self._rng.choice(("  # c{}", " #c{}", '# c{} "', "\t#  c{} {{ ; }} #x", "# c{} é\u2028 "))
        return form.format(self._number)

    def _lines(self) -> str:
        """Lines with nothing but comments and blanks."""
        if self._rng.random() < 0.75:
            return ""
        kinds = [self._rng.choice(("", "", " \t", None, None)) for _ in range(self._rng.choice((1, 1, 2, 4)))]
        return "".join(f"{self._comment().rstrip() if kind is None else kind}\n" for kind in kinds)


def odd(canonical: str, rng: random.Random) -> str:
    """Return a text in the canonical layout in an odd one: comments, blank lines, `;`, tabs, several statements a line,
    one statement on several lines, sometimes with Windows' newlines or a byte order mark."""
    text = _Odd(rng).text(canonical)
    text = text.replace("\n", "\r\n") if rng.random() < 0.2 else text
    return f"\ufeff{text}" if rng.random() < 0.1 else text
