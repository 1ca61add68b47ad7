"""Makes text from files, drivers and traces safe to print, so that it can neither control the terminal nor hide other
text; and states numbers of things in words.
"""

from __future__ import annotations

import unicodedata

COLUMNS = 80
"""Width of the reports for a terminal, in columns. Ours: the usual width of a terminal."""
LONGEST = 400
"""Default maximum length of a printed text, characters. Ours: five lines of 80 columns; callers pass a larger one for
paths."""
_MARKS = 2
"""Maximum number of combining marks after one another. Ours: written languages need two; more would cover the lines
above."""
_BLANKS = "\t\n\r\x0b\x0c\x85\u2028\u2029"


def safe(text: object, longest: int = LONGEST) -> str:
    """Return a text on one line, without control codes and without characters that turn, hide or stack others.

    Control codes (ANSI's escape, a bell), characters that change the direction of writing and characters without a
    width are written as Python escapes (`\\x1b`, `\\u202e`); line breaks become spaces; text beyond `longest`
    characters is cut.
    """
    parts: list[str] = []
    marks = 0
    whole = str(text)
    for sign in whole[:longest]:
        kind = unicodedata.category(sign)
        marks = marks + 1 if kind in ("Mn", "Me") else 0
        if marks > _MARKS:
            continue
        if sign in _BLANKS:
            parts.append(" ")
        elif kind.startswith("C"):
            parts.append(sign.encode("unicode_escape").decode("ascii"))
        else:
            parts.append(sign)
    if len(whole) > longest:
        parts.append("…")
    return "".join(parts)


def shortened(text: object, width: int) -> str:
    """Return a safe text of at most `width` characters, which ends with `…` if it was cut."""
    plain = safe(text)
    return plain if len(plain) <= width else f"{plain[: max(width - 1, 0)]}…"


def counted(number: int, noun: str, many: str = "") -> str:
    """Return `1 file` or `3 files`."""
    return f"{number} {noun if number == 1 else many or f'{noun}s'}"
