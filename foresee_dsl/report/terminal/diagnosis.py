"""Prints diagnoses in at most 80 columns: which part of the driver causes a failure, and what each ideal part
changes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from foresee_dsl.avoidance.causes import Diagnosis, IdealRun
from foresee_dsl.campaign.findings.diagnosing import DiagnosedFailure
from foresee_dsl.report.terminal.review import wrapped

_NONE = "no part (planning, or a situation that comes too late)"
_ELSEWHERE = (
    "Passes elsewhere: the ego no longer comes into the situation in which it failed. That may be because of the part, "
    "or luck."
)
_PARTS = 22
"""Width of the column with the parts' names, columns."""


def diagnosis_text(result: DiagnosedFailure, *, short: bool = False) -> str:
    """Return a diagnosis as text; `short`: without the table of runs."""
    return "\n".join(_lines(result, short=short)) + "\n"


def _lines(result: DiagnosedFailure, *, short: bool) -> Iterator[str]:
    number = f"{result.number}. " if result.number else ""
    diagnosis = result.diagnosis
    if diagnosis is None:
        yield from wrapped(f"{number}{result.name}: not diagnosed, {result.note}", more="  ")
        return
    if short:
        yield from wrapped(f"{number}{result.name}: {diagnosis.text}", more="  ")
        return
    yield from wrapped(f"{number}{result.name} with {diagnosis.driver}: {diagnosis.reason}")
    yield ""
    yield from wrapped(f"Cause: {diagnosis.text}")
    yield ""
    yield f"  {'ideal part':<{_PARTS}}the failure"
    for run in diagnosis.runs:
        yield from _row(run)
    if any(run.elsewhere for run in diagnosis.runs):
        yield ""
        yield from wrapped(_ELSEWHERE)


def _row(run: IdealRun) -> Iterator[str]:
    words = " + ".join(run.parts)
    first = f"  {words:<{_PARTS}}" if len(words) < _PARTS else f"  {words} "
    lines = wrapped(run.outcome, " " * (_PARTS + 2))
    if len(words) < _PARTS:
        yield first + lines[0].strip()
        yield from lines[1:]
    else:
        yield first.rstrip()
        yield from lines


def _cause(diagnosis: Diagnosis) -> str:
    return f"{'' if diagnosis.sure else 'probably '}{' + '.join(diagnosis.cause) or _NONE}"


def counts_text(results: Sequence[DiagnosedFailure]) -> str:
    """Return the number of findings by the part that causes them."""
    causes = Counter(_cause(r.diagnosis) for r in results if r.diagnosis is not None)
    lines = [
        "",
        f"Causes of {len(results)} findings",
        *(f"  {count:>3}  {part}" for part, count in causes.most_common()),
    ]
    left = sum(result.diagnosis is None for result in results)
    return "\n".join([*lines, *([f"  {left:>3}  not diagnosed"] if left else [])]) + "\n"
