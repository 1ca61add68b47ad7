"""Generates the TextMate grammar from the keyword table: `python -m foresee_dsl.editor.textmate > FILE`.

Every regular expression has the same meaning in Oniguruma, which editors use, and in Python, so that tests can run
them."""

from __future__ import annotations

import json
import sys
from types import MappingProxyType
from typing import Any

from foresee_dsl.editor.lexer import NAME, NAMED_RULE, NUMBER, UNIT
from foresee_dsl.language.keywords import words_of
from foresee_dsl.language.model.item import Group

FILE = "editors/vscode/syntaxes/foresee.tmLanguage.json"
"""Path of the grammar in the repository."""

SCOPES: MappingProxyType[Group, str] = MappingProxyType(
    {
        "definition": "keyword.declaration.foresee",
        "statement": "keyword.control.statement.foresee",
        "setting": "variable.other.property.foresee",
        "action": "keyword.control.action.foresee",
        "condition": "keyword.operator.word.foresee",
        "link": "keyword.other.foresee",
        "type": "storage.type.foresee",
        "constant": "constant.language.foresee",
    }
)
"""The scope of each group of words; colour themes define styles for these names."""


def grammar() -> dict[str, Any]:
    """Return the TextMate grammar as data."""
    return {
        "$schema": "https://raw.githubusercontent.com/martinring/tmlanguage/master/tmlanguage.json",
        "name": "foresee",
        "scopeName": "source.foresee",
        "fileTypes": ["foresee"],
        "patterns": [
            {"name": "comment.line.number-sign.foresee", "match": "#.*$"},
            {"name": "string.quoted.double.foresee", "match": '"[^"]*"'},
            {"name": "invalid.illegal.unclosed.foresee", "match": '"[^"]*$'},
            {"name": "constant.other.pin.foresee", "match": r"\bsha256:\w*"},
            {
                "match": rf"({NUMBER})(?:[ \t]*({UNIT}))?",
                "captures": _captures("constant.numeric.foresee", "keyword.other.unit.foresee"),
            },
            {
                "match": NAMED_RULE,
                "captures": _captures("keyword.declaration.foresee", "", "entity.name.foresee"),
            },
            {
                "match": rf"\b({NAME})(\.)({NAME})",
                "captures": _captures(
                    "variable.other.foresee", "punctuation.accessor.foresee", "variable.other.property.foresee"
                ),
            },
            {
                "match": rf"\b({NAME})[ \t]*(=)(?!>)",
                "captures": _captures("variable.parameter.foresee", "keyword.operator.foresee"),
            },
            *({"name": scope, "match": rf"\b(?:{'|'.join(words_of(group))})\b"} for group, scope in SCOPES.items()),
            {"name": "keyword.operator.foresee", "match": r"=>|<=|>=|<|>|=|\.\.\.?"},
            {"name": "punctuation.foresee", "match": r"[{}\[\]();:,]"},
            {"name": "variable.other.foresee", "match": NAME},
        ],
    }


def text() -> str:
    """Return the text of the grammar's file."""
    return json.dumps(grammar(), indent=2) + "\n"


def _captures(*names: str) -> dict[str, dict[str, str]]:
    return {str(k): {"name": name} for k, name in enumerate(names, start=1) if name}


if __name__ == "__main__":
    sys.stdout.write(text())
