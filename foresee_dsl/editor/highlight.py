"""Prints texts of the language in the terminal, in colours."""

from __future__ import annotations

import os
import sys
from types import MappingProxyType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.text import Text

_STYLES = MappingProxyType(
    {
        "Token.Comment": "dim",
        "Token.Keyword": "cyan",
        "Token.Keyword.Declaration": "bold cyan",
        "Token.Keyword.Pseudo": "blue",
        "Token.Keyword.Type": "green",
        "Token.Name.Attribute": "blue",
        "Token.Name.Class": "bold",
        "Token.Name.Constant": "magenta",
        "Token.Literal.Number": "yellow",
        "Token.Operator.Word": "magenta",
        "Token.Literal.String": "green",
    }
)
"""Styles by the name of Pygments' token. Ours: the terminal's own colours, which its user has chosen to be readable."""


def highlighted(text: str) -> Text:
    """Return a text of the language in colours, without characters that move a terminal's cursor."""
    from rich.text import Text

    from foresee_dsl.editor.lexer import ForeseeLexer

    result = Text()
    for _, token, value in ForeseeLexer().get_tokens_unprocessed(text):
        result.append(value, next((_STYLES[str(part)] for part in reversed(token.split()) if str(part) in _STYLES), ""))
    return result


def wanted() -> bool:
    """Return whether standard output shows colours: it is a terminal, and NO_COLOR is not set."""
    return sys.stdout.isatty() and "NO_COLOR" not in os.environ


def show(text: str) -> None:
    """Print a text of the language on standard output: in colours if they are wanted, else byte for byte."""
    if not wanted():
        getattr(sys.stdout, "trusted", sys.stdout).write(
            text
        )  # the command line's own stream escapes hidden characters
        return
    from rich.console import Console

    Console(highlight=False, soft_wrap=True).print(highlighted(text), end="")
