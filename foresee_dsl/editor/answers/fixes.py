"""Quick fixes: of the edits that a diagnostic's help stands for, those that make the diagnostic go away."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from foresee_dsl.editor.answers.edits import LISTED, Fix, applied, edits
from foresee_dsl.editor.files import Files
from foresee_dsl.editor.protocol.positions import Positions
from foresee_dsl.editor.symbols import Occurrence
from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.language.keywords import KEYWORDS
from foresee_dsl.language.model.item import SymbolKind
from foresee_dsl.language.syntax.scan import Lines

_MOST_TRIED = 24
"""So many edits are tried for one diagnostic at most (ours: each is a check of the file, 20 to 80 ms)."""
_MOST_OFFERED = 5
"""So many fixes are offered for one diagnostic at most (ours: a menu that is read at a glance)."""
_OF_THE_GRAMMAR = frozenset({"FS003", "FS004", "FS008", "FS009", "FS015", "FS065"})
"""Mistakes that no edit may bring, wherever they stand."""

_SURE = frozenset({"meant", "closed block"})
"""What these edits put in is no example."""
_NAMES: tuple[SymbolKind, ...] = ("actor", "junction", "road", "parameter", "thing")
_MEANT_BY: Mapping[str, str] = {"gap": "time", "pace": "speed", "speed": "speed", "width": "length", "share": "ratio"}
"""Of which type the parameters are that examples name."""

_PINS = re.compile(r" is (sha256:\w+) now, but (sha256:\w+) is pinned")

Check = Callable[[str], tuple[Diagnostic, ...]]
"""Returns what is wrong with a text of the file."""
Adapt = Callable[[str, Positions, Fix], Fix]
"""Returns an edit with names of the text in the place of those of an example."""


def fixes(
    diagnostic: Diagnostic, span: Span, positions: Positions, check: Check, adapt: Adapt | None = None
) -> tuple[Fix, ...]:
    """Return what a diagnostic offers; each was tried, and leaves one mistake less.

    Args:
        diagnostic: what is wrong. span: where it is now. positions: of the text.
        check: says what is wrong with a text, other files left out.
        adapt: puts names that are known into an example.
    """
    text = "\n".join(positions.lines)
    found: dict[str, Fix] = {}
    tried: dict[tuple[Span, str], None] = {}
    before: tuple[Diagnostic, ...] | None = None
    for purpose, edit in edits(diagnostic, span, positions):
        if purpose in found:
            continue
        if len(found) == _MOST_OFFERED or len(tried) == _MOST_TRIED:
            break
        fix = edit if adapt is None or purpose.startswith(LISTED) else adapt(text, positions, edit)
        if (fix.span, fix.text) in tried:
            continue
        tried[fix.span, fix.text] = None
        before = check(text) if before is None else before
        trial = _Trial(text, positions, fix, check)
        pinned = _of_the_parent(trial.found, fix)
        if pinned is not None:
            fix, trial = pinned, _Trial(text, positions, pinned, check)
        if not trial.stays(diagnostic.code, diagnostic.message, span) and not trial.worse(before, purpose):
            found[purpose] = fix
    return tuple(found.values())


class _Trial:
    """An edit that was made, and what is wrong with the text after it."""

    def __init__(self, text: str, positions: Positions, fix: Fix, check: Check) -> None:
        after = applied(text, positions, fix)
        self.found = check(after)
        self._lines, self._places = Lines(after), positions
        self._start = positions.offset_of(fix.span.line, fix.span.column)
        self._old_end = positions.offset_of(fix.span.end_line, fix.span.end_column)
        self._end = self._start + len(fix.text)

    def _at(self, span: Span) -> int:
        return self._lines.offset(span.line, span.column)

    def stays(self, code: str, message: str, span: Span) -> bool:
        """Whether the mistake is still there: at its place, or in what was put in."""
        was = self._places.offset_of(span.line, span.column)
        moved = was if was < self._start else was + self._end - self._old_end
        for one in self.found:
            if (one.code, one.message) != (code, message):
                continue
            at = self._at(one.span) if one.span is not None else moved
            if at == moved or (self._start <= was <= self._old_end and self._start <= at <= self._end):
                return True
        return False

    def worse(self, before: tuple[Diagnostic, ...], purpose: str) -> bool:
        """Whether the edit has brought a mistake: one where the text was mended, or one of the grammar.

        Of a statement the grammar reports only the first mistake, so that the next shows when the first is mended: on
        the same line, but not right beside the edit. Where what the help says is no example, the edit may show that the
        statement is wrong in its meaning too.
        """
        were, are = _counted(before), _counted(self.found)
        sure = purpose in _SURE
        more_open = _unclosed(self.found) > _unclosed(before)
        for one in self.found:
            if one.severity != "error" or are[one.code, one.message] <= were[one.code, one.message]:
                continue
            if one.span is None or (one.code == "FS007" and more_open):
                return True
            at, far = self._at(one.span), self._lines.offset(one.span.end_line, one.span.end_column)
            first, last = (self._lines.place(place)[0] for place in (self._start, self._end))
            here = first <= one.span.line <= last
            if one.code in _OF_THE_GRAMMAR:
                if not (sure and here and (at > self._end + 1 or far < self._start)):
                    return True
            elif here and not sure and one.code != "FS007":
                return True
        return False


def _of_the_parent(found: tuple[Diagnostic, ...], fix: Fix) -> Fix | None:
    """Return the edit that writes the pin that a parent has, where one writes an example's."""
    for one in found:
        pins = _PINS.search(one.message)
        if pins is not None and pins[2] in fix.text:
            text = fix.text.replace(pins[2], pins[1])
            return replace(fix, title=fix.title.replace(pins[2], pins[1]), text=text)
    return None


