"""Checks files of any kind, and reports every error and warning that does not need a network's geometry."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.files import absolute
from foresee_dsl.language.document import Document, TestCase
from foresee_dsl.language.lints.lint import lint
from foresee_dsl.language.project import addresses as a
from foresee_dsl.language.project.loading import Project


@dataclass(frozen=True)
class CheckResult:
    """The result of a check: the number of files, the test cases that could be loaded, and the diagnostics."""

    files: int
    cases: tuple[TestCase, ...]
    diagnostics: tuple[Diagnostic, ...]
    campaigns: tuple[Document, ...] = ()
    """Campaign files without errors; the names in them are checked by the code that runs campaigns."""


def check_paths(
    paths: Iterable[str], overlay: Mapping[Path, str] | None = None, *, allow_outside: bool = True
) -> CheckResult:
    """Check files, folders and addresses; every error is reported once, and an error in one file does not hide those of
    others.

    Files without errors are also checked by the lints. `overlay` holds texts that replace those on the disk, by
    absolute path (an editor's unsaved texts). For `allow_outside` see `loading.load_test_case`.

    Raises:
        InputError: a named file or folder does not exist.
    """
    texts = overlay or {}
    addresses = [address for path in paths for address in _addresses(path, texts)]
    project = Project(allow_outside=allow_outside, overlay=texts)
    cases: list[TestCase] = []
    campaigns: list[Document] = []
    diagnostics: dict[Diagnostic, None] = {}
    for address, file in addresses:
        try:
            text = texts.get(absolute(file))
            kind = a.kind_of(file) if text is None else a.kind_of_text(text)
            if kind == "campaign":
                campaigns.append(project.document(file))
            elif kind in ("network", "models"):
                project.definition(file)
            else:
                cases.extend(project.test_cases([address]))
        except InputError as error:
            diagnostics |= dict.fromkeys(error.diagnostics)
    diagnostics |= dict.fromkeys(project.warnings)
    diagnostics |= dict.fromkeys(_lints(cases, {d.path for d in diagnostics if d.severity == "error"}))
    return CheckResult(len({file for _, file in addresses}), tuple(cases), tuple(diagnostics), tuple(campaigns))


def _lints(cases: Iterable[TestCase], broken: Container[str]) -> Iterator[Diagnostic]:
    """Yield the lints of every file with test cases, once each; not of files with errors."""
    by_file: dict[int, list[TestCase]] = {}
    for case in cases:
        by_file.setdefault(id(case.document), []).append(case)
    for of_file in by_file.values():
        document = of_file[0].document
        if document is not None and document.path not in broken:
            yield from lint(document, of_file)


def _addresses(path: str, overlay: Mapping[Path, str]) -> list[tuple[str, Path]]:
    file, _ = a.parse_address(path)
    if absolute(file) in overlay:
        return [(path, file)]
    if file.is_dir():
        return [(str(f), f) for f in a.scenario_files([file])]
    if not file.is_file():
        raise a.missing(file)
    return [(path, file)]
