"""Turns the fixes of a diagnostic into edits of the text: insert, replace, move, remove, rename, close."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, assert_never

from foresee_dsl import helps as h
from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.language.keywords import USAGE, words_of
from foresee_dsl.language.messages.suggest import meant_at
from foresee_dsl.language.syntax.scan import Raw, scan
from foresee_dsl.language.units import UNITS

_CONDITION = re.compile(r"(?:if|elif|when(?:\s+(?:once|every|next))?(?:\s+\w+:)?)\s+(?P<condition>.+)", re.DOTALL)
_VALUE = re.compile(r"-?[0-9]|\([^()]*,[^()]*\)$")
_WORD = re.compile(r"[a-z]\w*")
_IN_ORDER = (h.Rewrite, h.GoOn, h.InBlock, h.Instead, h.Write, h.OneOf, h.Remove, h.Rename)
"""Kinds of fixes, likely ones first: fixed rewritings, then insertions of text, then removals and renamings."""


@dataclass(frozen=True)
class Fix:
    """An edit: its title, the offsets between which it replaces the text, and the new text."""

    title: str
    start: int
    end: int
    text: str


class Purpose(NamedTuple):
    """The purpose of an edit: the text that it inserts, or the kind of change.

    `listed`: whether the edit inserts a name that is offered in a list; such names come from the file itself.
    """

    name: str
    listed: bool = False


def applied(text: str, fix: Fix) -> str:
    """Return a text with an edit made."""
    return text[: fix.start] + fix.text + text[fix.end :]


def edits(diagnostic: Diagnostic, span: Span, text: str) -> Iterator[tuple[Purpose, Fix]]:
    """Yield the possible edits for a diagnostic's fixes at a place, likely ones first, each with its purpose.

    The caller needs only one edit per purpose.
    """
    place = _MarkedText(span, text)
    meant = meant_at(diagnostic.fixes, place.written)
    if meant is not None and (span.line == span.end_line or "\n" not in place.written[: meant[1]]):
        start, end, right = meant
        yield Purpose("meant"), Fix(f"Write '{right}'", place.start + start, place.start + end, right)
        return
    others = {part for fix in diagnostic.fixes for part in _texts_of(fix)}
    for kind in _IN_ORDER:
        for fix in dict.fromkeys(fix for fix in diagnostic.fixes if isinstance(fix, kind)):
            if not isinstance(fix, h.Write) or fix.text not in others:
                yield from place.edits(fix)


def _texts_of(fix: h.Edit) -> tuple[str, ...]:
    """Return the texts of a fix that does more than insert them; empty for other fixes."""
    match fix:
        case h.Instead(text, other) | h.InBlock(text, other):
            return text, other
    return ()


class _MarkedText:
    """The part of a text that a diagnostic marks, and the edits that are possible there."""

    def __init__(self, span: Span, text: str) -> None:
        cut = scan(text)
        self._text, self._statements, lines = text, cut.statements, cut.lines
        self.start = lines.offset(span.line, span.column)
        self.end = lines.offset(span.end_line, span.end_column)
        self.written = self._text[self.start : self.end]
        if not self.written.strip():  # the statement stops too early
            self.end, self.written = self.start, ""

    def edits(self, fix: h.Edit) -> Iterator[tuple[Purpose, Fix]]:
        """Yield the possible edits of a fix at this place, each with its purpose."""
        match fix:
            case h.Rewrite(to):
                yield from ((Purpose(to), edit) for edit in self._rewritten(to))
            case h.GoOn(text):
                yield Purpose(text), Fix(f"Add `{text}`", self.end, self.end, f" {text}")
            case h.InBlock(text, name):
                yield from ((Purpose(text), edit) for edit in self.in_block(text, name))
            case h.Instead(text, wrong):
                yield from ((Purpose("instead"), edit) for edit in self.instead(wrong, text))
            case h.Write(text) | h.Meant(text):
                yield from ((Purpose(text), edit) for edit in self.ways(text))
            case h.OneOf(words, wrong):
                for word in words:
                    yield from ((Purpose(word, listed=True), edit) for edit in self.words(word, wrong))
            case h.Remove(word):
                yield from ((Purpose("removed"), edit) for edit in self.removals(word))
            case h.Rename(everywhere):
                yield from ((Purpose("renamed"), edit) for edit in self.renamings(everywhere=everywhere))
            case _:
                assert_never(fix)

    def _rewritten(self, to: str) -> Iterator[Fix]:
        forms = {
            "closed block": self.closings,
            "inside": self.moved_in,
            "trigger": self.moved_out,
            "comment": self.commented,
            "opposite": self.otherwise,
        }
        return forms[to]()

    def _around(self) -> list[Raw]:
        """Return the statements around the place, outermost first."""
        statements: list[Raw] = []
        inner: list[Raw] | None = self._statements
        while inner is not None:
            holding = (raw for raw in inner if raw.start <= self.start <= max(raw.end, raw.close))
            raw = next(holding, None)
            if raw is None:
                break
            statements.append(raw)
            inner = raw.block
        return statements

    def _beside(self) -> tuple[list[Raw], int]:
        """Return the statements of the block around the innermost statement at the place, and its index in them; 0 if
        no statement is there."""
        around = self._around()
        beside = (around[-2].block or []) if len(around) > 1 else self._statements
        return beside, next((k for k, raw in enumerate(beside) if around and raw is around[-1]), 0)

    def _line(self, offset: int) -> tuple[int, int, str]:
        """Return the offsets of the beginning and end (without a comment) of an offset's line, and its indentation."""
        start = self._text.rfind("\n", 0, offset) + 1
        end = self._text.find("\n", offset)
        line = self._text[start : end if end >= 0 else len(self._text)]
        return start, start + len(line.partition("#")[0].rstrip()), line[: len(line) - len(line.lstrip())]

    # ---- to write a text --------------------------------------------------------------------------------------------

    def ways(self, words: str) -> Iterator[Fix]:
        """Yield the edits that insert a suggested text: in place of the marked part, behind it, before it, in place of
        the rest of the line or statement, and as a statement of its own."""
        write, add = f"Write `{words}`", f"Add `{words}`"
        begin, end, indent = self._line(self.start)
        around = self._around()
        head = around[-1] if around else None
        statement = (words.split(maxsplit=1)[0].rstrip(":") in USAGE and " " in words) or " { " in words
        whole = head is not None and (head.start, head.end) == (self.start, self.end)
        if not statement or whole:
            if self.written:
                yield Fix(write, self.start, self.end, words)
            yield Fix(add, self.end, self.end, f" {words}")
            yield Fix(add, self.start, self.start, f"{words} ")
        if _VALUE.match(words):
            yield from self._values(words, write)
            return
        if head is not None:
            if not statement or not whole:
                yield Fix(write, self.start, max(head.end, self.start), words)
            yield Fix(write, head.start, head.end, words)
            yield Fix(write, head.start, max(head.end, head.close), words)
        if not statement:
            yield Fix(write, self.start, max(end, self.start), words)
            yield Fix(write, begin + len(indent), max(end, begin + len(indent)), words)
        if head is not None and head.open >= 0:  # as the first statement of the block that begins here
            yield Fix(add, head.open + 1, head.open + 1, f"\n{indent}  {words}")
        elif head is not None:
            yield Fix(add, head.end, head.end, f" {{ {words} }}")
        yield Fix(add, begin, begin, f"{indent}{words}\n")
        if self._statements and self._statements[-1].block is not None:
            last = self._text.rfind("\n", 0, self._statements[-1].close) + 1
            yield Fix(add, last, last, f"  {words}\n")

    def _values(self, words: str, title: str) -> Iterator[Fix]:
        """Yield the edits that replace a value or a point of the same kind in the marked part."""
        of_words = _dimension(words.partition(" ")[2])
        pattern = r"\([^()]*,[^()]*\)" if words.startswith("(") else r"-?[0-9][0-9.]*(?: (?P<unit>[a-z][\w/^]*))?"
        for value in re.finditer(pattern, self.written):
            if words.startswith("(") or _dimension(value["unit"]) == of_words:
                yield Fix(title, self.start + value.start(), self.start + value.end(), words)

    def words(self, word: str, wrong: str) -> Iterator[Fix]:
        """Yield the edit that replaces the wrong word by one of the words that a help lists; none if it is written more
        than once."""
        pattern = rf"(?<![\w#-]){re.escape(wrong)}(?![\w#])"
        places = [occurrence.span() for occurrence in re.finditer(pattern, self.written)] if wrong else []
        if not places and re.fullmatch(r"\S+", self.written):  # also a parameter whose value is the wrong word
            places = [(0, len(self.written))]
        if len(places) == 1 and wrong != word:
            start, end = places[0]
            yield Fix(f"Write `{word}`", self.start + start, self.start + end, word)

    def instead(self, wrong: str, right: str) -> Iterator[Fix]:
        """Yield the edits that replace one text by another, the nearest place first."""
        around = self._around()
        first, end = (around[-1].start, max(around[-1].end, self.end)) if around else (self.start, self.end)
        places = [first + occurrence.start() for occurrence in re.finditer(re.escape(wrong), self._text[first:end])]
        for place in sorted(places, key=lambda place: abs(place - self.start)):
            yield Fix(f"Write `{right}`", place, place + len(wrong), right)

    # ---- to close, to move, to take out, to rename ------------------------------------------------------------------

    def closings(self) -> Iterator[Fix]:
        """Yield the edits that close a block before the first line that is not indented more than its head."""
        begin, _, indent = self._line(self.start)
        offset = self._text.find("\n", self.start) + 1
        while 0 < offset < len(self._text):
            start, end, inner = self._line(offset)
            if end > start and len(inner) <= len(indent):
                yield Fix("Add `}`", start, start, f"{indent}}}\n")
                break
            offset = self._text.find("\n", offset) + 1
        at = len(self._text.rstrip())
        yield Fix("Add `}`", at, at, f"\n{indent}}}")
        _, end, _ = self._line(begin)
        yield Fix("Add `}`", end, end, " }")

    def moved_in(self) -> Iterator[Fix]:
        """Yield the edit that moves a statement from behind a block into that block."""
        beside, k = self._beside()
        before = beside[k - 1] if k else None
        if before is None or before.block is None:
            return
        raw = beside[k]
        end = max(raw.end, raw.close)
        moved = self._text[raw.start : end]
        brace = self._text.rfind("}", 0, before.close)
        indent = self._line(brace)[2]
        if "\n" not in self._text[before.open : before.close]:
            indent = self._line(before.start)[2]
            between = f"\n{indent}  {moved}\n{indent}}}"
        else:
            between = f"  {moved}\n{indent}}}"
        behind = self._text[brace + 1 : raw.start].rstrip()
        yield Fix(f"Move `{moved.partition(chr(10))[0]}` inside", brace, end, f"{between}{behind}")

    def moved_out(self) -> Iterator[Fix]:
        """Yield the edit that makes an action in an actor's block a trigger behind it."""
        *_, actor, action = [None, None, *self._around()]
        named = re.match(r"(?:\w+\s+)?(\w+)\s*:", self._text[actor.start : actor.end]) if actor is not None else None
        if actor is None or action is None or named is None:
            return
        indent = self._line(actor.start)[2]
        action_text = re.split(r"//|/\*", self._text[action.start : action.end])[0].strip()
        does = f"when time >= 0 s {{ {named[1]} {action_text} }}"
        rest = self._without(action.start, action.end)
        text = f"{self._text[rest.end : actor.close]}\n{indent}{does}"
        yield Fix(f"Write `{does}`", rest.start, actor.close, text)

    def commented(self) -> Iterator[Fix]:
        """Yield the edit that turns a comment of another language into lines of `#` comments."""
        closed = self._text.find("*/", self.start)
        end = closed + 2 if closed >= 0 else len(self._text.rstrip())
        behind = self._text[end : self._line_end(end)].strip()
        indent = self._line(self.start)[2]
        comment_lines = self._text[self.start + 2 : closed if closed >= 0 else end].split("\n")
        lines = [f"# {line.strip().lstrip('*').strip()}".rstrip() for line in comment_lines]
        text = f"\n{indent}".join([*lines, ""] if behind else lines)
        yield Fix("Begin each line with `#`", self.start, end, text)

    def otherwise(self) -> Iterator[Fix]:
        """Yield the edit that turns an `else` into a trigger with the opposite of the preceding condition."""
        beside, k = self._beside()
        before = _CONDITION.match(self._text[beside[k - 1].start : beside[k - 1].end]) if k else None
        if before is None:
            return
        own = _CONDITION.match(self._text[beside[k].start : beside[k].end])
        text = f"when not ({before['condition'].strip()})" + (f" and ({own['condition'].strip()})" if own else "")
        begin, _, indent = self._line(self.start)
        if self._text[begin : self.start].strip():  # `} else {`
            text = f"\n{indent}{text}"
        yield Fix(f"Write `{text.strip()}`", self.start, max(beside[k].end, self.end), text)

    def in_block(self, words: str, name: str) -> Iterator[Fix]:
        """Yield the edit that inserts a setting into the block of a named statement, or replaces the one there."""
        for raw in self._beside()[0]:
            if not re.match(rf"\w+\s+{name}\b", self._text[raw.start : raw.end]):
                continue
            first_word = words.split(maxsplit=1)[0]
            same = [inner for inner in raw.block or () if self._text.startswith(first_word, inner.start)]
            if same:
                yield Fix(f"Write `{words}` in '{name}'", same[0].start, same[0].end, words)
            elif raw.block is None:
                yield Fix(f"Add `{words}` to '{name}'", raw.end, raw.end, f" {{ {words} }}")
            elif raw.block and "\n" in self._text[raw.open : raw.block[0].start]:
                begin = self._text.rfind("\n", 0, raw.block[0].start)
                text = f"{self._text[begin : raw.block[0].start]}{words}"
                yield Fix(f"Add `{words}` to '{name}'", begin, begin, text)
            else:
                yield Fix(f"Add `{words}` to '{name}'", raw.open + 1, raw.open + 1, f" {words};")

    def removals(self, word: str = "") -> Iterator[Fix]:
        """Yield the edits that remove the marked part (with the word before it), or the statement around it."""
        comment = self._text.rfind("#", self._text.rfind("\n", 0, self.start) + 1, self.start)
        if comment >= 0:
            yield self._without(comment, self._line_end(self.start))
            return
        around = self._around()
        if self.written == "}":
            yield self._without(self.start, self.end)
            return
        before, behind = self._text[: self.start].rstrip(), self._text[self.end :].lstrip()
        if before.endswith(("[", ",")) and behind.startswith(("]", ",")):
            yield self._without(self.start, self.end)  # the word is one of a list
        if word:
            at = self._text.rfind(word, around[-1].start if around else 0, self.end)
            if at >= 0:
                yield self._without(at, self.end)
        if not word or (around and self._text.startswith(word, around[-1].start)):
            for raw in reversed(around[1:]):
                yield self._without(raw.start, max(raw.end, raw.close))
                break
        yield self._without(self.start, self.end)

    def _line_end(self, offset: int) -> int:
        end = self._text.find("\n", offset)
        return end if end >= 0 else len(self._text)

    def _without(self, start: int, end: int) -> Fix:
        """Return the edit that removes a part, with its line if nothing else is on it."""
        first_line = self._text[start:end].partition("\n")[0]
        title = f"Remove `{first_line if len(first_line) <= 40 else first_line[:37] + '...'}`"
        begin, last = self._text.rfind("\n", 0, start) + 1, self._line_end(end)
        behind = self._text[end:last].strip()
        if not self._text[begin:start].strip() and (not behind or behind.startswith("#")):
            return Fix(title, begin, min(last + 1, len(self._text)), "")
        before = self._text[:start].rstrip()
        if before.endswith("[") and behind.startswith(","):
            end = self._text.index(",", end) + 1
            end += len(self._text[end:]) - len(self._text[end:].lstrip(" "))
        elif before.endswith(","):
            start = len(before) - 1
        elif behind.startswith(";"):
            end = self._text.index(";", end) + 1
            end += len(self._text[end:]) - len(self._text[end:].lstrip(" "))
        else:
            start = len(self._text[:start].rstrip(" ;"))
        return Fix(title, start, end, "")

    def renamings(self, *, everywhere: bool) -> Iterator[Fix]:
        """Yield the edit that gives the marked part a free name; `everywhere`: also in the later uses of the name."""
        word = _WORD.fullmatch(self.written) or _WORD.match(self.written)
        if word is None:
            return
        taken = set(re.findall(r"\w+", self._text))
        name = next(name for k in range(2, 1000) if (name := f"{word[0]}_{k}") not in taken)
        end = self.start + len(word[0])
        followers = "|".join((*words_of("action"), "in", "within", "sees", "ahead", "behind"))
        uses = rf"\b{word[0]}(?=\s+(?:{followers})\b|\.[a-z])|(?<=\(){word[0]}(?=[,)])|(?<=, ){word[0]}(?=\))"
        places = [use.end() for use in re.compile(uses).finditer(self._text, end)]
        if everywhere and places:
            parts = (self._text[begin : other - len(word[0])] + name for begin, other in pairwise((end, *places)))
            yield Fix(f"Call it `{name}`", self.start, places[-1], name + "".join(parts))
        yield Fix(f"Call it `{name}`", self.start, end, name)


def _dimension(unit: str | None) -> str:
    entry = UNITS.get(unit or "")
    return entry.dimension if entry is not None else ""
