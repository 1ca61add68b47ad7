"""The page of results, as Markdown: each question's tables and figures, beside the paper's."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.files import templates, write_whole
from foresee_dsl.study.beside import in_words
from foresee_dsl.study.figures import figures_of
from foresee_dsl.study.folder import Record, StudyFolder
from foresee_dsl.study.questions import QUESTIONS, Question, wanted_by
from foresee_dsl.study.results import Results
from foresee_dsl.study.settings import BUNDLED
from foresee_dsl.study.tables.efficiency import WALL
from foresee_dsl.study.tables.table import Table


@dataclass(frozen=True)
class Part:
    """What the page has of a question."""

    question: Question
    words: tuple[str, ...]
    tables: tuple[Table, ...]
    figures: tuple[tuple[str, str], ...]


def write_page(
    folder: StudyFolder, results: Results, tables: Mapping[str, Sequence[Table]], figures: Sequence[str], page: Path
) -> None:
    """Write the page, without the tables of wall time, which differ from machine to machine.

    Figures are copied beside a page that is outside the study's folder (into `NAME/` beside `NAME.md`).
    """
    record = folder.read()
    inside = page.resolve().parent == folder.at.resolve()
    pictures = folder.figures.name if inside else page.stem
    parts = [
        Part(
            QUESTIONS[name],
            in_words(results, name),
            tuple(table for table in found if not table.name.endswith(WALL)),
            tuple(figures_of(name, figures)),
        )
        for name, found in tables.items()
        if found
    ]
    shown = [name for part in parts for name, _ in part.figures]
    if not inside and shown:
        (page.parent / pictures).mkdir(parents=True, exist_ok=True)
        for name in shown:
            shutil.copyfile(folder.figures / f"{name}.svg", page.parent / pictures / f"{name}.svg")
    names = {case.name for m in results.campaigns if m.group == BUNDLED for case in m.cases}
    text = templates("study", markup=False).get_template("results.md.j2").render(
        half=results.half.value,
        cases=len(names),
        preset=results.preset,
        drivers=[f"`{driver}`" for driver in results.drivers],
        repetitions=len({m.repetition for m in results.campaigns}),
        took=list(_took(results, record)),
        notes=record.notes,
        parts=parts,
        pictures=pictures,
    )  # fmt: skip
    lines = "\n".join(line.rstrip() for line in text.splitlines())
    write_whole(page, re.sub(r"\n{3,}", "\n\n", lines).strip("\n") + "\n")


def _took(results: Results, record: Record) -> Iterator[tuple[str, ...]]:
    """Yield a line for each question: what its campaigns cost, shared ones counted in each."""
    known = {(m.group, m.driver, m.ranker, m.clip_s, m.seed, m.preset): m for m in results.campaigns}
    for name, took in sorted(record.asked.items()):
        wanted = wanted_by([name], record.settings)
        found = [known.get((w.group, w.driver, w.ranker, w.clip_s, w.seed, w.preset)) for w in wanted]
        there = [m for m in found if m is not None]
        if not there:
            continue
        runs = sum(m.clips + len(m.children_run) for m in there)
        yield (
            name, str(len(there)), f"{runs:,}", f"{sum(m.simulated_s for m in there) / 3600:.1f} h",
            f"{sum(m.wall_s for m in there) / 60:.0f} min",
            f"{took.wall_s / 60:.0f} min on {took.jobs} workers",
        )  # fmt: skip
