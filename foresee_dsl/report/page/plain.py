"""A report's findings as lines for a terminal, and as data."""

from __future__ import annotations

from typing import Any

from foresee_dsl.report.page.contents import Contents
from foresee_dsl.report.page.entries import Found
from foresee_dsl.report.page.runs import Run
from foresee_dsl.report.safe_text import safe


def as_text(contents: Contents) -> str:
    """Return the headline, and a paragraph for each finding: what happened, what was changed, how to run it."""
    blocks = ["\n".join([safe(contents.headline), safe(contents.subtitle), *map(safe, contents.notes)])]
    blocks += ["\n".join(_lines(found)) for found in contents.findings]
    return "\n\n".join(blocks) + "\n"


def _lines(found: Found) -> list[str]:
    first = found.runs[0]
    kinds = [found.verdict, found.class_, found.preventability, f"family {found.family}" if found.family else ""]
    lines = [f"{safe(found.name)}", f"  {safe(found.title)}", f"  {safe(', '.join(k for k in kinds if k))}"]
    lines += [f"  {safe(line, 10_000)}" for line in first.changes]
    lines += [f"  {safe(command, 10_000)}" for _, command in first.commands]
    if found.count > 1:
        others = [*found.others, *found.more]
        lines.append(f"  the same story: {safe(', '.join(others), 10_000)}")
    return lines + [f"  {safe(note)}" for note in first.missing]


def as_dict(contents: Contents) -> dict[str, Any]:
    """Return what `foresee report --format json` prints."""
    return {
        "headline": contents.headline,
        "notes": list(contents.notes),
        "findings": [
            {
                "name": found.name,
                "sentence": found.title,
                "class": found.class_,
                "verdict": found.verdict,
                "family": found.family,
                "driver": found.driver,
                "preventability": found.preventability,
                "test_case": found.test_case,
                "runs": [_run(run) for run in found.runs],
                "more": list(found.more),
            }
            for found in contents.findings
        ],
    }


def _run(run: Run) -> dict[str, Any]:
    return {
        "name": run.outcome.name,
        "file": run.outcome.address,
        "verdict": run.outcome.verdict,
        "reason": run.outcome.reason,
        "sentence": run.title,
        "moments": [{"time_s": round(m.time_s, 2), "actor": m.actor, "kind": m.kind, "text": m.text}
                    for m in run.moments],
        "changes": list(run.changes),
        "unreduced": list(run.unreduced),
        "why": run.outcome.preventability.why if run.outcome.preventability else None,
        "commands": [command for _, command in run.commands],
        "missing": list(run.missing),
    }  # fmt: skip
