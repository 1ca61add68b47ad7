"""Reads a text, with or without errors: cuts it into statements by its braces and lines, and parses each with its rule.

So an error in one statement leaves the trees of all other statements intact. The parser of files, the editor and the
fuzzer read every text this way. Measured when it replaced a parser of whole files: the bundled scenarios take 1.05
times as long.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import get_args

from lark import Token, Tree
from lark.exceptions import UnexpectedInput

from foresee_dsl.errors import Diagnostic
from foresee_dsl.helps import Help, HelpText, meant_word, move_inside, one_of, remove, rename, write
from foresee_dsl.language import model as m
from foresee_dsl.language.keywords import USAGE
from foresee_dsl.language.messages.suggest import closest
from foresee_dsl.language.model.pattern import form_of
from foresee_dsl.language.syntax.explain import Refusal
from foresee_dsl.language.syntax.grammar import PLACES, grammar_text, parse_tree
from foresee_dsl.language.syntax.nodes import MAX_DEPTH
from foresee_dsl.language.syntax.phrases import CODE, block_of, without_comments
from foresee_dsl.language.syntax.scan import MOST, CutText, Raw, scan

_Tree = Tree[Token]
_EXTENDS = re.compile(r"scenario\s+(?!\w+\s*\Z).*\bextends\b", re.DOTALL)
"""Matches the head of a scenario that extends another; a scenario may have the name `extends`."""
_LABEL = re.compile(r"(?:add\s+|change\s+)?(?:when|expect)\s+(?:(?:once|every|next)\s+)?([a-z]+)\s*:")
_NAME = re.compile(r"[^\W\d]\w*")
_NO_HEAD = "write its statement in front, such as `ego: car.sedan { ... }`, or " + remove("remove the braces")

_DEFINITIONS = {kind.pattern.split()[0]: m.rule_of(kind) for kind in get_args(m.Definition) if kind is not m.Extension}
"""The rule of each definition, by its first word."""
_ENDS = tuple((f"{around}{end}line", f"{around}{end}column") for around in ("", "container_") for end in ("", "end_"))
"""Lark's attributes for the ends of a tree, without and with the brackets around it."""
_SHORT, _KEPT = 200, 1024
"""Statements up to the first length, in characters, are kept as they were parsed, at most as many as the second: the
versions of a file in an editor, and a text and its formatted form, have most statements in common. Ours: 1024 trees
take about 5 MB, and reading a scenario of 2,000 characters again takes 7 ms instead of 14 ms (measured)."""
_HOLDERS = ("add", "change")
"""Words in front of a whole statement, in a scenario that extends another."""


@cache
def _blocks() -> Mapping[str, str]:
    """Return the rule of the statements in a statement's braces, by its first word; read from the grammar."""
    rules = dict.fromkeys(form_of(m.Actor, "kind").words, "actor_item")
    for line in grammar_text().split("\n"):
        inner = re.search(r"block\{(\w+)\}", line)
        word = re.search(r'[:|] "(\w+)"', line)
        if inner is not None and word is not None:
            rules.setdefault(word[1], inner[1])
    return rules


@dataclass(frozen=True, slots=True)
class Reading:
    """A text that was read.

    Attributes:
        tree: the tree of the statements without errors. errors: the errors of the other statements, at most as many as
            requested.
        cut: the text, with blanks in place of comments in the form of other languages, and all its statements as text.
    """

    tree: _Tree
    errors: list[Diagnostic]
    cut: CutText


def read(text: str, most: int = MOST) -> Reading:
    """Return a text as it was read (its newlines are `\n`); reading stops after `most` errors."""
    readable, foreign = without_comments(text)
    cut = scan(readable)
    reader = _Reader(cut, most)
    tree, errors = reader.tree(), reader.errors
    if errors:
        elses = {error.span for error in errors if error.code == CODE}  # `} else {` is reported as one error
        errors = [error for error in errors if error.code == CODE or error.span not in elses]
    others = [
        Diagnostic.of(CODE, remark.message, remark.help, span=cut.lines.span(remark.start, remark.end))
        for remark in foreign
    ]
    return Reading(tree, [*others, *errors], cut)


