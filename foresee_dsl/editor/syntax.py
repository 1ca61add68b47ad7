"""Reads a text that may be half written, and returns its readable part as positioned nodes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

from lark import Token, Tree

from foresee_dsl.language import model as m
from foresee_dsl.language.parser import MAX_BYTES, plain
from foresee_dsl.language.syntax.node import Node
from foresee_dsl.language.syntax.nodes import NodeMaker
from foresee_dsl.language.syntax.reading import read

_CACHED_TEXTS = 256
"""Number of texts whose syntax stays in memory. Ours: the files of a folder and some edits; about 100 kB each."""


@dataclass(frozen=True, slots=True)
class Syntax:
    """The readable part of a text.

    Attributes:
        root: the definition with all well-formed statements, or None if its head is not well-formed.
        whole: whether nothing was left out.
    """

    root: Node | None
    whole: bool


@lru_cache(maxsize=_CACHED_TEXTS)
def read_syntax(text: str) -> Syntax:
    """Return the readable part of a text; errors in the text never raise."""
    text = plain(text)
    if len(text) > MAX_BYTES:
        return Syntax(None, whole=False)
    reading = read(text)
    return Syntax(root_of(reading.tree), not reading.errors)


def root_of(tree: Tree[Token]) -> Node | None:
    """Return the definition of a file's tree as a node."""
    definition = next((c for c in tree.children if isinstance(c, Tree) and c.data != "header"), None)
    if definition is None:
        return None
    maker = NodeMaker(tree)
    root = maker.make(definition)
    if maker.settles:
        from foresee_dsl.language.syntax.parameters import settle

        settle(maker.stated, whole=root.kind is not m.Extension)
    return root


def walk(node: Node, above: tuple[Node, ...] = ()) -> Iterator[tuple[Node, tuple[Node, ...]]]:
    """Yield a node and all nodes in it, each with the nodes above it, outermost first, in the order of the file."""
    yield node, above
    inner = (*above, node)
    for part in node.parts:
        yield from walk(part, inner)
