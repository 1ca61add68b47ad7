"""Make an input smaller while the same is wrong with it (delta debugging, Zeller and Hildebrandt 2002, by halves)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

MOST_TRIES = 600
"""Enough for a file of a few hundred lines (ours)."""


def minimise(content: bytes, still_wrong: Callable[[bytes], bool]) -> bytes:
    """Return a small part of an input with which the same is wrong: first whole lines go, then characters."""
    tries = [MOST_TRIES]
    text = content.decode("utf-8", errors="surrogateescape")

    def wrong(pieces: Sequence[str]) -> bool:
        tries[0] -= 1
        return still_wrong("".join(pieces).encode("utf-8", errors="surrogateescape"))

    for split in (lambda t: t.splitlines(keepends=True), list):
        text = "".join(_fewer(split(text), wrong, tries))
    return text.encode("utf-8", errors="surrogateescape")


def _fewer(pieces: list[str], wrong: Callable[[Sequence[str]], bool], tries: list[int]) -> list[str]:
    size = max(len(pieces) // 2, 1)
    while tries[0] > 0:
        at, removed = 0, False
        while at < len(pieces) and tries[0] > 0:
            without = pieces[:at] + pieces[at + size :]
            if wrong(without):
                pieces, removed = without, True
            else:
                at += size
        if size == 1 and not removed:
            break
        size = max(size // 2, 1)
    return pieces
