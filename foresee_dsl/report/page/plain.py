"""A report's findings as lines for a terminal."""

from __future__ import annotations

from foresee_dsl.avoidance.judge import ANTICIPATING, R157
from foresee_dsl.report.page.contents import Contents
from foresee_dsl.report.page.entries import Found
from foresee_dsl.report.safe_text import safe


def as_text(contents: Contents) -> str:
    """Return the headline, and a paragraph for each finding: what happened, what was changed, how to run it."""
    blocks = ["\n".join([safe(contents.headline), safe(contents.subtitle), *map(safe, contents.notes)])]
    blocks += ["\n".join(_lines(found)) for found in contents.findings]
    return "\n\n".join(blocks) + "\n"


def _lines(found: Found) -> list[str]:
    first = found.runs[0]
    answers = [
        f"{R157}: {found.preventability}" if found.preventability else "",
        f"{ANTICIPATING}: {found.anticipation}" if found.anticipation else "",
    ]
    kinds = [found.verdict, found.class_, *answers, f"family {found.family}" if found.family else ""]
    lines = [f"{safe(found.name)}", f"  {safe(found.title)}", f"  {safe(', '.join(k for k in kinds if k))}"]
    lines += [f"  {safe(line, 10_000)}" for line in first.changes]
    lines += [f"  {safe(command, 10_000)}" for _, command in first.commands]
    if found.count > 1:
        others = [*found.others, *found.more]
        lines.append(f"  the same story: {safe(', '.join(others), 10_000)}")
    return lines + [f"  {safe(note)}" for note in first.missing]
