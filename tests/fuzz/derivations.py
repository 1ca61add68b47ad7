"""Random texts of the language, derived from the rules of the very parser that reads them.

Nothing here names a statement: what is added to `grammars/foresee.lark` is derived without a change.
"""

from __future__ import annotations

import functools
import random
import re
from dataclasses import dataclass

from lark import Lark
from lark.grammar import NonTerminal, Symbol
from lark.lexer import PatternStr

from foresee_dsl.language.syntax.grammar import parser
from tests.fuzz.corpus import texts

_START = "file"
_MOST_TOKENS = (15, 40, 120, 600)
"""From so many tokens on the shortest derivations are taken; drawn for each text (ours: one to fifty statements)."""
_DEEPEST = 60
"""The same, for how deep rules stand in rules (ours: a block's statement is about ten deep; conditions nest)."""
_ODD = {
    "NAME": ("a", "ego", "_", "A", "time", "straight", "here", "é", "x" * 81),
    "STRING": ('""', '"a # b"', '"{ ; }"', '"' + "x" * 2001 + '"', '"-11"', '"é\u2028"'),
    "FUNCTION": ("min", "max"),
    "NUMBER": ("0", "1", "-1", "0.0", "-0.50", "1000000000", "1000000001", "9" * 30, "3.00"),
}
"""Words that real files do not have, by terminal."""


@dataclass(frozen=True)
class _Grammar:
    """The rules by their names, how deep the shortest derivation of each is, and the words of each terminal."""

    rules: dict[str, tuple[tuple[Symbol, ...], ...]]
    depth: dict[str, int]
    words: dict[str, tuple[str, ...]]


def derivation(rng: random.Random) -> str:
    """Return a random text that the grammar derives."""
    grammar = _grammar()
    tokens: list[str] = []
    most = rng.choice(_MOST_TOKENS)
    agenda: list[tuple[Symbol, int]] = [(NonTerminal(_START), 0)]
    while agenda:
        symbol, depth = agenda.pop()
        if isinstance(symbol, NonTerminal):
            chosen = _alternative(grammar, symbol.name, rng, hurry=depth > _DEEPEST or len(tokens) > most)
            agenda.extend((inner, depth + 1) for inner in reversed(chosen))
        else:
            tokens.append(rng.choice(grammar.words[symbol.name]))
    return "".join(f"{token}{_gap(rng)}" for token in tokens)


def _alternative(grammar: _Grammar, name: str, rng: random.Random, *, hurry: bool) -> tuple[Symbol, ...]:
    alternatives = grammar.rules[name]
    if not hurry:
        return rng.choice(alternatives)
    return min(alternatives, key=lambda symbols: _depth(grammar.depth, symbols))


def _gap(rng: random.Random) -> str:
    return " " if rng.random() < 0.97 else rng.choice(("", "  ", "\t", "\n", " # é {\n", ";"))


@functools.cache
def _grammar() -> _Grammar:
    lark = parser()
    rules: dict[str, list[tuple[Symbol, ...]]] = {}
    for rule in lark.rules:
        rules.setdefault(rule.origin.name, []).append(tuple(rule.expansion))
    found = {name: tuple(alternatives) for name, alternatives in rules.items()}
    return _Grammar(found, _depths(found), _words(lark))


def _depths(rules: dict[str, tuple[tuple[Symbol, ...], ...]]) -> dict[str, int]:
    """Return how deep the shortest derivation of each rule is, smallest first."""
    depth: dict[str, int] = {}
    while len(depth) < len(rules):
        ready = {
            name: min(depths)
            for name, alternatives in rules.items()
            if name not in depth and (depths := [_depth(depth, a) for a in alternatives if _known(depth, a)])
        }
        depth |= ready
    return depth


def _known(depth: dict[str, int], symbols: tuple[Symbol, ...]) -> bool:
    return all(symbol.name in depth for symbol in symbols if isinstance(symbol, NonTerminal))


def _depth(depth: dict[str, int], symbols: tuple[Symbol, ...]) -> int:
    return 1 + max((depth[symbol.name] for symbol in symbols if isinstance(symbol, NonTerminal)), default=0)


def _words(lark: Lark) -> dict[str, tuple[str, ...]]:
    """Return what may stand for each terminal: a keyword itself, or the words of real files that it matches."""
    words: dict[str, tuple[str, ...]] = {}
    for terminal in lark.terminals:
        if isinstance(terminal.pattern, PatternStr):
            words[terminal.name] = (terminal.pattern.value,)
            continue
        pattern = re.compile(terminal.pattern.to_regexp())
        real = [match[0] for text in texts() for match in pattern.finditer(text)]
        words[terminal.name] = (*real, *_ODD.get(terminal.name, ()) * 5) or ("x",)
    return words
