"""What the options of `study` mean: names, numbers, a half, test cases."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from foresee_dsl.language.project.document import TestCase
    from foresee_dsl.study.halves import Half
    from foresee_dsl.study.settings import StudySettings


def names_in(text: str | None) -> tuple[str, ...]:
    """Return the names between commas, each once; none where there is no text."""
    return tuple(dict.fromkeys(name.strip() for name in (text or "").split(",") if name.strip()))


def half_named(text: str | None) -> Half | None:
    """Return the half of this name; None where none is named."""
    from foresee_dsl.study.halves import Half

    if text is None:
        return None
    try:
        return Half(text)
    except ValueError as err:
        raise typer.BadParameter(f"{text!r} is not one of: even, odd, all", param_hint="--half") from err


def numbers_in(text: str, count: int, option: str) -> list[int]:
    """Return so many whole numbers between commas."""
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != count or not all(part.isascii() and part.isdigit() for part in parts):
        raise typer.BadParameter(f"{text!r}: write {count} whole numbers with commas", param_hint=option)
    return [int(part) for part in parts]


def cases_of(
    paths: list[str] | None, settings: StudySettings, only: list[str] | None, *, allow_outside: bool
) -> tuple[TestCase, ...]:
    """Return the test cases of a study: of its half, so many at most."""
    from foresee_dsl.cli.options.case_selection import selected
    from foresee_dsl.files import data_folder
    from foresee_dsl.language.project.loading import load_test_cases
    from foresee_dsl.study.halves import of_half, sample

    found = load_test_cases(paths or [str(data_folder("scenarios"))], allow_outside=allow_outside)
    return sample(selected(of_half(found, settings.half), None, only), settings.first)


def town_cases(folder: Path, settings: StudySettings, *, allow_outside: bool) -> tuple[TestCase, ...]:
    """Return a town's test cases, all of both halves: no setting was chosen on them."""
    from foresee_dsl.language.project.loading import load_test_cases

    return tuple(load_test_cases([folder], allow_outside=allow_outside)[: settings.first])