def _counted(diagnostics: tuple[Diagnostic, ...]) -> Counter[tuple[str, str]]:
    return Counter((one.code, one.message) for one in diagnostics)


def _unclosed(diagnostics: tuple[Diagnostic, ...]) -> int:
    """Return how many blocks are not closed: each is reported, but of many the last in one line."""
    more = (re.match(r"(\d+) more block", one.message) for one in diagnostics if one.code == "FS007")
    return sum(int(found[1]) if found is not None else 1 for found in more)


# ---- the file's names in an example ----------------------------------------------------------------------------------


def with_known_names(path: Path, overlay: Mapping[Path, str]) -> Callable[[str, Positions, Fix], Fix]:
    """Return what replaces the names in examples of helps (`lead`, `j4`) by names that a file knows."""

    def adapt(text: str, positions: Positions, fix: Fix) -> Fix:
        if not re.search(r"[a-z]\w*[ .(,)\]}]|^[a-z]\w*$", fix.text):
            return fix
        for stages in (False, True):  # a stage is one of its junction, whose name has to be known first
            fix = _adapted(text, positions, fix, stages=stages)
        return fix

    def _adapted(text: str, positions: Positions, fix: Fix, *, stages: bool) -> Fix:
        if fix.text in KEYWORDS:
            return fix
        after = applied(text, positions, fix)
        files, lines = Files({**overlay, path: after}), Lines(after)
        start = positions.offset_of(fix.span.line, fix.span.column)
        before = set(re.findall(r"\w+", text))
        changed = fix.text
        for use in reversed(files.names(path)):
            at, end = (lines.offset(*place) for place in ((use.span.line, use.span.column), _end(use)))
            if not start <= at < end <= start + len(fix.text) or use.defines or use.name in before:
                continue
            if use.kind not in (("stage",) if stages else _NAMES) or files.define(path, use) is not None:
                continue
            name = _known(files, path, use)
            if name:
                changed = f"{changed[: at - start]}{name}{changed[end - start :]}"
        if changed == fix.text:
            return fix
        return replace(fix, title=fix.title.replace(fix.text.strip(), changed.strip()), text=changed)

    return adapt


def _end(use: Occurrence) -> tuple[int, int]:
    return use.span.end_line, use.span.end_column


def _known(files: Files, path: Path, use: Occurrence) -> str:
    """Return a name that can stand where an example's stands; nothing where there is none."""
    if use.kind == "stage":
        return next(iter(files.stages(path, use.scope)), "")
    kinds: tuple[SymbolKind, ...] = ("actor",) if use.kind == "thing" else (use.kind,)
    names = list(files.definitions(path, *kinds))
    if use.kind == "actor":
        names.sort(key=lambda name: name == "ego")  # the examples' others are told what to do, the ego is not
    if use.kind == "parameter" and use.name in _MEANT_BY:
        names = [name for name in names if files.type_of(path, name) == _MEANT_BY[use.name]]
    return names[0] if names else ""
