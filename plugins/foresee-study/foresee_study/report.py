"""Writes the results of a study: tables in three formats, figures, and one page as Markdown."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import templates, write_whole
from foresee_study.beside import beside, in_words, readings
from foresee_study.figures import NoFiguresError, figures_of, write_figures
from foresee_study.folder import Record, StudyFolder
from foresee_study.halves import Half
from foresee_study.questions import QUESTIONS, Question, wanted_by
from foresee_study.results import Results
from foresee_study.settings import BUNDLED
from foresee_study.tables.complementarity import complementarity
from foresee_study.tables.effectiveness import effectiveness
from foresee_study.tables.efficiency import WALL, efficiency
from foresee_study.tables.generality import generality
from foresee_study.tables.rankers import comparison
from foresee_study.tables.searches import default_search, searches
from foresee_study.tables.table import Table

TABLES: Mapping[str, Callable[[Results], tuple[Table, ...]]] = MappingProxyType(
    {
        "rq1": effectiveness,
        "rq2": comparison,
        "rq3": efficiency,
        "rq4": complementarity,
        "rq5": generality,
        "search": searches,
        "default": default_search,
    }
)
"""For each question, the function that makes its tables."""


def tables_of(name: str, results: Results) -> tuple[Table, ...]:
    """Return the tables of a question that have rows."""
    compared = (beside(results, name), *((readings(results),) if name == "rq2" else ()))
    return tuple(table for table in (*compared, *TABLES[name](results)) if table.rows)


def write_tables(tables: tuple[Table, ...], folder: StudyFolder) -> None:
    """Write tables as Markdown, CSV and LaTeX."""
    for table in tables:
        for suffix, text in ((".md", table.as_markdown()), (".csv", table.as_csv()), (".tex", table.as_latex())):
            write_whole(folder.tables / f"{table.name}{suffix}", text)


@dataclass(frozen=True)
class Written:
    """The result of writing a report. `tables`: by question. `page`: its path. `notes`: missing parts, with the
    reason."""

    tables: dict[str, tuple[Table, ...]]
    page: Path
    notes: tuple[str, ...] = ()


def write_report(
    folder: StudyFolder, half: Half | None = None, page: Path | None = None, beside: Sequence[StudyFolder] = ()
) -> Written:
    """Write the tables of a study's folder, for one half of the test cases (by default, that of the study's settings).

    `beside`: other studies, whose rankers and exhaustive searches the question `search` uses, too.

    Raises:
        ForeseeError: there is no study in the folder, or it has no results for this half.
    """
    results = Results.of(folder, half, beside)
    if not any(measured.cases for measured in results.campaigns):
        where = "" if results.half is Half.ALL else f" of the {results.half} half: choose another --half"
        raise ForeseeError(f"the study in {folder.at} has run no test case{where}")
    # if no question was answered completely, the report has all results so far
    questions = folder.read().asked or TABLES
    tables = {name: own for name in TABLES if name in questions and (own := tables_of(name, results))}
    for own in tables.values():
        write_tables(own, folder)
    notes: tuple[str, ...] = ()
    figures: tuple[str, ...] = ()
    try:
        figures = write_figures(results, folder.figures)
    except NoFiguresError as err:
        notes = (str(err),)
    page = page or folder.page
    write_page(folder, results, tables, figures, page)
    return Written(tables, page, notes)


@dataclass(frozen=True)
class Part:
    """One question's part of the page."""

    question: Question
    words: tuple[str, ...]
    tables: tuple[Table, ...]
    figures: tuple[tuple[str, str], ...]


def write_page(
    folder: StudyFolder, results: Results, tables: Mapping[str, Sequence[Table]], figures: Sequence[str], page: Path
) -> None:
    """Write the page: answers and figures, with links to the tables.

    Tables of wall time are left out, as they differ from machine to machine. Figures and tables are copied beside a
    page that is outside the study's folder (into `NAME/` beside `NAME.md`).
    """
    record = folder.read()
    inside = page.resolve().parent == folder.at.resolve()
    pictures = folder.figures.name if inside else page.stem
    parts = [
        Part(
            QUESTIONS[name],
            in_words(results, name, headlines=True),
            tuple(table for table in own if not table.name.endswith(WALL)),
            tuple(figures_of(name, figures)),
        )
        for name, own in tables.items()
        if own
    ]
    drawn = [name for part in parts for name, _ in part.figures]
    if not inside and drawn:
        (page.parent / pictures).mkdir(parents=True, exist_ok=True)
        for name in drawn:
            shutil.copyfile(folder.figures / f"{name}.svg", page.parent / pictures / f"{name}.svg")
    if not inside:
        for table in (table for part in parts for table in part.tables):
            write_whole(page.parent / pictures / f"{table.name}.csv", table.as_csv())
    names = {case.name for m in results.campaigns if m.group == BUNDLED for case in m.cases}
    text = templates(str(Path(__file__).parent / "templates"), markup=False).get_template("results.md.j2").render(
        half=results.half.value,
        cases=len(names),
        preset=results.preset,
        drivers=[f"`{driver}`" for driver in results.drivers],
        repetitions=len({m.repetition for m in results.campaigns}),
        took=list(_cost_lines(results, record)),
        notes=record.notes,
        parts=parts,
        pictures=pictures,
        tables_at=folder.tables.name if inside else pictures,
    )  # fmt: skip
    lines = "\n".join(line.rstrip() for line in text.splitlines())
    write_whole(page, re.sub(r"\n{3,}", "\n\n", lines).strip("\n") + "\n")


def _cost_lines(results: Results, record: Record) -> Iterator[tuple[str, ...]]:
    """Yield a line for each question with the cost of its campaigns and, for rq4, of DriveFuzz; shared campaigns count
    for each of their questions."""
    campaigns = {(m.group, m.driver, m.ranker, m.clip_s, m.seed, m.preset): m for m in results.campaigns}
    for name, cost in sorted(record.asked.items()):
        wanted = wanted_by([name], record.settings)
        own = [campaigns.get((w.group, w.driver, w.ranker, w.clip_s, w.seed, w.preset)) for w in wanted]
        there = [m for m in own if m is not None]
        if not there:
            continue
        fuzzed = [case for fuzzing in results.fuzzings for case in fuzzing.seeds] if name == "rq4" else []
        runs = sum(m.clips + len(m.children_run) for m in there) + sum(case.runs for case in fuzzed)
        simulated_s = sum(m.simulated_s for m in there) + sum(case.simulated_s for case in fuzzed)
        wall_s = sum(m.wall_s for m in there) + sum(case.wall_s for case in fuzzed)
        yield (
            name, str(len(there)), f"{runs:,}", f"{simulated_s / 3600:.1f} h", f"{wall_s / 60:.0f} min",
            "in parts" if cost.wall_s is None else f"{cost.wall_s / 60:.0f} min on {cost.jobs} workers",
        )  # fmt: skip
