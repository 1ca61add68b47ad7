"""A regression suite: the layout of its folder, its test cases (mutants, files with expectations, and all tests that
`foresee keep` has copied), and its index, the part of its `README.md` between two marks."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from foresee_dsl.campaign.regression.edits import sentence_in
from foresee_dsl.campaign.regression.expectations import DRIVER, in_words, recorded_in
from foresee_dsl.drivers.registry import DRIVERS, name_in, recorded_address
from foresee_dsl.errors import InputError, with_article
from foresee_dsl.files import absolute, read_outside, templates, write_whole
from foresee_dsl.language import model as m
from foresee_dsl.language.document import Document
from foresee_dsl.language.parser import load
from foresee_dsl.language.printer import print_item
from foresee_dsl.language.project import addresses as a
from foresee_dsl.language.project.loading import Project

if TYPE_CHECKING:
    from markupsafe import Markup

INDEX = "README.md"
BEGIN, END = "<!-- foresee keep: begin -->", "<!-- foresee keep: end -->"
"""The index is rewritten between these marks; a folder whose `README.md` has them is a suite."""
PARENTS = "parents"
"""Folder inside a suite with the files that its tests need: clips, scenarios, networks, models."""


def _is_suite(folder: Path) -> bool:
    """Return whether a folder's `README.md` has the marks of an index."""
    file = folder / INDEX
    return a.is_file(file) and BEGIN.encode() in read_outside(file)


def suite_folder(file: Path) -> Path | None:
    """Return the suite that contains a file: the nearest folder above with an index."""
    return next((folder for folder in absolute(file).parents if _is_suite(folder)), None)


def tests_in(folder: Path) -> tuple[Path, ...]:
    """Return the test files of a suite, sorted: every `.foresee` file outside of `parents/`."""
    inside = folder / PARENTS
    return tuple(file for file in a.scenario_files([folder]) if not file.is_relative_to(inside))


def role_of(file: Path) -> str:
    """Return the role of a file in a suite: `test`, `parent`, or "" outside of suites."""
    folder = suite_folder(file)
    if folder is None:
        return ""
    return "parent" if absolute(file).is_relative_to(folder / PARENTS) else "test"


_STATES = re.compile(rb"^[ \t{;]*expected\b", re.MULTILINE)


@dataclass(frozen=True)
class SuiteTest:
    """One test case of a suite.

    Attributes:
        file: as the user named it. case: name of the case, for a scenario with cases. stated: the `expected` lines of
            its file. origin: the `origin` block of a mutant.
        verified: `foresee verify` runs it; otherwise it only has to pass.
    """

    file: Path
    case: str | None = None
    stated: tuple[m.Expected, ...] = ()
    origin: m.Origin | None = None
    verified: bool = True

    @property
    def address(self) -> str:
        """Return the address: `FILE` or `FILE::CASE`."""
        return f"{self.file}::{self.case}" if self.case else str(self.file)

    @property
    def driver(self) -> str:
        """Return the driver that the file records or has expectations for; otherwise `pdm`."""
        if self.origin is not None and self.origin.driver:
            return recorded_address(self.origin.driver)
        addresses = (recorded_address(item.driver) for item in self.stated)
        return next((name for name in addresses if name_in(name) in DRIVERS.names()), DRIVER)

    @property
    def seed(self) -> int:
        """Return the seed that the file records; otherwise 0."""
        return int(self.origin.seed.value) if self.origin and self.origin.seed else 0


def suite_of(paths: Iterable[str | Path]) -> tuple[SuiteTest, ...]:
    """Return the named tests and those in named folders, in the order of their paths.

    Raises:
        InputError: a path does not exist, or a named file contains no test.
    """
    named = tuple(Path(path) for path in paths)
    collected: list[SuiteTest] = []
    for file in a.scenario_files(named):
        tests = tuple(_tests_of(file))
        if not tests and file in named:
            kind = a.kind_of(file)
            message = f"this file has {with_article(kind) if kind else 'no definition'} and no expectations"
            help = "write a mutant, a file with a line such as `expected pdm passes`, or a folder of them"
            raise a.mistake("FS132", message, help, a.display_path(file))
        collected += tests
    return tuple(collected)


