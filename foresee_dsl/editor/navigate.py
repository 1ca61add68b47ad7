"""Finds the definition and the uses of a name across the files of a workspace, and renames it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.editor.files import Definition, Files
from foresee_dsl.editor.symbols import Occurrence
from foresee_dsl.editor.syntax import read_syntax
from foresee_dsl.errors import ForeseeError, InputError, Span, with_article
from foresee_dsl.files import absolute
from foresee_dsl.language import model as m
from foresee_dsl.language.checks.documents import check_document
from foresee_dsl.language.keywords import KEYWORDS
from foresee_dsl.language.model.item import SymbolKind
from foresee_dsl.language.model.values import NAME_PATTERN
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.addresses import display_path
from foresee_dsl.language.units import UNITS

_RENAMED: tuple[SymbolKind, ...] = ("actor", "parameter", "junction", "road", "label", "stage", "stop", "patch", "case")
_START = Span(1, 1, 1, 1)


class RenameError(ForeseeError):
    """Raised if a name cannot be renamed, or not to the wanted name; the message says why."""


@dataclass(frozen=True)
class Place:
    """A place in a file."""

    path: Path
    span: Span


@dataclass(frozen=True)
class Renaming:
    """The result of a renaming: the places of the old name, the new name, and the files that become stale."""

    places: tuple[Place, ...]
    name: str
    stale: tuple[Path, ...]


def at(files: Files, path: Path, line: int, column: int) -> Occurrence | None:
    """Return the name at a place (1-based); the innermost if several overlap."""
    spans = ((o, o.span) for o in files.names(path))
    names = [o for o, s in spans if (s.line, s.column) <= (line, column) <= (s.end_line, s.end_column)]
    return min(names, key=lambda o: (o.span.end_line - o.span.line, o.span.end_column - o.span.column), default=None)


def definition(files: Files, path: Path, use: Occurrence) -> Place | None:
    """Return the place where a name is defined; for a file's name, the name of its definition."""
    if use.kind == "file":
        target = absolute(path.parent / use.name)
        if not target.is_file() and target not in files.overlay:
            return None
        root = files.root(target)
        named = root.places.get("name") if root is not None else None
        return Place(target, named or _START)
    defined = files.define(path, use)
    return Place(defined.path, defined.occurrence.span) if defined is not None else None


def references(files: Files, path: Path, use: Occurrence) -> tuple[Place, ...]:
    """Return all places in the workspace that mean the same thing, including its definition."""
    target = files.define(path, use)
    if target is None:
        return ()
    places = (Place(file, _of_base(o, suffix)) for file, o, suffix in _uses(files, path, target))
    return tuple(dict.fromkeys(places))


def renamed_from(files: Files, path: Path, use: Occurrence) -> Span:
    """Return the place that is renamed at a use, without quotes and without a suffix of the defined name."""
    return _of_base(use, _renamable(files, path, use).suffix)


def rename(files: Files, path: Path, use: Occurrence, name: str) -> Renaming:
    """Return the changes of renaming a name everywhere.

    Clips and mutants are never changed: they pin the meaning of their parent, and names are part of
    it. Raises `RenameError` if the name cannot be renamed."""
    target = _renamable(files, path, use)
    old = target.occurrence.name
    if not re.fullmatch(NAME_PATTERN, name) or len(name) > 80:
        raise RenameError(f"'{name}' is not a name: write a small letter, then small letters, digits and `_`")
    places: dict[Path, list[Span]] = {}
    for file, o, suffix in _uses(files, path, target):
        # a clip's pin does not depend on the case's name, so the clip stays valid
        if not _is_child(files, file) or target.occurrence.kind == "case":
            places.setdefault(file, []).append(_of_base(o, suffix))
    affected = tuple(places) if name != old else ()
    _check_broken(files, affected, old)
    for file in affected:
        _check_free(files, file, name, target.occurrence)
        # Wherever the old name could be read, the new one can be read too, unless it is a word of the language. An
        # error in the definition is found in the file that defines the name.
        if file == target.path or name in KEYWORDS or name in UNITS:
            _check_result(files, file, places[file], name)
    pinned = affected if target.occurrence.kind != "case" else ()
    stale = tuple(f for f in files.all() if pinned and _is_child(files, f) and set(files.scope(f)) & set(pinned))
    renamed = tuple(Place(file, span) for file in affected for span in sorted(places[file], key=_order))
    return Renaming(renamed, name, stale)


