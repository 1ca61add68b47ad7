"""Determines what the grammar accepts at a place of a half-written text, and what a word there would mean.

The text up to the place is reduced to the heads of the open blocks and the statement itself, so that errors elsewhere
have no effect. The parser then lists the tokens that it accepts. To learn what a name or a number would mean, a probe
is inserted there, the statement is ended in the shortest way, and the probe is searched in the resulting nodes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, cast

from lark import Token, Tree
from lark.exceptions import LarkError
from lark.parsers.lalr_interactive_parser import InteractiveParser

from foresee_dsl.editor.syntax import root_of, walk
from foresee_dsl.language.model import Item
from foresee_dsl.language.parser import plain
from foresee_dsl.language.syntax.expected import text_of
from foresee_dsl.language.syntax.grammar import parser
from foresee_dsl.language.syntax.node import Node

_PIECE = re.compile(r'"[^"\n]*"?|#[^\n]*|[{};\[\]()\n]|[^"#{};\[\]()\n]+')
_WORD_BEFORE = re.compile(r"[^\W\d][\w.]*$|(?<=[0-9\s])[^\W\d][\w/^]*$")
_PROBE = "zzprobe"
_NUMBER_PROBE = "987654321"
_PROBES = (_PROBE, _NUMBER_PROBE, f"{_PROBE}.{_PROBE}")
_CLOSERS = ("$END", "RBRACE", "RSQB", "RPAR", "NUMBER", "NAME", "DOTTED", "STRING", "PIN", "COMPARE", "UNIT", "LBRACE")
"""Order in which terminals are tried to end a statement in the shortest way: closing ones first, then values."""
_MORE = ("FUNCTION", "LPAR", "MINUS", "OPERATOR")
"""Terminals that turn a value into a calculation; they never end a statement."""
_MOST_STEPS = 60
"""Maximum number of tokens that are tried to end a statement. Ours: the longest heads need about twenty."""
_SAMPLES = {
    "NUMBER": "1",
    "NAME": "zz",
    "DOTTED": "zz.zz",
    "STRING": '"zz"',
    "PIN": "sha256:000000000000",
    "UNIT": "s",
    "COMPARE": "<",
}


@dataclass(frozen=True)
class Before:
    """The text before a place, reduced.

    Attributes:
        text: the heads of the open blocks and the statement up to the place, without the word being written.
        word: the beginning of the word at the place.
        in_string: whether the place is inside a quoted text, of which `word` is the beginning.
        in_comment: whether the place is inside a comment.
    """

    text: str
    word: str
    in_string: bool = False
    in_comment: bool = False


@dataclass(frozen=True)
class CompletionSlot:
    """A place for a name, number or unit in a half-written text: the node, its field, and the nodes above, outermost
    first."""

    token: str
    node: Node
    field: str
    above: tuple[Node, ...]


def before(text: str, offset: int) -> Before:
    """Return the reduced text before an offset (of the plain text)."""
    text = plain(text)[:offset]
    heads: list[int] = []
    start, depth, last, begun = 0, 0, "", False
    open_heads: list[str] = []
    for piece in _PIECE.finditer(text):
        last = piece[0]
        if last in ("[", "("):
            depth += 1
        elif last in ("]", ")"):
            depth = max(0, depth - 1)
        elif last == "{":
            open_heads.append(text[start : piece.end()])
            heads.append(start)
            start, depth = piece.end(), 0
        elif last == "}" and heads:
            start = heads.pop()
            open_heads.pop()
        elif (last == "\n" and depth == 0) or last == ";":
            begun = begun or bool(_without_comments(text[start : piece.start()]).strip())
            start = piece.end()
    statement = text[start:]
    above = ("foresee 1\n" if begun else "") + "".join(_without_comments(head) for head in open_heads)
    if last.startswith("#"):
        return Before("", "", in_comment=True)
    if last.startswith('"') and (len(last) == 1 or not last.endswith('"')):
        return Before(above + _without_comments(statement[: len(statement) - len(last)]), last[1:], in_string=True)
    begun_word = _WORD_BEFORE.search(statement)
    word = begun_word[0] if begun_word is not None else ""
    return Before(above + _without_comments(statement[: len(statement) - len(word)]), word)


def accepted(text: str) -> tuple[str, ...]:
    """Return the names of the terminals that may follow a text, sorted; empty if the text has an error already."""
    state: Any = _state(text)  # Lark's methods are untyped
    return tuple(sorted(state.accepts())) if state is not None else ()


def slots(text: str, terminals: tuple[str, ...]) -> Iterator[CompletionSlot]:
    """Yield the possible meanings of a name, number, unit or quoted text directly after a text.

    One word can mean several things (`when ego` continues as `ego within 5 m of ...` or `gap < 2 s`); each is yielded
    once."""
    for terminal in ("NAME", "STRING", "DOTTED", "NUMBER", "UNIT"):
        if terminal not in terminals:
            continue
        seen: set[tuple[type[Item], str]] = set()
        for following in _following(text, terminal):
            slot = _slot(text, terminal, following)
            if slot is not None and (slot.node.kind, slot.field) not in seen:
                seen.add((slot.node.kind, slot.field))
                yield slot


def _following(text: str, terminal: str) -> tuple[str, ...]:
    """Return the terminals that may follow a probe; the one that leads to an end in the shortest way comes first, and
    is the only one for values.
    """
    state = _probed(text, terminal)
    ranked = _ranked(state) if state is not None else []
    return tuple(ranked if terminal in ("NAME", "STRING", "DOTTED") else ranked[:1])


def _probed(text: str, terminal: str) -> InteractiveParser | None:
    """Return the parser's state after a text and a probe; None if the probe is not accepted."""
    state: Any = _state(text)  # as above
    if state is None:
        return None
    probe = {"STRING": f'"{_PROBE}"', "DOTTED": _PROBES[2], "NUMBER": _NUMBER_PROBE}.get(terminal, _PROBE)
    try:
        state.feed_token(_token(terminal, probe))
    except LarkError:
        return None
    return cast(InteractiveParser, state)


