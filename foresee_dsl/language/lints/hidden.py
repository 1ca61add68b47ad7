"""Characters that nobody sees in a text, and that make it look like another one: directions of writing, no width."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator

from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.language.codes import names as c


def hidden_characters(text: str, path: str) -> Iterator[Diagnostic]:
    """Yield a warning for the first hidden character of each line, in comments and texts too.

    A sign that changes the direction of writing (U+202E) lets an editor show a line as something else than what is
    read; a byte order mark at the beginning is none.
    """
    for number, line in enumerate(text.removeprefix("\ufeff").split("\n"), 1):
        if line.isprintable():
            continue
        found = next((k for k, sign in enumerate(line) if is_hidden(sign)), None)
        if found is not None:
            sign = line[found]
            name = unicodedata.name(sign, "a control character").lower()
            yield Diagnostic(
                c.HIDDEN_CHARACTER,
                f"a character that is not seen, U+{ord(sign):04X} ({name}), may make this line look like another",
                "delete it",
                path,
                Span(number, found + 1, number, found + 2),
                line,
                "warning",
            )


def is_hidden(sign: str) -> bool:
    """Return whether a character is a control code or has no shape of its own; tabs and line ends are not."""
    return sign not in "\t\r" and unicodedata.category(sign) in ("Cc", "Cf", "Zl", "Zp")
