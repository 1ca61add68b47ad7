"""Which word was meant, and where it is to be written, for tools that offer to do so."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from difflib import get_close_matches

from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.helps import Edit, HelpText, Meant, meant_word, one_of, write
from foresee_dsl.language.units import OTHER_WORDS, UNITS

_LONGEST = 60
"""Longer words are not compared (ours: no word of the language is half as long, and the comparison is quadratic)."""


def closest(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that `word` was probably meant to be, or None; the same one every time."""
    candidates = list(dict.fromkeys(known))
    if not word or len(word) > _LONGEST:
        return None
    same = [candidate for candidate in candidates if _plain(candidate) == _plain(word)]
    found = same or get_close_matches(word.lower(), candidates, n=1, cutoff=0.6)  # difflib's own default of the cutoff
    return found[0] if found else None


def did_you_mean(word: str, known: Iterable[str]) -> HelpText:
    """Return `did you mean 'X'?`, or the known words if they are few and none is close, or nothing."""
    candidates = list(dict.fromkeys(known))
    found = closest(word, candidates)
    if found is not None:
        return meant_word(found, word)
    return "known are " + one_of(candidates) if 0 < len(candidates) <= 8 else ""


def of_type(type_: str, known: Mapping[str, str], instead: HelpText = "") -> HelpText:
    """Return which parameter to use: of a type, by the names and types that are known; or what to write instead."""
    names = [name for name, its_type in known.items() if its_type == type_]
    which: HelpText = ": " + one_of(names) if 0 < len(names) <= 8 else ""
    use = "use a parameter of type " + write(type_) + which
    return "write " + instead + ", or " + use if instead else use


def unit_hint(word: str) -> HelpText:
    """Return what to write instead of an unknown unit word."""
    meant = OTHER_WORDS.get(word.lower())
    if meant is not None:
        return meant_word(meant, word)
    return did_you_mean(word, UNITS) or "units are " + one_of(UNITS)


def suggested_fix(diagnostic: Diagnostic) -> tuple[Span, str] | None:
    """Return which part of the file to replace, and by what; None where the help names no replacement."""
    span = diagnostic.span
    if span is None or span.end_line != span.line:
        return None
    found = meant_at(diagnostic.fixes, diagnostic.source_line[span.column - 1 : span.end_column - 1])
    if found is None:
        return None
    start, end, text = found
    return Span(span.line, span.column + start, span.line, span.column + end), text


def meant_at(fixes: Iterable[Edit], written: str) -> tuple[int, int, str] | None:
    """Return what to replace in `written`, the underlined text (start, end), by what was meant; else None."""
    meant = next((fix for fix in fixes if isinstance(fix, Meant)), None)
    if meant is None:
        return None
    if len(written) > 2 and written[0] == written[-1] == '"':
        start = written.rfind("/") + 1 or 1  # of a file, the help names the last part of the path
        return start, len(written) - 1, meant.text
    word = re.escape(meant.wrong)
    for pattern in (rf"\b{word}\b", word) if word else ():
        if len(places := list(re.finditer(pattern, written))) == 1:
            return (*places[0].span(), meant.text)
    whole = meant.spaced or (written and not any(map(str.isspace, written)))
    return (0, len(written), meant.text) if whole else None


def _plain(word: str) -> str:
    """Without what is easily left out or mixed up: `kmh` and `KM/H` are both `km/h`."""
    return "".join(c for c in word.lower().replace("²", "2") if c.isalnum())
