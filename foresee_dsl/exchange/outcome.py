"""Results of an import or export: writes files that appear together or not at all, and reports the parts that were left
out."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from filecmp import cmp
from pathlib import Path
from typing import TYPE_CHECKING

from foresee_dsl.errors import ForeseeError

if TYPE_CHECKING:
    from foresee_dsl.language.model import Definition


class ExchangeError(ForeseeError):
    """Raised if a foreign file cannot be read, or cannot be written with these options; the message names the file and
    a fix."""


@dataclass(frozen=True)
class Imported:
    """The result of an import or export.

    Attributes:
        files: the written files.
        cases: number of test cases in them.
        taken: counts of the parts that were taken over, by description.
        left_out: counts of the parts of the source that the result does not express, by description.
        notes: additions and guesses, one sentence each.
        lost: counts of actions, triggers and participants whose absence changes the scenario, by description.
    """

    files: tuple[Path, ...] = ()
    cases: int = 0
    taken: dict[str, int] = field(default_factory=dict)
    left_out: Counter[str] = field(default_factory=Counter)
    notes: tuple[str, ...] = ()
    lost: Counter[str] = field(default_factory=Counter)

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "files": self.files,
            "cases": self.cases,
            "taken": self.taken,
            "left_out": self.left_out,
            "lost": self.lost,
            "notes": self.notes,
        }


def write_together(out: Path, write: Callable[[Path], None]) -> tuple[Path, ...]:
    """Let files be written to a temporary folder, then move them into place.

    Args:
        out: the target folder; it is created if missing. Files in it are not overwritten.
        write: writes files (no folders) into the folder that it receives. If it raises, no file remains.

    Returns:
        The files, in `out`, by name.

    Raises:
        ExchangeError: `out` cannot be written, or has a file of one of these names with other content.
    """
    try:
        # The innermost folder comes first, so that the folders can be removed in this order.
        new_folders = [folder for folder in (out, *out.parents) if not folder.exists()]
        out.mkdir(parents=True, exist_ok=True)
        fresh = Path(tempfile.mkdtemp(prefix=".foresee-import-", dir=out))
    except OSError as err:
        raise ExchangeError(f"{out} cannot be written: {err.strerror or err}") from err
    try:
        write(fresh)
        names = sorted(file.name for file in fresh.iterdir())
        _refuse_others(fresh, out, names)
        for name in names:
            (fresh / name).replace(out / name)
    except BaseException as error:
        if error.args and isinstance(
            error, ForeseeError
        ):  # the temporary folder no longer exists when the message is read
            error.args = (str(error.args[0]).replace(f"{fresh}{os.sep}", ""), *error.args[1:])
        shutil.rmtree(fresh, ignore_errors=True)
        for folder in new_folders:
            if not any(folder.iterdir()):
                folder.rmdir()
        raise
    shutil.rmtree(fresh, ignore_errors=True)
    return tuple(out / name for name in names)


def _refuse_others(fresh: Path, out: Path, names: Sequence[str]) -> None:
    """Raise if the folder has a file of one of these names with other content than the fresh one, such as a scenario
    that was edited."""
    there = [name for name in names if (out / name).exists()]
    others = [name for name in there if not ((out / name).is_file() and cmp(fresh / name, out / name, shallow=False))]
    if others:
        files = ", ".join(str(out / name) for name in others)
        raise ExchangeError(
            f"nothing was written: {files} {'is' if len(others) == 1 else 'are'} there already with other content; "
            "give another --out, or delete or rename what is there"
        )


def import_together(out: Path, write: Callable[[Path], Imported]) -> Imported:
    """Write files as `write_together` does; return the report of `write`, completed by the files."""
    reports: list[Imported] = []
    files = write_together(out, lambda folder: reports.append(write(folder)))
    return replace(reports[0], files=files)


def write_text(file: Path, model: Definition, remarks: Mapping[int, Sequence[str]] | None = None) -> None:
    """Write a scenario, network or catalogue in the standard layout.

    `remarks` holds comments to write before its statements, by the statements' indices in its body.
    """
    from foresee_dsl.language.printer import print_model, remarked

    comments = remarked(model, remarks) if remarks else None
    file.write_text(print_model(model, comments), encoding="utf-8", newline="\n")
