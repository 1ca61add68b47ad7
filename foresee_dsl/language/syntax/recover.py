"""Finds the further errors of a file that the grammar refused: every statement is parsed on its own.

Only files with an error come here; a good file is parsed once, as a whole.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from typing import get_args

from lark import Token, Tree
from lark.exceptions import UnexpectedInput

from foresee_dsl.errors import Span
from foresee_dsl.language import model as m
from foresee_dsl.language.keywords import TAKEN, USAGE
from foresee_dsl.language.messages.suggest import closest
from foresee_dsl.language.model.pattern import form_of
from foresee_dsl.language.syntax.explain import Refusal
from foresee_dsl.language.syntax.grammar import PLACES, grammar_text, parse_tree
from foresee_dsl.language.syntax.nodes import MAX_DEPTH, TextError
from foresee_dsl.language.syntax.scan import MOST, Lines, Raw, scan

_Tree = Tree[Token]
_EXTENDS = re.compile(r"\bextends\b")
_LABEL = re.compile(r"(?:add\s+|change\s+)?(?:when|expect)\s+(?:(?:once|every|next)\s+)?([a-z]+)\s*:")
_NO_HEAD = "write what it belongs to, such as `ego: car.sedan { ... }`, or remove the braces"

_DEFINITIONS = {kind.pattern.split()[0]: m.rule_of(kind) for kind in get_args(m.Definition) if kind is not m.Extension}
"""The rule of each definition, by its first word."""
_HOLDERS = ("add", "change")
"""Words in front of a whole statement, in a scenario that extends another."""


@cache
def _blocks() -> Mapping[str, str]:
    """The rule of the statements inside the braces of a statement, by its first word; read off the grammar."""
    found = dict.fromkeys(form_of(m.Actor, "kind").words, "actor_item")
    for line in grammar_text().split("\n"):
        inner = re.search(r"block\{(\w+)\}", line)
        word = re.search(r'[:|] "(\w+)"', line)
        if inner is not None and word is not None:
            found.setdefault(word[1], inner[1])
    return found


def recover(text: str) -> tuple[_Tree, list[TextError]]:
    """Return a tree of the statements that are well-formed, and what is wrong with the others."""
    return _Recovery(text).run()


class _Recovery:
    def __init__(self, text: str) -> None:
        self._text = text
        self._lines = Lines(text)
        self._errors: list[TextError] = []
        self._depth = 0

    def run(self) -> tuple[_Tree, list[TextError]]:
        statements, self._errors = scan(self._text, self._lines)
        broken_braces = bool(self._errors)
        trees: list[Token | _Tree] = []
        definitions = statements
        if statements and self._first_word(statements[0]) == "foresee":
            tree = self._parse(statements[0], "header")
            trees += [tree] if tree is not None else []
            definitions = statements[1:]
        elif statements:
            self._header_missing(statements[0])
            near = closest(self._first_word(statements[0]), ("foresee", *_DEFINITIONS))
            definitions = statements[1:] if near == "foresee" else statements
        if not definitions and not self._errors:
            place = self._lines.span(len(self._text), len(self._text) + 1)
            self._errors.append(TextError("FS014", "this file defines nothing", _one_of_the_definitions(), place))
        for k, raw in enumerate(definitions):
            if k > 0 and broken_braces:
                break  # what follows a brace too many belongs to the first definition
            tree = self._definition(raw, is_first=k == 0)
            trees += [tree] if tree is not None else []
        return Tree("file", trees), self._errors

    def _header_missing(self, first: Raw) -> None:
        place = self._span(first)
        help = "write `foresee 1`, the version of the language, on the first line"
        self._errors.append(TextError("FS009", "the first line must be `foresee 1`", help, place))

    def _definition(self, raw: Raw, *, is_first: bool) -> _Tree | None:
        word = self._first_word(raw)
        if len(self._errors) >= MOST:
            return None
        if not word:
            place = self._lines.span(raw.open, raw.open + 1)
            self._errors.append(TextError("FS003", "a block without a statement in front of it", _NO_HEAD, place))
            return None
        meant = word if word in _DEFINITIONS else closest(word, _DEFINITIONS)
        if not is_first:
            message = f"a second definition, `{word[:40]}`, in one file"
            if word in _DEFINITIONS:
                self._errors.append(TextError("FS008", message, "give it a file of its own", self._span(raw)))
            else:
                self._errors.append(
                    TextError("FS008", f"`{word[:40]}` stands outside the braces", "move it inside", self._span(raw))
                )
            return None
        if meant is None:
            what = f"`{word[:40]}` cannot be what a file defines"
            self._errors.append(TextError("FS004", what, _one_of_the_definitions(), self._span(raw)))
            return None
        if word != meant:
            self._misspelt(raw, word, meant)
            return None
        extends = meant == "scenario" and _EXTENDS.search(self._text, raw.start, raw.end)
        rule, inner = ("extension", "extension_item") if extends else (_DEFINITIONS[meant], None)
        return self._statement(raw, rule, inner)

    def _misspelt(self, raw: Raw, word: str, meant: str) -> None:
        at = self._lines.span(raw.start, raw.start + len(word))
        self._errors.append(TextError("FS004", f"unknown word '{word[:40]}'", f"did you mean '{meant}'?", at))
        self._block(raw, _blocks()[meant])

    def _statement(self, raw: Raw, rule: str, inner: str | None = None) -> _Tree | None:
        """Parse one statement; its block's statements (of the rule `inner`) one by one."""
        if len(self._errors) >= MOST:
            return None
        inner = inner or self._inner(raw, rule)
        tree = self._parse(raw, rule)
        children = self._block(raw, inner) if raw.block is not None and inner is not None else []
        if tree is None:
            return None
        holder = tree
        if tree.data in ("add", "replace"):
            holder = next(c for c in tree.children if isinstance(c, Tree))
        block = next((c for c in holder.children if isinstance(c, Tree) and c.data == "block"), None)
        if block is not None:
            block.children = list(children)
            block.meta.line, block.meta.column = self._lines.place(raw.open)
            block.meta.end_line, block.meta.end_column = self._lines.place(raw.close)
            for at in (tree.meta, holder.meta):
                at.end_line, at.end_column = block.meta.end_line, block.meta.end_column
        return tree

    def _inner(self, raw: Raw, rule: str) -> str | None:
        """Return the rule of the statements in a statement's braces, by its first word."""
        word = self._first_word(raw)
        if rule == "extension_item" and word in _HOLDERS:
            word = self._word(raw, 1)
        if rule == "action" and word != "then":
            return None
        near = closest(word, _blocks()) if word not in _blocks() and raw.block is not None else word
        return _blocks().get(near or "")

    def _block(self, raw: Raw, rule: str) -> list[_Tree]:
        if self._depth > MAX_DEPTH:
            message = "this is nested too deeply"
            self._errors.append(TextError("FS018", message, "split it into several statements", self._span(raw)))
            return []
        self._depth += 1
        trees = [self._statement(inner, rule) for inner in raw.block or ()]
        self._depth -= 1
        return [tree for tree in trees if tree is not None]

    def _parse(self, raw: Raw, rule: str) -> _Tree | None:
        """Parse the head of a statement, with empty braces if it has any."""
        head = self._text[raw.start : raw.end]
        try:
            tree, _ = parse_tree(head + " {}" if raw.block is not None else head, rule)
        except UnexpectedInput as error:
            self._errors.append(self._explained(error, raw, head, rule))
            return None
        line, column = self._lines.place(raw.start)
        _shift(tree, line - 1, column - 1)
        return tree

    def _explained(self, error: UnexpectedInput, raw: Raw, head: str, rule: str) -> TextError:
        label = _LABEL.match(head)
        if label is not None and label[1] in TAKEN:
            place = self._lines.span(raw.start + label.start(1), raw.start + label.end(1))
            return TextError("FS049", f"'{label[1]}' is a word of the language", "give it another label", place)
        refusal = Refusal(error, head if raw.block is None else head + " {}", rule)
        if refusal.start >= len(head) and raw.block is not None:
            return self._at_brace(refusal, raw, rule)
        place = self._lines.span(raw.start + refusal.start, raw.start + min(refusal.end, len(head) + 1))
        return TextError(refusal.code, refusal.message, refusal.help, place)

    def _at_brace(self, refusal: Refusal, raw: Raw, rule: str) -> TextError:
        place = self._lines.span(raw.open, raw.open + 1)
        word = self._first_word(raw)
        if raw.start == raw.end:
            return TextError("FS003", "a block without a statement in front of it", _NO_HEAD, place)
        if rule in PLACES and word in USAGE and "{" not in USAGE[word]:
            return TextError("FS003", f"`{word}` has no block", f"write it like `{USAGE[word]}`", place)
        return TextError(refusal.code, refusal.message, refusal.help, place)

    def _first_word(self, raw: Raw) -> str:
        return self._word(raw, 0)

    def _word(self, raw: Raw, index: int) -> str:
        words = self._text[raw.start : raw.end].split(maxsplit=index + 1)
        return words[index].rstrip(":") if index < len(words) else ""

    def _span(self, raw: Raw) -> Span:
        return self._lines.span(raw.start, max(raw.end, raw.start + 1))


def _one_of_the_definitions() -> str:
    return f"a file holds one of: {', '.join(_DEFINITIONS)}"


def _shift(tree: _Tree, lines: int, columns: int) -> None:
    """Move a tree from the beginning of a text to where its statement stands."""
    for subtree in tree.iter_subtrees():
        metas: Sequence[object] = (subtree.meta, *(c for c in subtree.children if isinstance(c, Token)))
        for at in metas:
            _shift_one(at, lines, columns)


def _shift_one(at: object, lines: int, columns: int) -> None:
    if getattr(at, "line", None) is None:
        return
    for line, column in (("line", "column"), ("end_line", "end_column")):
        if getattr(at, line) == 1:
            setattr(at, column, getattr(at, column) + columns)
        setattr(at, line, getattr(at, line) + lines)
