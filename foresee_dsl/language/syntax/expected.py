"""Says in words for people which terminals the grammar expected at a place of a statement."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Set
from functools import cache
from typing import Any

from lark import Token
from lark.exceptions import UnexpectedInput
from lark.lexer import PatternStr

from foresee_dsl.language import model as m
from foresee_dsl.language.model.pattern import form_of, read_pattern, words_before
from foresee_dsl.language.syntax.grammar import PLACES, parser
from foresee_dsl.language.units import EXAMPLES, NOUNS, Dimension

_LAST_WORD = re.compile(r"([^\W\d]\w*|[(,<>=.:])[^\w(,<>=.:]*$")
REACH = 300
"""Number of characters before the place in which patterns are searched (ours: names have at most 80; the time of a
search grows with the square of this number)."""
_DEEP = 200
"""Size of the parser's stack above which no terminal is tried (ours: the bundled files reach 38)."""
END = "the end of the statement"


def expected(accepted: Set[str], text: str, start: int, *, place: bool) -> str:
    """Return what may stand at a place of a statement's text, in words for people, the most helpful first.

    `accepted` holds the names of the possible terminals; `place` is True if a point may begin there.
    """
    words = words_of_terminals(accepted)
    signs = [sign for name in sorted(accepted) if (sign := text_of(name)) and not sign[0].isalpha()]
    parts: list[str] = []
    if "NUMBER" in accepted:
        parts.append(_value(text, start, place=place))
    elif "DOTTED" in accepted:
        parts.append("a model such as `car.compact`" if "route" not in text else "`ego.route`")
    elif "NAME" in accepted:
        parts.append("a name")
    if "STRING" in accepted and "NAME" not in accepted:
        parts.append("a text in double quotes")
    if "PIN" in accepted:
        parts.append("a pin such as `sha256:5ef2c6120a41`")
    if "COMPARE" in accepted:
        parts += ["`<`", "`<=`", "`>`", "`>=`"]
    if "ttc" in words:
        return "a condition such as `ego.speed < 3 m/s`"
    parts += [f"`{word}`" for word in words if not ("NUMBER" in accepted and word in ("beside", "the"))]  # a place
    parts += [f"`{sign}`" for sign in signs if sign not in "{};" and not (sign in "(-" and "NUMBER" in accepted)]
    if not parts and accepted & {"$END", "_NEWLINE", "SEMICOLON", "RBRACE"}:
        return END
    if not parts:
        return "`{`" if "LBRACE" in accepted else "something else"
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} or {parts[-1]}"


def _value(text: str, start: int, *, place: bool) -> str:
    if place:
        return "a place such as `20 m along ego.route`"
    before = _LAST_WORD.search(text, max(0, start - REACH), start)
    dimension = dimensions_behind().get(before[1], (None,))[0] if before is not None else None
    if before is not None and before[1] == "," and "(" in text:
        dimension = "length"
    return f"{NOUNS[dimension]} such as `{EXAMPLES[dimension]}`" if dimension else "a value such as `2.5 s`"


def takes_a_place(error: UnexpectedInput) -> bool:
    """Return whether a bracket at the place may begin a point; if so, a comma may follow `(1 m`."""
    state = getattr(error, "interactive_parser", None)
    if state is None:
        return False
    try:
        probe = state.copy()
        probe.feed_token(Token("LPAR", "("))
        probe.feed_token(Token("NUMBER", "1"))
        return "COMMA" in next_terminals(probe)
    except (UnexpectedInput, RecursionError):  # copying the parser's state recurses, and it may be nested deeply
        return False


def accepted_by(error: UnexpectedInput) -> set[str]:
    """Return the names of the terminals that are possible at the place of an error."""
    state = getattr(error, "interactive_parser", None)
    if state is not None:
        return next_terminals(state)
    return set(getattr(error, "expected", None) or getattr(error, "allowed", None) or ())


def next_terminals(state: Any) -> set[str]:  # noqa: ANN401  Lark leaves its interactive parser without types
    """Return the names of the terminals that may come next; none if the text is nested too deeply to try.

    Lark (1.3.1) tries each of some forty terminals, and in `- - - - 2` each try closes every minus.
    """
    return set(state.accepts()) if len(state.parser_state.state_stack) <= _DEEP else set()


@cache
def keywords() -> frozenset[str]:
    """Return every fixed word of the grammar."""
    return frozenset(words_of_terminals(terminal.name for terminal in parser().terminals))


@cache
def homes() -> Mapping[str, tuple[str, ...]]:
    """Return the blocks in which each first word of a statement is allowed, read from the grammar."""
    blocks: dict[str, list[str]] = {}
    for rule, place in PLACES.items():
        state: Any = parser().parse_interactive("", start=rule)  # Lark leaves `accepts` without types
        for word in words_of_terminals(next_terminals(state)):
            blocks.setdefault(word, []).append(place)
    return {word: tuple(places) for word, places in blocks.items()}


@cache
def dimensions_behind() -> Mapping[str, tuple[Dimension, ...]]:
    """Return, for each word, the dimensions of the values that may follow it in the patterns of statements, in the
    order of the classes. It is only for messages: the model decides."""
    dimensions: dict[str, dict[Dimension, None]] = {"(": {"length": None}}
    for kind in m.ITEMS:
        for word, field in words_before(read_pattern(kind.pattern)):
            dimension = form_of(kind, field).dimension
            if dimension is not None:
                dimensions.setdefault(word, {})[dimension] = None
    return {word: tuple(kinds) for word, kinds in dimensions.items()}


def words_of_terminals(terminals: Iterable[str]) -> list[str]:
    """Return the fixed words among some terminals, in a fixed order."""
    return [word for name in sorted(terminals) if (word := text_of(name)) is not None and word[0].isalpha()]


def text_of(name: str) -> str | None:
    """Return the text of a terminal that is a fixed word or sign; None for others."""
    if name == "$END":
        return None
    pattern = parser().get_terminal(name).pattern
    return pattern.value if isinstance(pattern, PatternStr) else None
