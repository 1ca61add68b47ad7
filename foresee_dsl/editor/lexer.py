"""The Pygments lexer of the language: for our own terminal output, documentation pages, and whatever uses Pygments.

It is registered as an entry point, so that `pygmentize -l foresee` finds it. Words come from `language.keywords`, units
from `language.units`. Where a word may be a keyword or a name, what stands around it decides; every text has tokens
throughout and none of them is an error.
"""

from __future__ import annotations

import re
from types import MappingProxyType
from typing import Any, ClassVar

from pygments.lexer import RegexLexer, bygroups, words
from pygments.token import Comment, Keyword, Name, Number, Operator, Punctuation, String, Text, Whitespace, _TokenType

from foresee_dsl.language.keywords import words_of
from foresee_dsl.language.model.item import Group
from foresee_dsl.language.units import UNITS

TOKENS: MappingProxyType[Group, _TokenType] = MappingProxyType(
    {
        "definition": Keyword.Declaration,
        "statement": Keyword,
        "setting": Name.Attribute,
        "action": Keyword,
        "condition": Operator.Word,
        "link": Keyword.Pseudo,
        "type": Keyword.Type,
        "constant": Name.Constant,
    }
)
"""How each group of words is shown."""

NAMED = ("scenario", "clip", "mutant", "network", "models", "param", "case", "vehicle", "bicycle", "pedestrian",
         "obstacle", "traffic", "junction", "road", "stage", "signal")  # fmt: skip
"""The words behind which a name stands."""

_UNIT_WORDS = "|".join(re.escape(word) for word in sorted(UNITS, key=len, reverse=True))
UNIT = rf"(?:{_UNIT_WORDS})(?![\w/^])"
"""A unit as a regular expression; longer words first, so that `m/s^2` is not read as `m`."""
NUMBER = r"(?<![\w.])-?[0-9]+(?:\.[0-9]+)?"
"""A number as a regular expression: none inside a name."""
NAME = r"[^\W\d]\w*"
NAMED_RULE = rf"\b({'|'.join(NAMED)})([ \t]+)({NAME})(?=[ \t]*(?:[:={{]|$|(?:of|at|from|for|extends)\b))"
"""A word and the name that it gives, where what follows shows that it is one."""


def _by(*tokens: _TokenType) -> object:
    return bygroups(*tokens)  # type: ignore[no-untyped-call]  # Pygments' own stubs leave it so


class ForeseeLexer(RegexLexer):
    """Highlights `.foresee` files."""

    name = "foresee"
    aliases: ClassVar[list[str]] = ["foresee"]
    filenames: ClassVar[list[str]] = ["*.foresee"]
    url = "https://pypi.org/project/foresee-dsl/"
    flags = re.MULTILINE

    tokens: ClassVar[dict[str, Any]] = {
        "root": [
            (r"\s+", Whitespace),
            (r"#.*$", Comment.Single),
            (r'"[^"\n]*"?', String.Double),
            (r"sha256:\w*", Number.Hex),
            (rf"({NUMBER})([ \t]*)({UNIT})", _by(Number, Whitespace, Keyword.Type)),
            (NUMBER, Number),
            (
                NAMED_RULE,
                _by(Keyword.Declaration, Whitespace, Name.Class),
            ),
            (rf"({NAME})(\.)({NAME})", _by(Name.Variable, Punctuation, Name.Attribute)),
            (rf"({NAME})([ \t]*)(=)(?!>)", _by(Name.Variable, Whitespace, Operator)),
            *((words(words_of(group), prefix=r"\b", suffix=r"\b"), token) for group, token in TOKENS.items()),
            (r"=>|<=|>=|<|>|=|\.\.\.?", Operator),
            (r"[{}\[\]();:,]", Punctuation),
            (NAME, Name),
            (r".", Text),
        ],
    }
