"""A file's outline, what of it can be folded, and what its names are."""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl.editor.syntax import plain, read_syntax, walk
from foresee_dsl.errors import Span
from foresee_dsl.language.syntax.nodes import Node

_UNNAMED = {"When": "when", "Expect": "expect", "Origin": "origin", "Window": "window", "Weather": "weather"}
"""Statements without a name of their own that an outline still shows."""


@dataclass(frozen=True)
class Entry:
    """A line of the outline: the name, the class of the model (`Actor`), more about it, its places, what is in it."""

    name: str
    kind: str
    detail: str
    span: Span
    name_span: Span
    children: tuple[Entry, ...] = ()


def outline(text: str) -> tuple[Entry, ...]:
    """Return the outline of a text, as far as it can be read."""
    root = read_syntax(text).root
    if root is None:
        return ()
    return _entries(root, plain(text).split("\n"))


def folds(text: str) -> tuple[tuple[int, int, str], ...]:
    """Return the ranges of lines (1-based, both ends) that can be folded, with `region` or `comment`."""
    syntax = read_syntax(text)
    found: dict[tuple[int, int, str], None] = {}
    if syntax.root is not None:
        for node, _ in walk(syntax.root):
            if node.block is not None and node.block.end_line > node.span.line + 1:
                found[node.span.line, node.block.end_line - 1, "region"] = None
    run: list[int] = []
    lines = plain(text).split("\n")
    for number, line in enumerate([*lines, ""], start=1):
        if line.lstrip().startswith("#"):
            run.append(number)
            continue
        if len(run) > 1:
            found[run[0], run[-1], "comment"] = None
        run = []
    return tuple(sorted(found))


def _entries(node: Node, lines: list[str]) -> tuple[Entry, ...]:
    """The entry of a node; or, where it has none, those of what is in it."""
    inside: list[Entry] = []
    for value in node.fields.values():
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, Node):
                inside += _entries(part, lines)
    inside.sort(key=lambda entry: (entry.span.line, entry.span.column))
    kind = node.kind.__name__
    name = node.fields.get("name")
    head = (
        lines[node.span.line - 1][node.span.column - 1 :].split("{")[0].strip() if node.span.line <= len(lines) else ""
    )
    if kind == "Ego":
        place = Span(node.span.line, node.span.column, node.span.line, node.span.column + len("ego"))
        return (Entry("ego", kind, head, node.span, place, tuple(inside)),)
    if isinstance(name, str) and "name" in node.places and kind not in ("Ref", "Assignment", "Named", "Drop"):
        return (Entry(name, kind, head, node.span, node.places["name"], tuple(inside)),)
    if kind in _UNNAMED:
        place = Span(node.span.line, node.span.column, node.span.line, node.span.column + len(_UNNAMED[kind]))
        return (Entry(head, kind, "", node.span, place, tuple(inside)),)
    return tuple(inside)
