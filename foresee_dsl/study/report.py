"""Everything that a study writes for people: tables in three formats, figures, and one page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import write_whole
from foresee_dsl.study.beside import beside
from foresee_dsl.study.figures import NoFiguresError, write_figures
from foresee_dsl.study.folder import StudyFolder
from foresee_dsl.study.halves import Half
from foresee_dsl.study.page import write_page
from foresee_dsl.study.results import Results
from foresee_dsl.study.tables.complementarity import complementarity
from foresee_dsl.study.tables.effectiveness import effectiveness
from foresee_dsl.study.tables.efficiency import efficiency
from foresee_dsl.study.tables.generality import generality
from foresee_dsl.study.tables.rankers import comparison
from foresee_dsl.study.tables.table import Table

TABLES: Mapping[str, Callable[[Results], tuple[Table, ...]]] = MappingProxyType(
    {"rq1": effectiveness, "rq2": comparison, "rq3": efficiency, "rq4": complementarity, "rq5": generality}
)
"""What makes the tables of each question."""


def tables_of(name: str, results: Results) -> tuple[Table, ...]:
    """Return the tables of a question that have rows."""
    return tuple(table for table in (beside(results, name), *TABLES[name](results)) if table.rows)


def write_tables(tables: tuple[Table, ...], folder: StudyFolder) -> None:
    """Write tables as Markdown, CSV and LaTeX."""
    for table in tables:
        for suffix, text in ((".md", table.as_markdown()), (".csv", table.as_csv()), (".tex", table.as_latex())):
            write_whole(folder.tables / f"{table.name}{suffix}", text)


@dataclass(frozen=True)
class Written:
    """What was written. `tables`: by question. notes: what could not be made, and why."""

    tables: dict[str, tuple[Table, ...]]
    page: Path
    notes: tuple[str, ...] = ()


def write_report(folder: StudyFolder, half: Half | None = None, page: Path | None = None) -> Written:
    """Write the tables of a study's folder, for one half of the test cases (by default, as they were run).

    Raises:
        ForeseeError: there is no study in the folder, or nothing of this half.
    """
    results = Results.of(folder, half)
    if not any(measured.cases for measured in results.campaigns):
        where = "" if results.half is Half.ALL else f" of the {results.half} half: name another --half"
        raise ForeseeError(f"the study in {folder.at} has run no test case{where}")
    asked = folder.read().asked or TABLES  # where none was answered to the end, all that there is
    tables = {name: found for name in TABLES if name in asked and (found := tables_of(name, results))}
    for found in tables.values():
        write_tables(found, folder)
    notes: tuple[str, ...] = ()
    figures: tuple[str, ...] = ()
    try:
        figures = write_figures(results, folder.figures)
    except NoFiguresError as err:
        notes = (str(err),)
    page = page or folder.page
    write_page(folder, results, tables, figures, page)
    return Written(tables, page, notes)
