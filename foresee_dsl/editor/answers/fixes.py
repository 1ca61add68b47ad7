"""Quick fixes: finds the edits of a diagnostic's help that really remove the diagnostic."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from foresee_dsl.editor.answers.edits import Fix, Purpose, applied, edits
from foresee_dsl.editor.files import Files
from foresee_dsl.editor.symbols import Occurrence
from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.helps import Rewrite
from foresee_dsl.language.keywords import KEYWORDS
from foresee_dsl.language.model.item import SymbolKind
from foresee_dsl.language.parser import plain
from foresee_dsl.language.syntax.scan import Lines

_MOST_ATTEMPTS = 24
"""Maximum number of edits tried per diagnostic. Ours: each needs a check of the file, 20 to 80 ms."""
_MOST_OFFERED = 5
"""Maximum number of fixes offered per diagnostic. Ours: a menu that is read at a glance."""
_OF_THE_GRAMMAR = frozenset({"FS003", "FS004", "FS008", "FS009", "FS015", "FS065"})
"""Codes of errors that no edit may cause, at any place."""

_SURE = frozenset({Purpose("meant"), Purpose("closed block")})
"""Purposes of edits that insert a definite text, not an example."""
_NAMES: tuple[SymbolKind, ...] = ("actor", "junction", "road", "parameter", "thing")
_MEANT_BY: Mapping[str, str] = {"gap": "time", "pace": "speed", "speed": "speed", "width": "length", "share": "ratio"}
"""The types of the parameters that examples name."""

Check = Callable[[str], tuple[Diagnostic, ...]]
"""A function that returns the diagnostics of a text of the file."""
Adapt = Callable[[str, Fix], Fix]
"""A function that returns an edit in which names of the file replace those of an example."""


def fixes(diagnostic: Diagnostic, span: Span, text: str, check: Check, adapt: Adapt | None = None) -> tuple[Fix, ...]:
    """Return the fixes of a diagnostic. Each was tried, and leaves one error less.

    Args:
        diagnostic: the diagnostic.
        span: its present place.
        text: the text.
        check: returns the diagnostics of a text, without those of other files.
        adapt: replaces the names of an example by names of the file.
    """
    text = plain(text)
    offered: dict[Purpose, Fix] = {}
    attempts: set[tuple[int, int, str]] = set()
    before: tuple[Diagnostic, ...] | None = None
    for purpose, edit in edits(diagnostic, span, text):
        if purpose in offered:
            continue
        if len(offered) == _MOST_OFFERED or len(attempts) == _MOST_ATTEMPTS:
            break
        fix = edit if adapt is None or purpose.listed else adapt(text, edit)
        if (fix.start, fix.end, fix.text) in attempts:
            continue
        attempts.add((fix.start, fix.end, fix.text))
        before = check(text) if before is None else before
        trial = _Trial(text, fix, check)
        pinned = _of_the_parent(trial.diagnostics, fix)
        if pinned is not None:
            fix, trial = pinned, _Trial(text, pinned, check)
        if not trial.stays(diagnostic.code, diagnostic.message, span) and not trial.worse(before, purpose):
            offered[purpose] = fix
    return tuple(offered.values())


class _Trial:
    """An edit, and the diagnostics of the text after it."""

    def __init__(self, text: str, fix: Fix, check: Check) -> None:
        after = applied(text, fix)
        self.diagnostics = check(after)
        self._before, self._lines = Lines(text), Lines(after)
        self._start, self._old_end = fix.start, fix.end
        self._end = self._start + len(fix.text)

    def _at(self, span: Span) -> int:
        return self._lines.offset(span.line, span.column)

    def stays(self, code: str, message: str, span: Span) -> bool:
        """Return whether the error remains, at its place or in the inserted text."""
        was = self._before.offset(span.line, span.column)
        moved = was if was < self._start else was + self._end - self._old_end
        for diagnostic in self.diagnostics:
            if (diagnostic.code, diagnostic.message) != (code, message):
                continue
            at = self._at(diagnostic.span) if diagnostic.span is not None else moved
            if at == moved or (self._start <= was <= self._old_end and self._start <= at <= self._end):
                return True
        return False

    def worse(self, before: tuple[Diagnostic, ...], purpose: Purpose) -> bool:
        """Return whether the edit causes an error: a new one in the edited lines, or one of the grammar anywhere.

        The grammar reports only the first error of a statement. So fixing it may reveal the next: on the same line, but
        not directly beside the edit. If the help gives a definite text, the edit may also reveal an error in the
        statement's meaning."""
        were, are = _counted(before), _counted(self.diagnostics)
        sure = purpose in _SURE
        more_open = _unclosed(self.diagnostics) > _unclosed(before)
        for diagnostic in self.diagnostics:
            key, span = (diagnostic.code, diagnostic.message), diagnostic.span
            if diagnostic.severity != "error" or are[key] <= were[key]:
                continue
            if span is None or (diagnostic.code == "FS007" and more_open):
                return True
            at, far = self._at(span), self._lines.offset(span.end_line, span.end_column)
            first, last = (self._lines.place(place)[0] for place in (self._start, self._end))
            here = first <= span.line <= last
            if diagnostic.code in _OF_THE_GRAMMAR:
                if not (sure and here and (at > self._end + 1 or far < self._start)):
                    return True
            elif here and not sure and diagnostic.code != "FS007":
                return True
        return False