def edited(text: str, spans: list[Span], name: str) -> str:
    """Return a text with a name written at places (each on one line)."""
    lines = text.split("\n")
    for span in sorted(set(spans), key=_order, reverse=True):
        line = lines[span.line - 1]
        lines[span.line - 1] = line[: span.column - 1] + name + line[span.end_column - 1 :]
    return "\n".join(lines)


def _uses(files: Files, path: Path, target: Definition) -> Iterator[tuple[Path, Occurrence, str]]:
    """Yield every name in the workspace that means the target, with its file and the suffix that it adds to the
    target's name."""
    for file in dict.fromkeys((path, target.path, *files.all())):
        if target.occurrence.name not in (files.text(file) or "") or target.path not in files.scope(file):
            continue
        for o in files.names(file):
            if not o.name.startswith(target.occurrence.name):
                continue
            definition = files.define(file, o)
            if (
                definition is not None
                and definition.path == target.path
                and definition.occurrence.span == target.occurrence.span
            ):
                yield file, o, definition.suffix


def _renamable(files: Files, path: Path, use: Occurrence) -> Definition:
    if _is_child(files, path):
        raise RenameError("a clip or mutant has the names of its parent: rename there, then clip and mutate again")
    target = files.define(path, use)
    if target is None:
        raise RenameError(f"no file here defines '{use.name}'")
    if target.occurrence.kind not in _RENAMED:
        raise RenameError(f"{with_article(target.occurrence.kind)} cannot be renamed here")
    if target.occurrence.owner.kind is m.Ego:
        raise RenameError("the ego is always called `ego`")
    return target


def _is_child(files: Files, path: Path) -> bool:
    root = files.root(path)
    return root is not None and root.kind in (m.Clip, m.Mutant)


def _check_free(files: Files, file: Path, name: str, renamed: Occurrence) -> None:
    """Raise if another definition has the name, as renaming could then change the meaning of other lines."""
    if renamed.kind in ("stage", "case"):  # their names must differ only within a junction or a scenario
        alike = (o for f in files.scope(file) for o in files.names(f) if o.defines and o.kind == renamed.kind)
        if any(o.name == name and o.scope == renamed.scope for o in alike):
            raise RenameError(f"'{name}' is already the name of {with_article(renamed.kind)}")
        return
    taken = files.definitions(file, "actor", "junction", "road", "parameter", "label").get(name)
    if taken is not None:
        what = taken.occurrence.kind
        raise RenameError(f"'{name}' is already the name of {with_article(what)}, in '{display_path(taken.path)}'")


def _check_broken(files: Files, affected: tuple[Path, ...], old: str) -> None:
    """Raise if a file with syntax errors contains the word and belongs to the affected files: it may hold unreadable
    uses."""
    for file in files.all() if affected else ():
        text = files.text(file) or ""
        broken = re.search(rf"\b{old}(?:_back)?\b", text) is not None and not read_syntax(text).whole
        if broken and (file in affected or any(other.name in text for other in affected)):
            raise RenameError(f"'{display_path(file)}' has errors: correct them first")


def _check_result(files: Files, file: Path, spans: list[Span], name: str) -> None:
    """Raise if the renaming causes an error in a file."""
    text = files.text(file) or ""
    try:
        before = len(check_document(parse(text, str(file))))
        diagnostics = check_document(parse(edited(text, spans, name), str(file)))
    except InputError as error:
        raise RenameError(
            f"renaming would cause an error in '{display_path(file)}': {error.diagnostics[0].message}"
        ) from None
    if len(diagnostics) > before:
        raise RenameError(f"renaming would cause an error in '{display_path(file)}': {diagnostics[0].message}")


def _of_base(use: Occurrence, suffix: str) -> Span:
    """Return the span, within a use, of the name as it is defined: without quotes, and without `_back` or `_01`."""
    span = use.span
    quoted = span.end_column - span.column - len(use.name) == 2
    start = span.column + quoted
    return Span(span.line, start, span.line, start + len(use.name) - len(suffix))


def _order(span: Span) -> tuple[int, int]:
    return span.line, span.column
