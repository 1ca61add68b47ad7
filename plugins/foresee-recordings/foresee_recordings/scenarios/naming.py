"""Names of files and actors in test cases, made of the names in a recording."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from foresee_dsl.files import read_outside
from foresee_recordings.mining.situation import Situation

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


def free_name(name: str, files_of: Callable[[str], Mapping[Path, str]]) -> tuple[str, Mapping[Path, str]]:
    """Return a name, with a number if its files are there with other content, and the files of that name.

    `files_of` returns the texts of a name's files. Files with the same content are the same, and are written again.
    """
    candidate, files, number = name, files_of(name), 2
    while any(_is_other(path, text) for path, text in files.items()):
        candidate = f"{name}_{number}"
        files, number = files_of(candidate), number + 1
    return candidate, files


def _is_other(path: Path, text: str) -> bool:
    """Return whether there is a file of this path with another content."""
    if not path.exists():
        return False
    content = text.encode()
    return not path.is_file() or path.stat().st_size != len(content) or read_outside(path) != content


def file_names(situations: Sequence[Situation]) -> list[str]:
    """Return a name for each situation: what happens, the ego, and the second."""
    return unique(word(f"{s.name}_{s.ego}_at_{s.moment_s:.0f}") for s in situations)
