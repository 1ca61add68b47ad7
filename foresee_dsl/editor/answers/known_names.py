"""The examples of helps have names of their own (`lead`, `j4`, `gap`): in a quick fix the file's names replace them."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from foresee_dsl.editor.answers.edits import Fix, applied
from foresee_dsl.editor.files import Files
from foresee_dsl.editor.protocol.positions import Positions
from foresee_dsl.editor.symbols import Occurrence
from foresee_dsl.language.keywords import KEYWORDS
from foresee_dsl.language.model.item import SymbolKind
from foresee_dsl.language.syntax.scan import Lines

_NAMES: tuple[SymbolKind, ...] = ("actor", "junction", "road", "parameter", "thing")
_MEANT_BY: Mapping[str, str] = {"gap": "time", "pace": "speed", "speed": "speed", "width": "length", "share": "ratio"}
"""Of which type the parameters are that examples name."""


def with_known_names(path: Path, overlay: Mapping[Path, str]) -> Callable[[str, Positions, Fix], Fix]:
    """Return what puts the names that a file knows into the examples of a help."""

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
