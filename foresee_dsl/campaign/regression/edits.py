"""Edits single parts of a file's text and leaves the rest unchanged: an expected result, a sentence, paths, a name."""

from __future__ import annotations

import re
from collections.abc import Mapping

from foresee_dsl.errors import Span
from foresee_dsl.language import model as m
from foresee_dsl.language.document import Document
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import INDENT, print_item, print_model, quotable
from foresee_dsl.language.traversal import walk

_LONGEST = 500
"""Maximum length of a sentence for people, in characters. Ours: a quarter of the limit of a text in a file."""
_PATHS: tuple[tuple[type[m.Item], str], ...] = (
    (m.Clip, "parent"),
    (m.Mutant, "parent"),
    (m.Extension, "parent"),
    (m.UseNetwork, "path"),
    (m.UseModels, "path"),
    (m.UseTracks, "path"),
)
"""Fields that name another file which a test case needs."""


def with_expected(text: str, new: m.Expected) -> str:
    """Return a file's text with an expected result, which replaces the line for the same driver and case, if any.

    A new line is placed after the others, otherwise after the last `change` of a mutant, or before the first statement
    of another file.
    """
    document = parse(text, "a file to edit")
    body: tuple[m.Item, ...] = getattr(document.model, "body", ())
    stated = [item for item in body if isinstance(item, m.Expected)]
    old = next((item for item in stated if (item.driver, item.case) == (new.driver, new.case)), None)
    line = print_item(new)
    if old is not None:
        return _put(text, [(_span(document, old), line)])
    changes = [item for item in body if isinstance(item, m.Change)]
    heads = [item for item in body if isinstance(item, m.Doc | m.Tags)]
    after = next(iter((stated or changes or heads)[-1:]), None)
    lines = re.split(r"(\r\n|\r|\n)", text)  # lines and line ends alternate
    end = lines[1] if len(lines) > 1 else "\n"
    # If the statement has a line of its own, a new line is inserted after it; a text in any other layout is printed
    # anew.
    at = _span(document, after).end_line if after is not None else _span(document, document.model).line
    reference = lines[2 * (at - 1)]
    if after is None:
        if reference.split("#")[0].rstrip().endswith("{"):
            lines.insert(2 * at, f"{INDENT}{line}{end}{end if body else ''}")
            return "".join(lines)
    elif reference.lstrip().startswith(print_item(after).split("\n")[0].split(" ")[0]):
        indent = reference[: len(reference) - len(reference.lstrip())]
        apart = len(lines) > 2 * at and not lines[2 * at].strip()  # this file separates groups by blank lines
        lines.insert(2 * at, f"{end if apart and not stated else ''}{indent}{line}{end}")
        return "".join(lines)
    return _printed(document, new, after)


def _printed(document: Document, new: m.Expected, after: m.Item | None) -> str:
    body: tuple[m.Item, ...] = getattr(document.model, "body", ())
    at = next((k + 1 for k, item in enumerate(body) if item is after), 0)
    return print_model(document.model.model_copy(update={"body": (*body[:at], new, *body[at:])}))


def with_doc(text: str, sentence: str) -> str:
    """Return a file's text with a sentence that describes it, unless it has one already (`sentence_in`)."""
    document = parse(text, "a file to edit")
    if sentence_in(document):
        return text
    head = _span(document, document.model).line
    lines = re.split(r"(\r\n|\r|\n)", text)  # lines and line ends alternate
    if not lines[2 * (head - 1)].split("#")[0].rstrip().endswith("{"):
        return text
    lines.insert(2 * head, f'{INDENT}doc "{as_text(sentence)}"{lines[1]}{lines[1]}')
    return "".join(lines)


def as_text(sentence: str) -> str:
    """Return a sentence in the form of a text of the language: one line, without double quotes, not too long."""
    return quotable(sentence, _LONGEST)


def sentence_in(document: Document) -> str:
    """Return a file's description: its `doc`, or the comment before its definition or before a mutant's first item."""
    body: tuple[m.Item, ...] = getattr(document.model, "body", ())
    docs = [item.text for item in body if isinstance(item, m.Doc)]
    keys: tuple[tuple[str | int, ...], ...] = ((), ("body", 0)) if isinstance(document.model, m.Mutant) else ((),)
    comments = [" ".join(filter(None, document.comments[key].before)) for key in keys if key in document.comments]
    return next(filter(None, (*docs, *comments)), "")


def paths_in(document: Document) -> tuple[str, ...]:
    """Return the paths of the files that a file needs, as written."""
    return tuple(dict.fromkeys(path for _, _, path in _uses(document)))


def with_paths(text: str, paths: Mapping[str, str]) -> str:
    """Return a file's text with replaced paths of the files that it needs."""
    document = parse(text, "a file to edit")
    places = []
    for item, field, path in _uses(document):
        span = document.span(item, field)
        if span is not None and path in paths:
            places.append((span, f'"{paths[path]}"'))
    return _put(text, places)


def with_name(text: str, name: str) -> str:
    """Return a clip's or mutant's text with another name."""
    document = parse(text, "a file to edit")
    span = document.span(document.model, "name")
    return _put(text, [(span, name)]) if span is not None else text


def line_of(document: Document, item: m.Item) -> int | None:
    """Return the line on which an item begins."""
    span = document.span(item)
    return span.line if span is not None else None


def _uses(document: Document) -> list[tuple[m.Item, str, str]]:
    kinds = dict(_PATHS)
    uses = [(item, kinds[type(item)]) for item in walk(document.model) if type(item) in kinds]
    return [(item, field, getattr(item, field)) for item, field in uses]


def _span(document: Document, item: m.Item) -> Span:
    span = document.span(item)
    if span is None:
        raise ValueError(f"the position of {type(item).__name__} in its file is not known")
    return span


def _put(text: str, places: list[tuple[Span, str]]) -> str:
    """Return a text with replacements at some places, each within one line; the line ends are kept."""
    mark = "\ufeff" if text.startswith("\ufeff") else ""
    lines = re.split(r"(\r\n|\r|\n)", text.removeprefix(mark))
    for span, new in sorted(places, key=lambda place: (place[0].line, place[0].column), reverse=True):
        at = 2 * (span.line - 1)
        lines[at] = lines[at][: span.column - 1] + new + lines[at][span.end_column - 1 :]
    return mark + "".join(lines)
