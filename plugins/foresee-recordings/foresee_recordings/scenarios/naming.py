"""Names of files and actors in test cases, made of the names in a recording."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from foresee_recordings.mining.situation import Situation

_HEAD = 4096
"""Number of characters at the beginning of a file of tracks that contain the recording's hash. Ours."""
_LONGEST_TEXT = 2000
"""Longest text of the language, characters (`language.model.values.Text`)."""
_LONGEST = 40
"""Longest name of a file, characters. Ours: it stays readable in a table."""


def word(text: str) -> str:
    """Return a text as a word of lower-case letters, digits and underscores; it may be empty."""
    return re.sub(r"_+", "_", re.sub(r"[^a-z0-9]", "_", text.lower())).strip("_")[:_LONGEST]


def one_line(text: str) -> str:
    """Return a text from a recording as a text of the language: one line, without double quotes and invisible
    characters, and not longer than allowed."""
    line = " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())
    return line.replace('"', "'")[:_LONGEST_TEXT]


def unique(names: Iterable[str]) -> list[str]:
    """Return names, with a number after each that occurred before."""
    used: set[str] = set()
    result = []
    for name in names:
        candidate, number = name, 2
        while candidate in used:
            candidate, number = f"{name}_{number}", number + 1
        used.add(candidate)
        result.append(candidate)
    return result


def free_name(folder: Path, name: str, sha256: str) -> str:
    """Return the name of a test case in a folder, with a number if the folder has it from another recording.

    A test case of the same recording (`sha256`) is written again.
    """
    candidate, number = name, 2
    while _of_another(folder / f"{candidate}.tracks.csv", sha256):
        candidate, number = f"{name}_{number}", number + 1
    return candidate


def _of_another(tracks: Path, sha256: str) -> bool:
    if not tracks.exists():
        return False
    with tracks.open(encoding="utf-8", errors="replace") as file:
        return sha256 not in file.read(_HEAD)


def file_names(situations: Sequence[Situation]) -> list[str]:
    """Return a name for each situation: what happens, the ego, and the second."""
    return unique(word(f"{s.name}_{s.ego}_at_{s.moment_s:.0f}") for s in situations)