def _tests_of(file: Path) -> Iterator[SuiteTest]:
    kind, role = a.kind_of(file), role_of(file)
    is_test = role == "test" or kind == "mutant" or _STATES.search(read_outside(file)) is not None
    if role == "parent" or kind not in ("mutant", "clip", "scenario") or not is_test:
        return
    try:
        document = load(file, shown_as=a.display_path(file))
    except InputError:  # running the test reports the errors
        yield SuiteTest(file)
        return
    stated = stated_in(document)
    if isinstance(document.model, m.Mutant):
        yield SuiteTest(file, None, stated, document.model.origin)
    elif isinstance(document.model, m.Clip):
        yield from [SuiteTest(file, None, stated)] if stated or role else []
    elif stated or role:
        yield from (SuiteTest(file, case, stated) for case in _cases(file, stated))


def stated_in(document: Document) -> tuple[m.Expected, ...]:
    """Return the `expected` lines of a file."""
    return tuple(item for item in getattr(document.model, "body", ()) if isinstance(item, m.Expected))


def _cases(file: Path, stated: Sequence[m.Expected]) -> tuple[str | None, ...]:
    """Return the cases of a scenario that have expectations: all, if a line names no case."""
    named = tuple(dict.fromkeys(item.case for item in stated))
    if named and None not in named:
        return named
    try:
        scenario = Project().whole_scenario(file)
    except InputError:
        return (None,)
    return tuple(case.name for case in scenario.all(m.Case)) or (None,)


_TITLE = "# Regression suite\n\n"
_SPECIAL = re.compile(r"([\\|`*\[\]])")
"""Characters with a meaning in a Markdown table cell."""


@dataclass(frozen=True)
class IndexRow:
    """One test in the index; `changes` and `expected` are lines of its file."""

    name: str
    link: str
    sentence: str
    changes: tuple[str, ...]
    expected: tuple[str, ...]


def write_index(folder: Path, tests: Iterable[Path]) -> None:
    """Write the index of a suite's tests into its `README.md`; text outside of the marks is unchanged."""
    file = folder / INDEX
    rows = [_row(folder, test) for test in tests]
    environment = templates("regression").overlay()
    environment.filters = {**environment.filters, "cell": _cell, "code": _code}
    part = f"{BEGIN}\n{environment.get_template('README.md.j2').render(tests=rows).strip()}\n{END}\n"
    old = read_outside(file).decode("utf-8") if file.is_file() else ""
    before, begin, rest = old.partition(BEGIN)
    _, end, after = rest.partition(END)
    if begin and end:
        new = before + part + after.removeprefix("\r").removeprefix("\n")
    else:
        new = f"{old.rstrip()}\n\n{part}" if old.strip() else _TITLE + part
    if new != old:
        write_whole(file, new)


def _row(folder: Path, test: Path) -> IndexRow:
    document = load(test)
    body: tuple[m.Item, ...] = getattr(document.model, "body", ())
    changes = tuple(print_item(item).removeprefix("change ") for item in body if isinstance(item, m.Change))
    return IndexRow(
        name=test.stem,
        link=test.relative_to(folder).as_posix(),
        sentence=_sentence(document),
        changes=changes,
        expected=tuple(f"{item.driver} {_of_case(item)}{in_words(item)}" for item in stated_in(document)),
    )


def _of_case(item: m.Expected) -> str:
    return f"in case {item.case} " if item.case else ""


def _sentence(document: Document) -> str:
    """Return the description of a test: that of its file, otherwise the recorded failure, otherwise a clip's risk."""
    model = document.model
    origin = model.origin if isinstance(model, m.Mutant) else None
    risk = model.risk if isinstance(model, m.Clip) else None
    recorded = (origin.found or "") if origin is not None and recorded_in(origin) else ""
    return sentence_in(document) or recorded or (risk.text if risk else "")


def _cell(text: str) -> Markup:
    """Return a text for a table cell: on one line, with all characters special to Markdown or HTML escaped."""
    from markupsafe import Markup

    escaped = _SPECIAL.sub(r"\\\1", " ".join(text.split())).replace("&", "&amp;").replace("<", "&lt;")
    return Markup(escaped)  # noqa: S704 - all special characters are escaped


def _code(text: str) -> Markup:
    """Return a line of a file for a table's cell, as code."""
    from markupsafe import Markup

    escaped = " ".join(text.split()).replace("`", "'").replace("|", "\\|")
    return Markup(f"`{escaped}`")  # noqa: S704 - code has no special characters
