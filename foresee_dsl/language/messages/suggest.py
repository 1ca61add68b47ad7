"""Suggests the word that the author probably meant and where to write it, for messages, the editor and SARIF."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from difflib import get_close_matches

from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.helps import Edit, HelpText, Meant, meant_word, one_of, write
from foresee_dsl.language.units import OTHER_WORDS, UNITS

_LONGEST = 60
"""Words with more characters than this are not compared with the known words (ours: no word of the language is half as
long, and the time of a comparison grows with the square of the length)."""
_MOST_LISTED = 8
"""Maximum number of names that a help lists (ours: more than a reader takes in at a glance)."""


def closest(word: str, words: Iterable[str]) -> str | None:
    """Return the word that the author probably meant by `word`, or None if none is similar; the result is
    deterministic."""
    candidates = list(dict.fromkeys(words))
    if not word or len(word) > _LONGEST:
        return None
    same = [candidate for candidate in candidates if _plain(candidate) == _plain(word)]
    matches = same or get_close_matches(word.lower(), candidates, n=1, cutoff=0.6)  # 0.6 is difflib's own default
    return matches[0] if matches else None


def did_you_mean(word: str, words: Iterable[str]) -> HelpText:
    """Return `did you mean 'X'?`, or all words if they are few and none is close, or an empty text."""
    candidates = list(dict.fromkeys(words))
    nearest = closest(word, candidates)
    if nearest is not None:
        return meant_word(nearest, word)
    if not 0 < len(candidates) <= _MOST_LISTED:
        return ""
    return ("write one of " if len(candidates) > 1 else "write ") + one_of(candidates, wrong=word)


def of_type(type_: str, types: Mapping[str, str], instead: HelpText = "") -> HelpText:
    """Return a help that names the parameters of a type, and before them the text `instead`, if it is given."""
    names = [name for name, its_type in types.items() if its_type == type_]
    which: HelpText = ": " + one_of(names) if 0 < len(names) <= _MOST_LISTED else ""
    use = "use a parameter of type " + write(type_) + which
    return "write " + instead + ", or " + use if instead else use


def unit_hint(word: str) -> HelpText:
    """Return the help for an unknown unit."""
    meant = OTHER_WORDS.get(word.lower())
    if meant is not None:
        return meant_word(meant, word)
    return did_you_mean(word, UNITS) or "units are " + one_of(UNITS, wrong=word)


def suggested_fix(diagnostic: Diagnostic) -> tuple[Span, str] | None:
    """Return the place of the file to replace and the new text; None if the help names no replacement."""
    span = diagnostic.span
    if span is None or span.end_line != span.line:
        return None
    replacement = meant_at(diagnostic.fixes, diagnostic.source_line[span.column - 1 : span.end_column - 1])
    if replacement is None:
        return None
    start, end, text = replacement
    return Span(span.line, span.column + start, span.line, span.column + end), text


def meant_at(fixes: Iterable[Edit], written: str) -> tuple[int, int, str] | None:
    """Return the replacement in `written`, the underlined text, as (start, end, new text); None if no fix replaces a
    word."""
    meant = next((fix for fix in fixes if isinstance(fix, Meant)), None)
    if meant is None:
        return None
    if len(written) > 2 and written[0] == written[-1] == '"':
        start = written.rfind("/") + 1 or 1  # for a file the help names only the last part of the path
        return start, len(written) - 1, meant.text
    word = re.escape(meant.wrong)
    for pattern in (rf"\b{word}\b", word) if word else ():
        if len(places := list(re.finditer(pattern, written))) == 1:
            return (*places[0].span(), meant.text)
    whole = meant.spaced or (written and not any(map(str.isspace, written)))
    return (0, len(written), meant.text) if whole else None


def _plain(word: str) -> str:
    """Return a word in small letters and without signs, because authors mix these up: `kmh` and `KM/H` both match
    `km/h`."""
    return "".join(c for c in word.lower().replace("²", "2") if c.isalnum())
