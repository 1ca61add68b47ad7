"""Every word of the language in one table: its group, its meaning in one line, and an example.

Messages, the editor's help, the highlighters and the TextMate grammar read it. The words come from the model's classes;
the few words that several classes share are listed below. Units are in `language.units`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from types import MappingProxyType

from foresee_dsl.language import model as m
from foresee_dsl.language.model.item import Group

_SHARED = """
    foresee (definition): the version of the language, in the first line of every file | foresee 1
    of (link): before the parent of a file, or before the actor or place to which a distance is measured
            | clip runner_p1 of "runner.foresee"
    after (link): later than the time that follows | end after 60 s
    before (link): earlier than the time that follows, or short of the junction that follows
            | meets ego at j4 before 1.0 s
    at (link): before a place or a time | start at 20 m along ego.route
    from (link): before the road where a route begins, the time when a change begins, or the seed of a draw
            | route from south
    over (link): before the junction of a turn, or the time that a change takes | straight over j4
    to (link): before the junction where a road ends, or a new speed | changes speed to 3 m/s
    for (link): before a duration: how long something holds or takes | stops for 4 s
"""
_WORD = re.compile(r"^\s*(\w+) \((\w+)\): ([^|]+?)\s+\| (.+)$", re.MULTILINE)
"""Matches an entry of `Item.words`, which may go over several lines."""


@dataclass(frozen=True, slots=True)
class Keyword:
    """One word of the language: its group, its meaning in a sentence without a full stop, and an example line."""

    word: str
    group: Group
    meaning: str
    example: str


def keywords_in(words: str) -> Iterator[Keyword]:
    """Return the words of an `Item.words`."""
    for word, group, meaning, example in _WORD.findall(words):
        yield Keyword(word, group, " ".join(meaning.split()), example)


_ALL = tuple(keyword for words in (_SHARED, *(kind.words for kind in m.ITEMS)) for keyword in keywords_in(words))

KEYWORDS = MappingProxyType({keyword.word: keyword for keyword in _ALL})
"""Every word of the language with its entry."""

USAGE = MappingProxyType(
    {k.word: k.example for k in _ALL if k.group in ("definition", "statement") or k.word in ("wait", "then")}
)
"""An example line of each statement, by the statement's first word."""


def words_of(*groups: Group) -> tuple[str, ...]:
    """Return the words of some groups, sorted."""
    return tuple(sorted(keyword.word for keyword in _ALL if keyword.group in groups))
