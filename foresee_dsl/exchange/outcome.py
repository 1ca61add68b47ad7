"""What an import gives: files that appear together or not at all, and what could not be taken over."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from foresee_dsl.errors import ForeseeError

if TYPE_CHECKING:
    from foresee_dsl.language.model import Definition


class ExchangeError(ForeseeError):
    """A foreign file cannot be read, or not be written as we are asked; the message names the file and what to do."""


class SourceError(ExchangeError):
    """The foreign file itself is at fault: incomplete, in contradiction with itself, of another kind."""


class NotExpressed(Exception):  # noqa: N818 - no error: it is counted and reported
    """Something of the source has no counterpart in the other format; the text is what is counted, in words."""


class Coordinates(StrEnum):
    """How world positions are meant."""

    auto = "auto"
    right = "right-handed"
    left = "left-handed"


@dataclass(frozen=True)
class Imported:
    """The result of an import or export.

    Attributes:
        files: what was written.
        cases: how many test cases are in them.
        taken: what was taken over, in words, with counts.
        left_out: what the source holds and the result does not express, in words, with counts.
        notes: what we added or guessed, one sentence each.
        lost: actions, triggers and participants without which the result is something else, in words, with counts.
    """

    files: tuple[Path, ...] = ()
    cases: int = 0
    taken: dict[str, int] = field(default_factory=dict)
    left_out: Counter[str] = field(default_factory=Counter)
    notes: tuple[str, ...] = ()
    lost: Counter[str] = field(default_factory=Counter)

    shown = "files cases taken left_out lost notes"


def write_together(out: Path, write: Callable[[Path], None]) -> tuple[Path, ...]:
    """Have files written to a temporary folder, then move them into place.

    Args:
        out: the folder that is meant; made where it is missing. Files of the same names are replaced.
        write: writes its files into the folder that it is given (files only, no folders). If it raises, nothing is
            left behind.

    Returns:
        The files, in `out`, by name.

    Raises:
        ExchangeError: `out` cannot be written.
    """
    try:
        made = [folder for folder in (out, *out.parents) if not folder.exists()]  # the innermost first
        out.mkdir(parents=True, exist_ok=True)
        fresh = Path(tempfile.mkdtemp(prefix=".foresee-import-", dir=out))
    except OSError as err:
        raise ExchangeError(f"{out} cannot be written: {err.strerror or err}") from err
    try:
        write(fresh)
        names = sorted(file.name for file in fresh.iterdir())
        for name in names:
            (fresh / name).replace(out / name)
    except BaseException as error:
        if error.args and isinstance(error, ForeseeError):  # the folder is gone by the time that somebody reads this
            error.args = (str(error.args[0]).replace(f"{fresh}{os.sep}", ""), *error.args[1:])
        shutil.rmtree(fresh, ignore_errors=True)
        for folder in made:
            if not any(folder.iterdir()):
                folder.rmdir()
        raise
    shutil.rmtree(fresh, ignore_errors=True)
    return tuple(out / name for name in names)


def import_together(out: Path, write: Callable[[Path], Imported]) -> Imported:
    """Write files as `write_together` does, and return the report that `write` gives, with the files in it."""
    reports: list[Imported] = []
    files = write_together(out, lambda folder: reports.append(write(folder)))
    return replace(reports[0], files=files)


def write_text(file: Path, model: Definition, remarks: Mapping[int, Sequence[str]] | None = None) -> None:
    """Write a scenario, network or catalogue in the one layout.

    `remarks` are comments that stand before its statements, by their places in its body.
    """
    from foresee_dsl.language.printer import print_model, remarked

    comments = remarked(model, remarks) if remarks else None
    file.write_text(print_model(model, comments), encoding="utf-8", newline="\n")
