"""Writes the benchmark's figures as Markdown and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from foresee_study.faults.evidence import Evidence
from foresee_study.faults.measures import Confusion, Score, confusions, median, scores


@dataclass(frozen=True)
class Benchmark:
    """The results of the benchmark.

    Attributes:
        approaches, faults, strengths: in their order. reference: strength at which all approaches are compared.
        simulated_s: limit of simulated time of each search. thresholds: weakest detected strength by fault and
            approach; infinite if none was detected. compared: the searches at the reference strength. skipped: parts
            that were left out, one line each. cases: number of test cases by fault. wall_s: core seconds of all
            searches.
    """

    approaches: tuple[str, ...]
    faults: tuple[str, ...]
    strengths: tuple[float, ...]
    reference: float
    simulated_s: float
    thresholds: Mapping[tuple[str, str], float]
    compared: tuple[Evidence, ...]
    skipped: tuple[str, ...]
    cases: Mapping[str, int]
    half: str
    wall_s: float

    def scores_of(self, fault: str) -> dict[str, Score]:
        """Return the score of each approach with a fault at the reference strength."""
        return scores((search for search in self.compared if search.fault == fault), self.simulated_s)

    @property
    def verdicts(self) -> dict[str, Confusion]:
        """Return the accuracy of each judge, over the failures of all campaigns at the reference strength."""
        return confusions(failure for search in self.compared for failure in search.of_children(self.simulated_s))


def as_markdown(benchmark: Benchmark) -> str:
    """Return the tables as Markdown."""
    return "\n".join([*_head(benchmark), *_summary(benchmark), *_verdicts(benchmark), *_faults(benchmark), ""])


def as_json(benchmark: Benchmark) -> dict[str, Any]:
    """Return all figures for JSON; infinite values are None."""
    return {
        "schema": 1,
        "half": benchmark.half,
        "strengths": list(benchmark.strengths),
        "reference_strength": benchmark.reference,
        "simulated_s": benchmark.simulated_s,
        "core_s": round(benchmark.wall_s, 1),
        "skipped": list(benchmark.skipped),
        "faults": [
            {
                "fault": fault,
                "test_cases": benchmark.cases[fault],
                "approaches": [
                    {"approach": name, "threshold": _finite(benchmark.thresholds.get((fault, name), math.inf)),
                     **{key: _finite(value) for key, value in asdict(score).items()},
                     "precision": score.precision, "precision_of_findings": score.precision_of_findings,
                     "precision_of_avoidable": score.precision_of_said}
                    for name, score in benchmark.scores_of(fault).items()
                ],
            }
            for fault in benchmark.faults
        ],
        "verdicts": {
            judge: {**asdict(c), "balanced_accuracy": c.balanced, "precision": c.precision, "recall": c.recall}
            for judge, c in benchmark.verdicts.items()
        },
    }  # fmt: skip


def _head(benchmark: Benchmark) -> list[str]:
    counts = sorted(set(benchmark.cases.values()))
    of = " to ".join(dict.fromkeys(str(count) for count in (*counts[:1], *counts[-1:]))) or "no"
    return [
        "# Seeded faults",
        "",
        f"Faults: {len(benchmark.faults)}; test cases of each: {of} ({benchmark.half} half), strengths "
        f"{', '.join(f'{s:g}' for s in benchmark.strengths)}; every search simulates {benchmark.simulated_s:g} s. "
        f"{benchmark.wall_s / 3600:.1f} core hours.",
        *(f"\nLeft out: {line}." for line in benchmark.skipped),
        "",
    ]


def _summary(benchmark: Benchmark) -> list[str]:
    by_fault = {fault: benchmark.scores_of(fault) for fault in benchmark.faults}
    rows = []
    for name in benchmark.approaches:
        own = [by_fault[fault][name] for fault in benchmark.faults if name in by_fault[fault]]
        thresholds = [benchmark.thresholds.get((fault, name), math.inf) for fault in benchmark.faults]
        failing, true = sum(s.failing for s in own), sum(s.the_faults for s in own)
        rows.append((
            name,
            _strength(median(thresholds)),
            f"{sum(math.isfinite(t) for t in thresholds)} of {len(thresholds)}",
            f"{sum(s.the_faults > 0 for s in own)}",
            _share(median(s.precision for s in own)),
            _share(min((s.precision for s in own if s.precision is not None), default=None)),
            _share(true / failing if failing else None),
            _share(median(s.precision_of_findings for s in own)),
            _share(median(s.precision_of_said for s in own)),
            _share(min((s.precision_of_said for s in own if s.precision_of_said is not None), default=None)),
            f"{sum(s.true_findings for s in own)}",
            _share(median(s.recall for s in own)),
            _seconds(median(s.first_s for s in own)),
            _seconds(median(s.simulated_s for s in own)),
        ))  # fmt: skip
    head = (
        "approach", "threshold (median)", "found at any strength", f"found at {benchmark.reference:g}",
        "precision (median)", "(least)", "(pooled)", "of findings (median)", "of what is called avoidable (median)",
        "(least)", "the fault's findings", "recall (median)", "first, s (median)", "simulated, s",
    )  # fmt: skip
    return ["## Approaches", "", *table_lines(head, rows), ""]


def _verdicts(benchmark: Benchmark) -> list[str]:
    rows = [
        (judge, _share(c.balanced), _share(c.precision), _share(c.recall), f"{c.true_yes}", f"{c.false_yes}",
         f"{c.true_no}", f"{c.false_no}", f"{c.open}")
        for judge, c in benchmark.verdicts.items()
    ]  # fmt: skip
    head = (
        "verdict", "balanced accuracy", "precision", "recall", "the fault's, avoidable", "other, avoidable",
        "other, unavoidable", "the fault's, unavoidable", "undecided",
    )  # fmt: skip
    return ["## Verdicts against the ground truth", "", *table_lines(head, rows), ""]


def _faults(benchmark: Benchmark) -> list[str]:
    lines = [
        "## Faults",
        "",
        "Threshold: the weakest strength that is detected. Numbers: at the middle strength, how many failing mutants "
        "the fault causes, of all failing mutants (for plain: of test cases).",
        "",
    ]
    rows = []
    for fault in benchmark.faults:
        own = benchmark.scores_of(fault)
        cells = []
        for name in benchmark.approaches:
            score = own.get(name)
            counts = f"{score.the_faults}/{score.failing}" if score is not None else "-"
            cells.append(f"{_strength(benchmark.thresholds.get((fault, name), math.inf))}; {counts}")
        rows.append((fault, str(benchmark.cases[fault]), *cells))
    return [*lines, *table_lines(("fault", "cases", *benchmark.approaches), rows)]


def table_lines(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a Markdown table."""
    return [f"| {' | '.join(head)} |", f"|{' --- |' * len(head)}", *(f"| {' | '.join(row)} |" for row in rows)]


def _strength(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:g}" if math.isfinite(value) else "none"


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.0%}"


def _seconds(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.0f}" if math.isfinite(value) else "never"


def _finite(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value
