"""The Pygments lexer of the language: for our terminal output, documentation pages, and other users of Pygments.

It is registered as an entry point, so that `pygmentize -l foresee` finds it. Words come from `language.keywords`, units
from `language.units`. Where a word may be a keyword or a name, its surroundings decide. Every text is split into tokens
completely, without an error token."""

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
"""The token type of each group of words."""

NAMED = ("scenario", "clip", "mutant", "network", "models", "param", "case", "vehicle", "bicycle", "pedestrian",
         "obstacle", "traffic", "junction", "road", "stage", "signal")  # fmt: skip
"""The words after which a name stands."""

_UNIT_WORDS = "|".join(re.escape(word) for word in sorted(UNITS, key=len, reverse=True))
UNIT = rf"(?:{_UNIT_WORDS})(?![\w/^])"
"""A unit as a regular expression; longer words first, so that `m/s^2` is not read as `m`."""
NUMBER = r"(?<![\w.])-?[0-9]+(?:\.[0-9]+)?"
"""A number as a regular expression; digits inside a name are not one."""
NAME = r"[^\W\d]\w*"
NAMED_RULE = rf"\b({'|'.join(NAMED)})([ \t]+)({NAME})(?=[ \t]*(?:[:={{]|$|(?:of|at|from|for|extends)\b))"
"""A word and the name that it defines, if the following text shows that it is a definition."""


def _by(*tokens: _TokenType) -> object:
    return bygroups(*tokens)  # type: ignore[no-untyped-call]  # Pygments' stubs do not type it


class ForeseeLexer(RegexLexer):
    """Splits `.foresee` files into tokens, so that Pygments can highlight them."""

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
