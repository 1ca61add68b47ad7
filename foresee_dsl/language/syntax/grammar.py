"""Makes the parser for `grammars/foresee.lark`: it is built once, then read from a private cache."""

from __future__ import annotations

import functools
import hashlib
import sys
from collections.abc import Iterator
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
"""The rules by which pieces of a text are parsed: a statement of a block, or a definition."""


class WholeWords:
    """Makes the lexer read whole words at every place, so that it never takes the beginning of a longer word for a
    keyword."""

    always_accept = ("WORD",)

    def process(self, stream: Iterator[Token]) -> Iterator[Token]:
        """Change no token."""
        return stream


def parse_tree(text: str, start: str) -> Tree[Token]:
    """Parse a statement or a definition with its rule, one of `STARTS`, or a whole file with `file`; newlines in the
    text are `\n`."""
    return parser().parse(text, start=start)


@functools.cache
def parser() -> Lark:
    """Return the parser: from the cache in about 30 ms, otherwise built in about 500 ms and stored if possible."""
    grammar = grammar_text()
    depends_on = (grammar, "whole words", repr(STARTS), lark.__version__, sys.version)
    key = hashlib.sha256("\0".join(depends_on).encode()).hexdigest()[:16]
    try:
        file = cache_folder("grammar") / f"{key}.pickle"
    except OSError:
        return _build(grammar)
    saved: bytes | None = disk_cache.load(file)
    if saved is not None:
        return Lark.load(BytesIO(saved))
    built, out = _build(grammar), BytesIO()
    built.save(out)
    disk_cache.store(file, out.getvalue())
    return built


def grammar_text() -> str:
    """Return the grammar, as Lark reads it."""
    return (data_folder("grammars") / "foresee.lark").read_text(encoding="utf-8")


def _build(grammar: str) -> Lark:
    return Lark(
        grammar,
        parser="lalr",
        lexer="contextual",
        start=["file", *STARTS],
        propagate_positions=True,
        maybe_placeholders=True,
        postlex=WholeWords(),  # used only for its `always_accept`
    )
