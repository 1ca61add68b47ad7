"""Which word was meant."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

from foresee_dsl.language.units import OTHER_WORDS, UNITS

_LONGEST = 60
"""Longer words are not compared (ours: no word of the language is half as long, and the comparison is quadratic)."""


def closest(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that `word` was probably meant to be, or None; the same one every time."""
    candidates = list(dict.fromkeys(known))
    if not word or len(word) > _LONGEST or not candidates:
        return None
    plain = _plain(word)
    same = [candidate for candidate in candidates if _plain(candidate) == plain]
    if same:
        return same[0]
    found = get_close_matches(word.lower(), candidates, n=1, cutoff=0.6)
    return found[0] if found else None


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return `did you mean 'X'?`, or the known words if they are few and none is close, or nothing."""
    candidates = list(dict.fromkeys(known))
    found = closest(word, candidates)
    if found is not None:
        return f"did you mean '{found}'?"
    if 0 < len(candidates) <= 8:
        return "known are " + ", ".join(candidates)
    return ""


def unit_mend(word: str) -> str:
    """Return what to write instead of an unknown unit word."""
    meant = OTHER_WORDS.get(word.lower())
    if meant is not None:
        return f"did you mean '{meant}'?"
    return did_you_mean(word, UNITS) or "units are " + ", ".join(UNITS)


def _plain(word: str) -> str:
    """Without what is easily left out or mixed up: `kmh` and `KM/H` are both `km/h`."""
    superscripts = str.maketrans({"²": "2"})
    return "".join(c for c in word.lower().translate(superscripts) if c.isalnum())
