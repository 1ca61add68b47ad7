"""The figures as Markdown and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from foresee_study.faults.evidence import Evidence
from foresee_study.faults.measures import Confusion, Score, confusions, median, scores


@dataclass(frozen=True)
class Benchmark:
    """All that was measured.

    Attributes:
        approaches, faults, strengths: in their order. reference: the strength at which all approaches are compared.
        simulated_s: what each search may simulate. thresholds: by fault and approach the weakest strength that is
            found, infinite: none. compared: the searches at the reference strength. skipped: what could not be
            done, a line each. cases: how many test cases of each fault. wall_s: core seconds of all searches.
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
        """Return how well each approach did with a fault at the reference strength."""
        return scores((one for one in self.compared if one.fault == fault), self.simulated_s)

    @property
    def verdicts(self) -> dict[str, Confusion]:
        """Return how good each verdict is, over the failures of all campaigns at the reference strength."""
        return confusions(failure for one in self.compared for failure in one.of_children(self.simulated_s))


def as_markdown(found: Benchmark) -> str:
    """Return the tables."""
    return "\n".join([*_head(found), *_summary(found), *_verdicts(found), *_faults(found), ""])


def as_json(found: Benchmark) -> dict[str, Any]:
    """Return all figures; infinite ones are None."""
    return {
        "schema": 1,
        "half": found.half,
        "strengths": list(found.strengths),
        "reference_strength": found.reference,
        "simulated_s": found.simulated_s,
        "core_s": round(found.wall_s, 1),
        "skipped": list(found.skipped),
        "faults": [
            {
                "fault": fault,
                "test_cases": found.cases[fault],
                "approaches": [
                    {"approach": name, "threshold": _finite(found.thresholds.get((fault, name), math.inf)),
                     **{key: _finite(value) for key, value in asdict(score).items()},
                     "precision": score.precision, "precision_of_findings": score.precision_of_findings,
                     "precision_of_avoidable": score.precision_of_said}
                    for name, score in found.scores_of(fault).items()
                ],
            }
            for fault in found.faults
        ],
        "verdicts": {
            judge: {**asdict(c), "balanced_accuracy": c.balanced, "precision": c.precision, "recall": c.recall}
            for judge, c in found.verdicts.items()
        },
    }  # fmt: skip


def _head(found: Benchmark) -> list[str]:
    counts = sorted(set(found.cases.values()))
    of = " to ".join(dict.fromkeys(str(count) for count in (*counts[:1], *counts[-1:]))) or "no"
    return [
        "# Seeded faults",
        "",
        f"Faults: {len(found.faults)}; test cases of each: {of} ({found.half} half), strengths "
        f"{', '.join(f'{s:g}' for s in found.strengths)}; every search simulates {found.simulated_s:g} s. "
        f"{found.wall_s / 3600:.1f} core hours.",
        *(f"\nLeft out: {line}." for line in found.skipped),
        "",
    ]


def _summary(found: Benchmark) -> list[str]:
    by_fault = {fault: found.scores_of(fault) for fault in found.faults}
    rows = []
    for name in found.approaches:
        own = [by_fault[fault][name] for fault in found.faults if name in by_fault[fault]]
        thresholds = [found.thresholds.get((fault, name), math.inf) for fault in found.faults]
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
        "approach", "threshold (median)", "found at any strength", f"found at {found.reference:g}",
        "precision (median)", "(least)", "(pooled)", "of findings (median)", "of what is called avoidable (median)",
        "(least)", "the fault's findings", "recall (median)", "first, s (median)", "simulated, s",
    )  # fmt: skip
    return ["## Approaches", "", *_table(head, rows), ""]


def _verdicts(found: Benchmark) -> list[str]:
    rows = [
        (judge, _share(c.balanced), _share(c.precision), _share(c.recall), f"{c.true_yes}", f"{c.false_yes}",
         f"{c.true_no}", f"{c.false_no}", f"{c.open}")
        for judge, c in found.verdicts.items()
    ]  # fmt: skip
    head = (
        "verdict", "balanced accuracy", "precision", "recall", "the fault's, avoidable", "other, avoidable",
        "other, unavoidable", "the fault's, unavoidable", "undecided",
    )  # fmt: skip
    return ["## Verdicts against the ground truth", "", *_table(head, rows), ""]


def _faults(found: Benchmark) -> list[str]:
    lines = [
        "## Faults",
        "",
        "Threshold; at the middle strength the fault's failing children of all (of plain: test cases).",
        "",
    ]
    rows = []
    for fault in found.faults:
        own = found.scores_of(fault)
        cells = []
        for name in found.approaches:
            score = own.get(name)
            said = f"{score.the_faults}/{score.failing}" if score is not None else "-"
            cells.append(f"{_strength(found.thresholds.get((fault, name), math.inf))}; {said}")
        rows.append((fault, str(found.cases[fault]), *cells))
    return [*lines, *_table(("fault", "cases", *found.approaches), rows)]


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
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
