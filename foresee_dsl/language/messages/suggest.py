"""Which word was meant, and the replacement that a diagnostic's help spells out, for tools that offer to make it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from difflib import get_close_matches

from foresee_dsl.errors import Diagnostic, Span
from foresee_dsl.language.units import OTHER_WORDS, UNITS

_LONGEST = 60
"""Longer words are not compared (ours: no word of the language is half as long, and the comparison is quadratic)."""
_MEANT = re.compile(r"did you mean ['`]([^'`]+)['`]\?")
_CALLED = re.compile(r"\bcalled (\w+)$", re.MULTILINE)
_QUOTED = re.compile(r"['`]([^'`]+)['`]")


def closest(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that `word` was probably meant to be, or None; the same one every time."""
    candidates = list(dict.fromkeys(known))
    if not word or len(word) > _LONGEST:
        return None
    same = [candidate for candidate in candidates if _plain(candidate) == _plain(word)]
    found = same or get_close_matches(word.lower(), candidates, n=1, cutoff=0.6)  # difflib's own default of the cutoff
    return found[0] if found else None


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return `did you mean 'X'?`, or the known words if they are few and none is close, or nothing."""
    candidates = list(dict.fromkeys(known))
    found = closest(word, candidates)
    if found is not None:
        return f"did you mean '{found}'?"
    return "known are " + ", ".join(candidates) if 0 < len(candidates) <= 8 else ""


def of_type(type_: str, known: Mapping[str, str], instead: str = "") -> str:
    """Return which parameter to use: of a type, by the names and types that are known; or what to write instead."""
    names = [name for name, its_type in known.items() if its_type == type_]
    which = f": {', '.join(names)}" if 0 < len(names) <= 8 else ""
    return f"{f'write {instead}, or ' if instead else ''}use a parameter of type `{type_}`{which}"


def unit_hint(word: str) -> str:
    """Return what to write instead of an unknown unit word."""
    meant = OTHER_WORDS.get(word.lower())
    if meant is not None:
        return f"did you mean '{meant}'?"
    return did_you_mean(word, UNITS) or "units are " + ", ".join(UNITS)


def suggested_fix(diagnostic: Diagnostic) -> tuple[Span, str] | None:
    """Return which part of the file to replace, and by what; None where the help names no replacement."""
    span = diagnostic.span
    if span is None or span.end_line != span.line:
        return None
    written = diagnostic.source_line[span.column - 1 : span.end_column - 1]
    found = replacement(f"{diagnostic.message}\n{diagnostic.help}", written)
    if found is None:
        return None
    start, end, text = found
    return Span(span.line, span.column + start, span.line, span.column + end), text


def replacement(message: str, written: str) -> tuple[int, int, str] | None:
    """Return what to replace in `written`, the underlined text (start, end), and by what; None where the help in
    `message` names none."""
    meant = _MEANT.search(message)
    if meant is None:
        return None
    said = message[: meant.start()]
    if len(written) > 2 and written[0] == written[-1] == '"':
        start = written.rfind("/") + 1 or 1  # of a file, the help names the last part of the path
        return start, len(written) - 1, meant[1]
    quoted = [word for word in _QUOTED.findall(said) if written.count(word) == 1]
    if len(quoted) > 1 and written.startswith(quoted[0]) and written.endswith(quoted[-1]):
        return 0, len(written), meant[1]  # what is between them is wrong
    if quoted:
        return written.index(quoted[0]), written.index(quoted[0]) + len(quoted[0]), meant[1]
    called = _CALLED.search(said)
    if called is not None and len(re.findall(rf"\b{called[1]}\b", written)) == 1:
        place = re.search(rf"\b{called[1]}\b", written)
        return (*place.span(), meant[1]) if place is not None else None
    whole = re.fullmatch(r"\S+", written) or "did you mean `" in message  # a name is in other quotes than a text
    return (0, len(written), meant[1]) if whole else None


def _plain(word: str) -> str:
    """Without what is easily left out or mixed up: `kmh` and `KM/H` are both `km/h`."""
    return "".join(c for c in word.lower().replace("²", "2") if c.isalnum())