class _Reader:
    def __init__(self, cut: CutText, most: int) -> None:
        self._cut, self._text, self._most = cut, cut.text, most
        self.errors = cut.errors
        self._depth = 0

    def tree(self) -> _Tree:
        """Return the tree of the statements without errors; `errors` then has the errors of the other statements."""
        statements, broken_braces = self._cut.statements, bool(self.errors)
        trees: list[_Tree | None] = []
        definitions = statements
        if statements and self._starts_with_version(statements[0]):
            trees.append(self._parse(statements[0], "header"))
            definitions = statements[1:]
        elif statements:
            help = "write " + write("foresee 1") + ", the version of the language, on the first line"
            self._error_of(statements[0], "FS009", "the first line must be `foresee 1`", help)
            near = closest(self._word(statements[0]), ("foresee", *_DEFINITIONS))
            definitions = statements[1:] if near == "foresee" else statements
        if not definitions and not self.errors:
            end = len(self._text)
            self._error("FS014", "this file defines nothing", _one_of_the_definitions(""), end, end + 1)
        for k, raw in enumerate(definitions):
            if k > 0 and broken_braces:
                break  # statements after a surplus closing brace belong to the first definition
            trees.append(self._definition(raw, is_first=k == 0))
        return Tree("file", [tree for tree in trees if tree is not None])

    def _starts_with_version(self, raw: Raw) -> bool:
        name = _NAME.match(self._text, raw.start, raw.end)
        return name is not None and name[0] == "foresee"

    def _definition(self, raw: Raw, *, is_first: bool) -> _Tree | None:
        word = self._word(raw)
        if len(self.errors) >= self._most:
            return None
        meant = word if word in _DEFINITIONS else closest(word, _DEFINITIONS)
        if not word:
            self._error("FS003", "this block has no statement in front of it", _NO_HEAD, raw.open, raw.open + 1)
        elif not is_first and word in _DEFINITIONS:
            message = f"this file has a second definition, `{word[:40]}`"
            self._error_of(raw, "FS008", message, "give it a file of its own")
        elif not is_first:
            self._error_of(raw, "FS008", f"`{word[:40]}` is outside the braces", move_inside("move it inside"))
        elif meant is None:
            self._error_of(raw, "FS004", f"a file cannot define `{word[:40]}`", _one_of_the_definitions(word))
        elif word != meant:
            end = raw.start + len(word)
            self._error("FS004", f"unknown word '{word[:40]}'", meant_word(meant, word), raw.start, end)
            self._block(raw, _blocks()[meant])
        elif meant == "scenario" and _EXTENDS.match(self._text[raw.start : raw.end]):
            return self._statement(raw, "extension", "extension_item")
        else:
            return self._statement(raw, _DEFINITIONS[meant])
        return None

    def _statement(self, raw: Raw, rule: str, inner: str | None = None) -> _Tree | None:
        """Parse one statement, and then one by one the statements of its block, by the rule `inner`."""
        if len(self.errors) >= self._most:
            return None
        inner = inner or self._inner(raw, rule)
        tree = self._parse(raw, rule)
        children = self._block(raw, inner) if raw.block is not None and inner else []
        if tree is None:
            return None
        holder = tree
        if tree.data in ("add", "replace"):
            holder = next(c for c in tree.children if isinstance(c, Tree))
        block = next((c for c in holder.children if isinstance(c, Tree) and c.data == "block"), None)
        if block is not None:
            if inner is None:
                raise TypeError(f"no rule is known for the statements in the braces of `{self._word(raw)}`")
            block.children = list(children)
            block.meta.line, block.meta.column = self._cut.lines.place(raw.open)
            block.meta.end_line, block.meta.end_column = self._cut.lines.place(raw.close)
            for at in (tree.meta, holder.meta):
                at.end_line, at.end_column = block.meta.end_line, block.meta.end_column
        return tree

    def _inner(self, raw: Raw, rule: str) -> str | None:
        """Return the rule of the statements in a statement's braces, by its first word."""
        word = self._word(raw)
        if rule == "extension_item" and word in _HOLDERS:
            word = self._word(raw, 1)
        if rule == "action" and word != "then":
            return None
        word = word.partition(":")[0]  # `ego:car.sedan` has no blank
        if word not in _blocks() and raw.block is not None:
            near = block_of(word)
            return near if near is not None else _blocks().get(closest(word, _blocks()) or "")
        return _blocks().get(word)

    def _block(self, raw: Raw, rule: str) -> list[_Tree]:
        if self._depth > MAX_DEPTH:
            self._error_of(raw, "FS018", "this is nested too deeply", "split it into several statements")
            return []
        self._depth += 1
        trees = [self._statement(inner, rule) for inner in raw.block or ()]
        self._depth -= 1
        return [tree for tree in trees if tree is not None]

    def _parse(self, raw: Raw, rule: str) -> _Tree | None:
        """Parse the head of a statement, with empty braces if it has any."""
        head = self._text[raw.start : raw.end]
        statement = head + " {}" if raw.block is not None else head
        parsed = _kept(statement, rule) if len(statement) <= _SHORT else _parsed(statement, rule)
        if isinstance(parsed, Refusal):
            self.errors.append(self._explained(parsed, raw, head, rule))
            return None
        line, column = self._cut.lines.place(raw.start)
        return _shifted(parsed, line - 1, column - 1)

    def _explained(self, refusal: Refusal, raw: Raw, head: str, rule: str) -> Diagnostic:
        label = _LABEL.match(head)
        if label is not None and label[1] in m.TAKEN:
            place = self._cut.lines.span(raw.start + label.start(1), raw.start + label.end(1))
            help = rename("give it another label", everywhere=True)
            return Diagnostic.of("FS049", f"'{label[1]}' is a word of the language", help, span=place)
        if refusal.start >= len(head) and raw.block is not None:
            return self._at_brace(refusal, raw, rule)
        place = self._cut.lines.span(raw.start + refusal.start, raw.start + min(refusal.end, len(head) + 1))
        return Diagnostic.of(refusal.code, refusal.message, refusal.help, span=place)

    def _at_brace(self, refusal: Refusal, raw: Raw, rule: str) -> Diagnostic:
        place = self._cut.lines.span(raw.open, raw.open + 1)
        word = self._word(raw)
        if raw.start == raw.end:
            return Diagnostic.of("FS003", "this block has no statement in front of it", _NO_HEAD, span=place)
        if rule in PLACES and word in USAGE and "{" not in USAGE[word]:
            return Diagnostic.of("FS003", f"`{word}` takes no block", "write it like " + write(USAGE[word]), span=place)
        return Diagnostic.of(refusal.code, refusal.message, refusal.help, span=place)

    def _word(self, raw: Raw, index: int = 0) -> str:
        words = self._text[raw.start : raw.end].split(maxsplit=index + 1)
        return words[index].rstrip(":") if index < len(words) else ""

    def _error(self, code: str, message: str, help: HelpText, start: int, end: int) -> None:
        self.errors.append(Diagnostic.of(code, message, help, span=self._cut.lines.span(start, end)))

    def _error_of(self, raw: Raw, code: str, message: str, help: HelpText) -> None:
        """Add an error about a whole statement."""
        self._error(code, message, help, raw.start, max(raw.end, raw.start + 1))


