"""Layout of a suite on disk: its tests, `parents/` with the files that they need, and an index for people."""

from __future__ import annotations

from pathlib import Path

from foresee_dsl.files import read_outside
from foresee_dsl.language.project import addresses as a

INDEX = "README.md"
BEGIN, END = "<!-- foresee keep: begin -->", "<!-- foresee keep: end -->"
"""The index is rewritten between these marks; a folder whose `README.md` has them is a suite."""
PARENTS = "parents"
"""Folder inside a suite with the files that its tests need: clips, scenarios, networks, models."""


def is_suite(folder: Path) -> bool:
    """Return whether a folder's `README.md` has the marks of an index."""
    file = folder / INDEX
    return a.is_file(file) and BEGIN.encode() in read_outside(file)


def suite_folder(file: Path) -> Path | None:
    """Return the suite that contains a file: the nearest folder above with an index."""
    return next((folder for folder in a.absolute(file).parents if is_suite(folder)), None)


def tests_in(folder: Path) -> tuple[Path, ...]:
    """Return the test files of a suite, sorted: every `.foresee` file outside of `parents/`."""
    inside = folder / PARENTS
    return tuple(file for file in a.scenario_files([folder]) if not file.is_relative_to(inside))


def role_of(file: Path) -> str:
    """Return the role of a file in a suite: `test`, `parent`, or "" outside of suites."""
    folder = suite_folder(file)
    if folder is None:
        return ""
    return "parent" if a.absolute(file).is_relative_to(folder / PARENTS) else "test"
