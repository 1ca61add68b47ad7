"""The findings of a report as lines for a terminal."""

from __future__ import annotations

from foresee_dsl.avoidance.judge import ANTICIPATING, R157
from foresee_dsl.report.page.contents import Contents
from foresee_dsl.report.page.entries import FindingEntry
from foresee_dsl.report.safe_text import safe


def as_text(contents: Contents) -> str:
    """Return the headline and a paragraph for each finding: its story, its changes, and the command that runs it."""
    blocks = ["\n".join([safe(contents.headline), safe(contents.subtitle), *map(safe, contents.notes)])]
    blocks += ["\n".join(_lines(finding)) for finding in contents.findings]
    return "\n\n".join(blocks) + "\n"


def _lines(finding: FindingEntry) -> list[str]:
    first = finding.runs[0]
    answers = [
        f"{R157}: {finding.preventability}" if finding.preventability else "",
        f"{ANTICIPATING}: {finding.anticipation}" if finding.anticipation else "",
    ]
    kinds = [
        f"fails in {finding.rate} runs" if finding.rate else finding.verdict,
        finding.class_,
        *answers,
        f"family {finding.family}" if finding.family else "",
    ]
    lines = [f"{safe(finding.name)}", f"  {safe(finding.title)}", f"  {safe(', '.join(k for k in kinds if k))}"]
    lines += [f"  {safe(finding.standing)}"] if finding.standing else []
    lines += [f"  {safe(line, 10_000)}" for line in first.changes]
    lines += [f"  {finding.sure.failed} of {finding.sure.seeds} sensor seeds fail"] if finding.sure else []
    lines += [f"  {safe(command, 10_000)}" for _, command in first.commands]
    if finding.count > 1:
        others = [*finding.others, *finding.more]
        lines.append(f"  the same story: {safe(', '.join(others), 10_000)}")
    return lines + [f"  {safe(note)}" for note in first.missing]
