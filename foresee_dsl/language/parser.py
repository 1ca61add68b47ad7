"""Turns texts and files of the language into models: `parse` for a text, `load` for a file; `format_text` returns the
text in the standard layout."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pydantic
from lark import Token, Tree

from foresee_dsl import disk_cache
from foresee_dsl.errors import Diagnostic, InputError, Span
from foresee_dsl.files import NotOrdinaryError, open_outside
from foresee_dsl.helps import HelpText, meant_code, meant_word, write
from foresee_dsl.language.document import Document
from foresee_dsl.language.model import Catalogue, Definition, Extension, Network
from foresee_dsl.language.syntax.builder import Builder
from foresee_dsl.language.syntax.comments import attach
from foresee_dsl.language.syntax.node import Node
from foresee_dsl.language.syntax.nodes import NodeMaker, span_of
from foresee_dsl.language.syntax.reading import read
from foresee_dsl.language.syntax.scan import MOST, Lines
from foresee_dsl.language.traversal import walk
from foresee_dsl.limits import most, raised_by

if TYPE_CHECKING:
    from collections.abc import Sequence

VERSION = "1"
"""The version of the language that this tool reads: the number in the first line, `foresee 1`."""

MAX_BYTES = 2_000_000
"""Size of the largest file that is read, bytes (ours: a hundred times the largest clip of a scene with twenty
actors)."""

_MAX_EXPLAINED = 200_000
"""Length from which only the first error of the grammar in a text is reported, in characters (ours: explaining one
takes some ms)."""

_NESTED = re.compile(r"[-(][-(\s]*")
_MOST_NESTED = 1000
"""Number of brackets or minus signs in a row from which a text is refused before parsing, which would take seconds
(ours: 25 times the depth that is refused after parsing)."""

_SMALL = 10_000
"""Length below which the parts of a text are not counted, in characters: so short a text cannot exceed a limit (a part
of a condition takes three characters)."""
_UNCOUNTED = re.compile(r'"[^"\n]*"|#[^\n]*')
_COUNTED = (
    ("conditions", re.compile(r"\b(?:and|or|not)\b"), "conditions of {} parts (`and`, `or`, `not`)"),
    ("network", re.compile(r"^[ \t]*(?:junction|road|building)\b", re.MULTILINE), "{} junctions, roads and buildings"),
)


def parse(text: str, path: str) -> Document:
    """Return the document of a text; a byte order mark and any kind of newline are accepted. `path` is the name of the
    file in messages.

    Raises:
        InputError: the text has errors; all are in it, once each, in the order of their places.
    """
    text = plain(text)
    if not text.strip():
        help = "begin with " + write("foresee 1") + ", then a scenario, network, clip, mutant or models block"
        raise InputError((Diagnostic.of("FS002", "the file is empty", help, path),))
    _refuse_conflicts(text, path)
    _check_size(text, path)
    reading = read(text, MOST if len(text) <= _MAX_EXPLAINED else 1)
    tree, errors = reading.tree, [*reading.errors]
    partial = bool(errors)
    if partial and len(text) > _MAX_EXPLAINED:
        tree = Tree("file", [])
    maker, builder = NodeMaker(tree), Builder(partial=partial)
    parts = [child for child in tree.children if isinstance(child, Tree)]
    header = next((child for child in parts if child.data == "header"), None)
    if header is not None:
        errors += _wrong_version(header)
    nodes = [maker.make(child) for child in parts if child.data != "header"]
    if maker.settles:
        from foresee_dsl.language.syntax.parameters import settle

        whole = all(node.kind is not Extension for node in nodes)
        errors += settle(maker.stated, whole=whole, partial=partial)
    models = [builder.build(node) for node in nodes]
    errors += [*maker.errors, *builder.errors, *_nameless(nodes, path)]
    if errors:
        from foresee_dsl.language.checks.broken_files import with_certain
        from foresee_dsl.language.messages.own_names import with_own_names

        diagnostics = with_certain(_diagnostics(errors, text, path), nodes, reading, path, load)
        raise InputError(with_own_names(diagnostics, text))
    model = models[0]
    if header is None or not isinstance(model, Definition):
        raise TypeError("the grammar lets a file be a header and one definition, nothing else")
    around = attach(nodes[0], span_of(header), reading.cut.comments, text)
    spans, calculates = builder.spans, maker.calculates or maker.settles
    return Document(path=path, text=text, model=model, spans=spans, comments=around, calculates=calculates)


def plain(text: str) -> str:
    """Return a text as the grammar reads it: newlines are `\\n`, no byte order mark."""
    return text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")


_CONFLICT_BEGINS = re.compile(r"^<{7}(?: .*)?$", re.MULTILINE)
_CONFLICT_ENDS = re.compile(r"^>{7}(?: .*)?$", re.MULTILINE)
"""The lines around the two versions of some lines that git could not merge (git-merge(1), "How conflicts are
presented")."""


def _refuse_conflicts(text: str, path: str) -> None:
    """Check that a text has no marks of an unresolved merge.

    Raises:
        InputError: it has some; other errors are not searched, since most come from the marks and the double lines.
    """
    begins = _CONFLICT_BEGINS.search(text)
    if begins is None:
        return
    lines, errors = Lines(text), list[Diagnostic]()
    while begins is not None and len(errors) < MOST:
        ends = _CONFLICT_ENDS.search(text, begins.end())
        if ends is None:
            break
        place = lines.span(begins.start(), ends.end())
        message = f"an unresolved merge conflict, lines {place.line} to {place.end_line}"
        help = "keep the lines that are meant, and remove the lines that begin with `<<<<<<<`, `=======` and `>>>>>>>`"
        errors.append(Diagnostic.of("FS003", message, help, span=place))
        begins = _CONFLICT_BEGINS.search(text, ends.end())
    if errors:
        raise InputError(_diagnostics(errors, text, path))


def _check_size(text: str, path: str) -> None:
    """Check that a text can be parsed in seconds.

    Raises:
        InputError: parsing would take longer; the message names the option that allows it nevertheless.
    """
    if len(text) < _SMALL:
        return
    counted = _UNCOUNTED.sub(lambda match: " " * len(match[0]), text)
    if counted.count("-") + counted.count("(") >= _MOST_NESTED:
        _check_nesting(counted, text, path)
    for name, pattern, what in _COUNTED:
        count, allowed = len(pattern.findall(counted)), most(name)
        if count > allowed:
            message = f"the file has {what.format(f'{count:,}')}, more than {allowed:,.0f}"
            help = f"divide it into several files; {raised_by(name, count)}"
            raise InputError((Diagnostic("FS002", message, help, path),))


def _check_nesting(counted: str, text: str, path: str) -> None:
    for signs in _NESTED.finditer(counted):
        if signs[0].count("-") + signs[0].count("(") >= _MOST_NESTED:
            place = Lines(text).span(signs.start(), signs.end())
            error = Diagnostic.of("FS018", "this is nested too deeply", "split it into several statements", span=place)
            raise InputError(_diagnostics([error], text, path))


def load(path: Path, shown_as: str | None = None) -> Document:
    """Return the document of a file. `shown_as` is its name in messages, as the user wrote it; by default the path
    itself.

    Raises:
        InputError: the file is missing, is a folder, is too large, is not UTF-8 text, or has errors.
    """
    name = shown_as if shown_as is not None else str(path)
    text = read_text(path, name)
    place = disk_cache.entry("documents", (name, text, pydantic.VERSION))
    cached = disk_cache.load(place)
    if cached is not None:
        stored: tuple[Document, Iterable[tuple[object, str, _Numbers]]] = cached
        document, spans = stored  # places are keyed by `id(item)`, so both must come from one pickle
        return replace(document, spans={(id(item), field): Span(*numbers) for item, field, numbers in spans})
    document = parse(text, name)
    if isinstance(document.model, (Network, Catalogue)):  # many files use them, and they are seldom edited
        items = {id(item): item for item in walk(document.model)}
        # Spans as tuples: unpickling a frozen dataclass takes four times as long.
        spans = [
            (items[key], field, (at.line, at.column, at.end_line, at.end_column))
            for (key, field), at in document.spans.items()
        ]
        disk_cache.store(place, (replace(document, spans={}), spans))
    return document


_Numbers = tuple[int, int, int, int]


def read_text(path: Path, name: str) -> str:
    """Return a file's text, byte order mark and newlines as they are; `name` is how messages call it.

    Raises:
        InputError: the file is missing, is a folder, is too large, or is not UTF-8 text.
    """
    try:
        with open_outside(path) as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        raise InputError((_unreadable(path, name, error),)) from None
    return decode(content, name)


def decode(content: bytes, name: str) -> str:
    """Return a file's bytes as text; `name`: the file's name in messages."""
    if len(content) > MAX_BYTES:
        help = f"files of the language have at most {MAX_BYTES // 1_000_000} MB"
        raise InputError((Diagnostic("FS002", "the file is too large", help, name),))
    if b"\0" in content:
        raise InputError((Diagnostic("FS002", "this is a binary file", "a text file is needed", name),))
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        message = f"the file is not UTF-8 text (line {line}, byte 0x{content[error.start]:02x})"
        raise InputError((Diagnostic("FS002", message, "save it as UTF-8", name),)) from None


def format_text(text: str, path: str) -> str:
    """Return the text in the canonical layout, with all its comments and the author's grouping.

    Raises:
        InputError: the text has errors, or (a fault of this tool) the result would not mean the same.
    """
    from foresee_dsl.language.printer import print_model

    document = parse(text, path)
    result = print_model(document.model, document.comments)
    again = parse(result, path)
    if again.model != document.model or _comment_texts(again) != _comment_texts(document):
        message = "formatting would have changed what this file says, so it was left as it is"
        help = "this is an error in foresee-dsl: please report it with the file"
        raise InputError((Diagnostic("FS020", message, help, path),))
    return result


def _wrong_version(header: Tree[Token]) -> Iterable[Diagnostic]:
    number = header.children[0]
    if str(number) != VERSION and isinstance(number, Token):
        message = f"this file is written in version {str(number)[:20]} of the language"
        yield Diagnostic.of("FS009", message, "this tool reads " + write(f"foresee {VERSION}"), span=span_of(number))


def _nameless(nodes: Sequence[Node], path: str) -> Iterable[Diagnostic]:
    """Report a network without a name in a file of its own (inside a scenario it needs no name)."""
    for node in nodes:
        if node.kind is Network and "name" not in node.places:
            place = Span(node.span.line, node.span.column, node.span.line, node.span.column + len("network"))
            stem = re.sub(r"\W+", "_", Path(path).stem.lower()).strip("_")
            name = stem if re.fullmatch(r"[a-z][a-z0-9_]*", stem) else "town"
            yield Diagnostic.of("FS014", "this network needs a name", meant_code(f"network {name}"), span=place)


def _diagnostics(errors: Iterable[Diagnostic], text: str, path: str) -> tuple[Diagnostic, ...]:
    """Return the errors of a text with their file and source lines, each once, in the order of their places."""
    lines = text.split("\n")
    by_place: dict[tuple[int, int, str], Diagnostic] = {}
    for error in errors:
        line = error.start[0]
        source = lines[line - 1] if 0 < line <= len(lines) else ""
        by_place.setdefault((*error.start, error.message), replace(error, path=path, source_line=source))
    return tuple(by_place[key] for key in sorted(by_place))


def _unreadable(path: Path, name: str, error: Exception) -> Diagnostic:
    if isinstance(error, FileNotFoundError):
        near: HelpText = ""
        if path.parent.is_dir():
            from foresee_dsl.language.messages.suggest import closest

            nearest = closest(path.name, sorted(p.name for p in path.parent.iterdir()))
            near = meant_word(nearest, path.name) if nearest else ""
        return Diagnostic.of("FS001", "there is no such file", near, name)
    if isinstance(error, IsADirectoryError):
        return Diagnostic("FS001", "this is a folder", "name a file in it", name)
    if isinstance(error, PermissionError):
        return Diagnostic("FS001", "this file may not be read", "check its permissions", name)
    if isinstance(error, NotOrdinaryError):
        return Diagnostic("FS001", "this is not an ordinary file", "name a text file", name)
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return Diagnostic("FS001", f"this file cannot be read: {reason.lower()}", "", name)


def _comment_texts(document: Document) -> list[str]:
    texts: list[str] = []
    for comments in document.comments.values():
        around = (comments.after, comments.after_end)
        texts += [text for text in (*comments.before, *comments.at_end, *around) if text]
    return sorted(texts)
