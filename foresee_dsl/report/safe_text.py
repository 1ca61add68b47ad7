"""Text that comes from files, drivers and traces, made safe to print: a terminal does nothing but show it."""

from __future__ import annotations

import unicodedata

LONGEST = 400
"""Characters of one text that are shown. Ours: five lines of 80 columns; paths are shown whole by asking for more."""
_MARKS = 2
"""Combining marks in a row that are kept. Ours: written languages need two, more make towers over the lines above."""
_BLANKS = "\t\n\r\x0b\x0c\x85\u2028\u2029"


def safe(text: object, longest: int = LONGEST) -> str:
    """Return a text on one line that holds no control codes and no signs that turn, hide or stack other signs.

    A control code (ANSI's escape, a bell), a sign that changes the direction of writing and one without a width become
    what Python writes for it (`\\x1b`, `\\u202e`); line breaks become spaces; what is longer than `longest` is cut.
    """
    shown: list[str] = []
    marks = 0
    whole = str(text)
    for sign in whole[:longest]:
        kind = unicodedata.category(sign)
        marks = marks + 1 if kind in ("Mn", "Me") else 0
        if marks > _MARKS:
            continue
        if sign in _BLANKS:
            shown.append(" ")
        elif kind.startswith("C"):
            shown.append(sign.encode("unicode_escape").decode("ascii"))
        else:
            shown.append(sign)
    if len(whole) > longest:
        shown.append("…")
    return "".join(shown)


def shortened(text: object, width: int) -> str:
    """Return a safe text of at most `width` characters, `…` in the place of what is left out at its end."""
    shown = safe(text)
    return shown if len(shown) <= width else f"{shown[: max(width - 1, 0)]}…"
