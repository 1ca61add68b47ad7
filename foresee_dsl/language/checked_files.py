"""Look at files of any kind for every mistake and warning that shows without a network's geometry."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.language.addresses import kind_of, missing, parse_address, scenario_files
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project import Project


@dataclass(frozen=True)
class Checked:
    """What was looked at: how many files, the test cases that could be loaded, and what was found."""

    files: int
    cases: tuple[TestCase, ...]
    diagnostics: tuple[Diagnostic, ...]


def check_paths(paths: Iterable[str]) -> Checked:
    """Check files, folders and addresses; every mistake is found once, whatever else is wrong.

    Raises:
        InputError: something named is not there.
    """
    addresses = [address for path in paths for address in _addresses(path)]
    project = Project()
    cases: list[TestCase] = []
    found: dict[Diagnostic, None] = {}
    for address, file in addresses:
        try:
            if kind_of(file) in ("network", "models"):
                project.definition(file)
            else:
                cases.extend(project.test_cases([address]))
        except InputError as error:
            found |= dict.fromkeys(error.diagnostics)
    found |= dict.fromkeys(project.warnings)
    return Checked(len({file for _, file in addresses}), tuple(cases), tuple(found))


def _addresses(path: str) -> list[tuple[str, Path]]:
    file, _ = parse_address(path)
    if file.is_dir():
        return [(str(f), f) for f in scenario_files([file])]
    if not file.is_file():
        raise missing(file)
    return [(path, file)]