def _of_the_parent(diagnostics: tuple[Diagnostic, ...], fix: Fix) -> Fix | None:
    """Return the edit with the parent's actual pin in place of an example's; None if the edit does not write a wrong
    pin."""
    for diagnostic in diagnostics:
        if diagnostic.code == "FS135" and diagnostic.names:
            now, pinned = diagnostic.names
            if pinned in fix.text:
                return replace(fix, title=fix.title.replace(pinned, now), text=fix.text.replace(pinned, now))
    return None


def _counted(diagnostics: tuple[Diagnostic, ...]) -> Counter[tuple[str, str]]:
    return Counter((diagnostic.code, diagnostic.message) for diagnostic in diagnostics)


def _unclosed(diagnostics: tuple[Diagnostic, ...]) -> int:
    """Return the number of blocks that are not closed. If there are many, one diagnostic reports the last ones
    together, with their number.
    """
    of_blocks = (diagnostic.fixes for diagnostic in diagnostics if diagnostic.code == "FS007")
    return sum(next((fix.blocks for fix in fixes if isinstance(fix, Rewrite)), 1) for fixes in of_blocks)


# ---- the file's names in an example ----------------------------------------------------------------------------------


def with_names_of(path: Path, overlay: Mapping[Path, str]) -> Adapt:
    """Return a function that replaces names of examples in helps (`lead`, `j4`) by names that a file defines."""

    def adapt(text: str, fix: Fix) -> Fix:
        if not re.search(r"[a-z]\w*[ .(,)\]}]|^[a-z]\w*$", fix.text):
            return fix
        for stages in (False, True):  # a stage belongs to its junction, whose name must be settled first
            fix = _adapted(text, fix, stages=stages)
        return fix

    def _adapted(text: str, fix: Fix, *, stages: bool) -> Fix:
        if fix.text in KEYWORDS:
            return fix
        after, start = applied(text, fix), fix.start
        files, lines = Files({**overlay, path: after}), Lines(after)
        before = set(re.findall(r"\w+", text))
        changed = fix.text
        for use in reversed(files.names(path)):
            at = lines.offset(use.span.line, use.span.column)
            end = lines.offset(use.span.end_line, use.span.end_column)
            if not start <= at < end <= start + len(fix.text) or use.defines or use.name in before:
                continue
            if use.kind not in (("stage",) if stages else _NAMES) or files.define(path, use) is not None:
                continue
            name = _name_for(files, path, use)
            if name:
                changed = f"{changed[: at - start]}{name}{changed[end - start :]}"
        if changed == fix.text:
            return fix
        return replace(fix, title=fix.title.replace(fix.text.strip(), changed.strip()), text=changed)

    return adapt


def _name_for(files: Files, path: Path, use: Occurrence) -> str:
    """Return a name of the file that can replace an example's name; "" if there is none."""
    if use.kind == "stage":
        return next(iter(files.stages(path, use.scope)), "")
    kinds: tuple[SymbolKind, ...] = ("actor",) if use.kind == "thing" else (use.kind,)
    names = list(files.definitions(path, *kinds))
    if use.kind == "actor":
        names.sort(key=lambda name: name == "ego")  # examples give orders to other actors, not to the ego
    if use.kind == "parameter" and use.name in _MEANT_BY:
        names = [name for name in names if files.type_of(path, name) == _MEANT_BY[use.name]]
    return names[0] if names else ""
