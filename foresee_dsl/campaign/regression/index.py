"""Index of a regression suite: the part of its `README.md` between two marks."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from foresee_dsl.campaign.regression.edits import sentence_in
from foresee_dsl.campaign.regression.expectations import in_words, recorded_in
from foresee_dsl.campaign.regression.suite import BEGIN, END, INDEX, stated_in
from foresee_dsl.files import read_outside, templates, write_whole
from foresee_dsl.language import model as m
from foresee_dsl.language.parser import load
from foresee_dsl.language.printer import print_item
from foresee_dsl.language.project.document import Document

if TYPE_CHECKING:
    from markupsafe import Markup

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


def write_index(folder: Path, tests: Iterable[Path]) -> bool:
    """Write the index of a suite's tests into its `README.md`; text outside of the marks is unchanged.

    Returns:
        True if the file has changed.
    """
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
    return new != old


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