def _slot(text: str, terminal: str, following: str) -> CompletionSlot | None:
    state = _probed(text, terminal)
    try:
        tree = _ended(state, following) if state is not None else None
    except LarkError:
        return None
    root = root_of(tree) if tree is not None else None
    if root is None:
        return None
    for node, above in walk(root):
        for field, value in node.fields.items():
            parts = value if isinstance(value, tuple) else (value,)
            if any(not isinstance(part, Node) and str(part) in _PROBES for part in parts):
                return CompletionSlot(terminal, node, field, above)
    return None


def _state(text: str) -> InteractiveParser | None:
    try:
        state: Any = parser().parse_interactive(text, start="file")  # as above
        state.exhaust_lexer()
    except LarkError:
        return None
    return cast(InteractiveParser, state)


def _ended(parser_: InteractiveParser, first: str) -> Tree[Token] | None:
    """Feed tokens, `first` first, that end all open statements and blocks; return the tree, or None after too many."""
    state: Any = parser_  # as above
    seen: set[tuple[tuple[int, ...], str]] = set()
    chosen: str | None = first
    for _ in range(_MOST_STEPS):
        if chosen is None:
            return None
        stack = tuple(state.parser_state.state_stack)
        seen.add((stack, chosen))
        if chosen == "$END":
            return cast("Tree[Token]", state.feed_eof())
        state.feed_token(_token(chosen, _SAMPLES.get(chosen) or text_of(chosen) or "\n"))
        stack = tuple(state.parser_state.state_stack)
        chosen = next((name for name in _ranked(state) if (stack, name) not in seen), None)
    return None


def _ranked(parser_: InteractiveParser) -> list[str]:
    """Return the terminals that may follow, closing ones first."""
    state: Any = parser_  # as above
    return sorted(state.accepts(), key=lambda n: (_CLOSERS.index(n) if n in _CLOSERS else len(_CLOSERS), n in _MORE, n))


def _token(terminal: str, text: str) -> Token:
    return Token(terminal, text, start_pos=0, line=1, column=1, end_line=1, end_column=1 + len(text), end_pos=len(text))


def _without_comments(text: str) -> str:
    return "".join(p[0] for p in _PIECE.finditer(text) if not p[0].startswith("#"))