def _one_of_the_definitions(wrong: str) -> Help:
    return "a file defines one of: " + one_of(_DEFINITIONS, wrong=wrong)


def _parsed(statement: str, rule: str) -> _Tree | Refusal:
    """Return the tree of a statement, with empty braces instead of its block, or why the grammar refuses it."""
    try:
        return parse_tree(statement, rule)
    except UnexpectedInput as error:
        return Refusal(error, statement, rule)


@lru_cache(maxsize=_KEPT)
def _kept(statement: str, rule: str) -> _Tree | Refusal:
    """Return the same for a short statement; the tree must not be changed."""
    return _parsed(statement, rule)


def _shifted(tree: _Tree, lines: int, columns: int) -> _Tree:
    """Return a copy of a tree with its positions, which count from its statement, as those in the file; `lines` and
    `columns` give the statement's place."""
    copy = _shifted_tree(tree, lines, columns)
    trees = [copy]
    while trees:
        children = trees.pop().children
        for k, child in enumerate(children):
            if isinstance(child, Tree):
                children[k] = shifted = _shifted_tree(child, lines, columns)
                trees.append(shifted)
            elif child is not None:
                children[k] = _shifted_token(child, lines, columns)
    return copy


def _shifted_tree(tree: _Tree, lines: int, columns: int) -> _Tree:
    """Return a copy of a tree with its own position shifted, and the same children."""
    copy: _Tree = Tree(tree.data, list(tree.children))
    if not tree.meta.empty:
        places = vars(copy.meta)  # Lark sets the attributes without declaring them
        places.update(vars(tree.meta))
        for line, column in _ENDS:
            if places[line] == 1:
                places[column] += columns
            places[line] += lines
    return copy


def _shifted_token(token: Token, lines: int, columns: int) -> Token:
    copy = Token.new_borrow_pos(token.type, token.value, token)
    line, end_line = token.line or 1, token.end_line or 1
    if line == 1:
        copy.column = (token.column or 1) + columns
    if end_line == 1:
        copy.end_column = (token.end_column or 1) + columns
    copy.line, copy.end_line = line + lines, end_line + lines
    return copy
