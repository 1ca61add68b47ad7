"""The parser for `grammars/foresee.lark`: built once, then read from a private cache."""

from __future__ import annotations

import functools
import hashlib
import sys
from collections.abc import Iterator
from contextvars import ContextVar
from io import BytesIO
from types import MappingProxyType
from typing import get_args

import lark
from lark import Lark, Token, Tree

from foresee_dsl import disk_cache
from foresee_dsl.files import cache_folder, data_folder
from foresee_dsl.language import model as m

PLACES = MappingProxyType(
    {
        "scenario_item": "a scenario",
        "extension_item": "a scenario that extends another",
        "clip_item": "a clip",
        "mutant_item": "a mutant",
        "network_item": "a network",
        "models_item": "a catalogue of models",
        "actor_item": "an actor's block",
        "action": "a trigger's block",
        "assignment": "a case",
        "traffic_item": "traffic",
        "junction_item": "a junction",
        "road_item": "a road",
        "roundabout_item": "a roundabout",
        "ramp_item": "a ramp",
        "zebra_item": "a zebra crossing",
        "bump_item": "a speed bump",
        "model_item": "a model",
        "origin_item": "an origin block",
        "campaign_item": "a campaign",
        "header": "the first line",
    }
)
"""The name of each block in messages, by the rule of its statements."""
STARTS = (*PLACES, *(m.rule_of(kind) for kind in get_args(m.Definition)))
"""Rules that can be parsed on their own, besides a file, to find further errors: a statement of a block, a
definition."""

_comments: ContextVar[list[Token]] = ContextVar("comments")


class WholeWords:
    """Makes the lexer read whole words at every place: a keyword ends where its word ends."""

    always_accept = ("WORD",)

    def process(self, stream: Iterator[Token]) -> Iterator[Token]:
        """Change no token."""
        return stream


def parse_tree(text: str, start: str = "file") -> tuple[Tree[Token], list[Token]]:
    """Parse a text (newlines are `\
    `) and return its tree and its comments, in order.
    """
    comments: list[Token] = []
    token = _comments.set(comments)
    try:
        return (parser() if start == "file" else statement_parser()).parse(text, start=start), comments
    finally:
        _comments.reset(token)


@functools.cache
def parser() -> Lark:
    """Return the parser of whole files: from the cache in about 30 ms, otherwise built in about 300 ms and stored if
    possible."""
    return _cached(("file",))


@functools.cache
def statement_parser() -> Lark:
    """Return the parser of single statements (`STARTS`), which only files with an error need."""
    return _cached(STARTS)


def grammar_text() -> str:
    """Return the grammar, as Lark reads it."""
    return (data_folder("grammars") / "foresee.lark").read_text(encoding="utf-8")


def _cached(starts: tuple[str, ...]) -> Lark:
    grammar = grammar_text()
    made_of = (
        grammar,
        repr(starts),
        lark.__version__,
        sys.version,
        f"{__name__}.{_collect.__qualname__}",
        "whole words",
    )
    key = hashlib.sha256("\0".join(made_of).encode()).hexdigest()[:16]
    try:
        file = cache_folder("grammar") / f"{key}.pickle"
    except OSError:
        return _build(grammar, starts)
    saved: bytes | None = disk_cache.load(file)
    if saved is not None:
        return Lark.load(BytesIO(saved))
    built, out = _build(grammar, starts), BytesIO()
    built.save(out)
    disk_cache.store(file, out.getvalue())
    return built


def _build(grammar: str, starts: tuple[str, ...]) -> Lark:
    return Lark(
        grammar,
        parser="lalr",
        lexer="contextual",
        start=list(starts),
        propagate_positions=True,
        maybe_placeholders=True,
        lexer_callbacks={"COMMENT": _collect},
        postlex=WholeWords(),  # used only for its `always_accept`
    )


def _collect(token: Token) -> Token:
    comments = _comments.get(None)  # None: the text behind an error is parsed without collecting comments
    if comments is not None:
        comments.append(token)
    return token
