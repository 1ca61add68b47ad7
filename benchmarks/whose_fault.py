"""Whose fault is it? What both careful drivers answer about a campaign's failures, against who avoids them.

    python -m benchmarks.whose_fault out/campaign.json        # or its folder; several are taken together

prints, as Markdown, how often each model's answer meets a reference driver that avoids the failure (and passes the clip
before the mutation), how well each predicts that, and every contradiction: avoided by a reference, and not preventable
for the anticipating driver; or the other way round.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from foresee_dsl.avoidance.anticipating import Answer
from foresee_dsl.avoidance.r157.assessing import Preventable

_COLUMNS = ("avoided", "not avoided", "not driven")


@dataclass(frozen=True)
class Failure:
    """One failing child or test case, as `campaign.json` has it.

    Attributes:
        r157, anticipating: the answers; "" where a model was not asked. why: the anticipating driver's.
        avoided_by: the reference drivers that show it could be avoided. driven: whether any was asked.
        runs: how many runs the anticipating driver's answer took.
    """

    name: str
    family: str
    verdict: str
    r157: str
    anticipating: str
    why: str
    avoided_by: tuple[str, ...]
    driven: bool
    runs: int

    @property
    def column(self) -> str:
        """What the reference drivers say."""
        return _COLUMNS[2] if not self.driven else _COLUMNS[0] if self.avoided_by else _COLUMNS[1]


def failures_of(campaign: dict[str, Any]) -> Iterator[Failure]:
    """Yield the failures of a campaign's document."""
    families = {case["test_case"]: case.get("family", "") for case in campaign["test_cases"]}
    for case in campaign["test_cases"]:
        if case.get("story") is not None:
            yield _failure(case["test_case"], case.get("family", ""), case)
    for clip in campaign["clip_runs"]:
        for child in clip["children"]:
            if child.get("story") is not None:
                yield _failure(child["mutant"], families.get(clip["test_case"], ""), child)


def _failure(name: str, family: str, run: dict[str, Any]) -> Failure:
    r157, ahead = run.get("preventability") or {}, run.get("anticipation") or {}
    references = run.get("references", [])
    shows = tuple(r["driver"] for r in references if r["avoids"] and r.get("before_mutation") in (None, "pass"))
    return Failure(
        name, family, run["verdict"], r157.get("verdict", ""), ahead.get("answer", ""), ahead.get("why", ""), shows,
        bool(references), int(ahead.get("runs", 0)),
    )  # fmt: skip


def matrix(failures: Sequence[Failure]) -> Iterator[str]:
    """Yield the tables, a line each."""
    yield f"{len(failures)} failures"
    yield ""
    for title, answers, of in (
        ("R157's driver", [str(answer.value) for answer in Preventable], lambda f: f.r157),
        ("an anticipating driver", [str(answer.value) for answer in Answer], lambda f: f.anticipating),
    ):
        counts = Counter((of(failure), failure.column) for failure in failures)
        shown = [column for column in _COLUMNS if any(f.column == column for f in failures)]
        rows = [(answer, *(str(counts[answer, column]) for column in shown)) for answer in (*answers, "")]
        yield from _table((title, *shown), [row for row in rows if row[0] or any(n != "0" for n in row[1:])])
        yield ""
    both = Counter((failure.r157, failure.anticipating) for failure in failures)
    names = [str(answer.value) for answer in Answer]
    yield from _table(
        ("R157's driver, and the anticipating driver", *names),
        [(str(a.value), *(str(both[a.value, name]) for name in names)) for a in Preventable],
    )
    yield ""
    driven = [failure for failure in failures if failure.driven]
    if driven:
        yield from _table(("verdict", "balanced accuracy for *avoided by a reference*"), [
            ("R157's driver: preventable", _accuracy(driven, {Preventable.YES.value}, lambda f: f.r157)),
            ("an anticipating driver: preventable",
             _accuracy(driven, {a.value for a in Answer if a.preventable}, lambda f: f.anticipating)),
        ])  # fmt: skip
        yield ""
    asked = [failure.runs for failure in failures if failure.anticipating]
    if asked:
        yield f"{sum(asked) / len(asked):.1f} runs a failure, {max(asked)} at most"


def contradictions(failures: Iterable[Failure]) -> Iterator[str]:
    """Yield the failures over which the anticipating driver and the reference drivers disagree."""
    able = {answer.value for answer in Answer if answer.preventable}
    rows = [
        (f.name, f.family, f.verdict, f.r157, f.anticipating, ", ".join(f.avoided_by) or "nobody", f.why)
        for f in failures
        if f.driven and (f.anticipating in able) != bool(f.avoided_by)
    ]
    yield from _table(("failure", "family", "kind", "R157", "anticipating", "avoided by", "why"), rows)


def _accuracy(failures: Sequence[Failure], positive: set[str], of: Callable[[Failure], str]) -> str:
    """Return the mean of the shares that are right among the avoided and among the others."""
    shares = []
    for avoided in (True, False):
        group = [failure for failure in failures if bool(failure.avoided_by) == avoided]
        if not group:
            return "one kind only"
        shares.append(sum((of(failure) in positive) == avoided for failure in group) / len(group))
    return f"{sum(shares) / 2:.0%}"


def _table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    yield f"| {' | '.join(headings)} |"
    yield f"|{' --- |' * len(headings)}"
    for row in rows:
        yield f"| {' | '.join(cell.replace('|', '/') for cell in row)} |"


def read(paths: Iterable[Path]) -> list[Failure]:
    """Return the failures of finished campaigns: files, or folders with a `campaign.json`."""
    files = (path / "campaign.json" if path.is_dir() else path for path in paths)
    return [failure for file in files for failure in failures_of(json.loads(file.read_text(encoding="utf-8")))]


def main(arguments: Sequence[str]) -> int:
    """Print the matrix and the contradictions of the campaigns named."""
    if not arguments:
        sys.stderr.write("name a finished campaign's folder: python -m benchmarks.whose_fault out\n")
        return 2
    found = read(map(Path, arguments))
    Console(soft_wrap=True, highlight=False, markup=False).print(
        "\n".join((*matrix(found), "", "## Contradictions", "", *contradictions(found)))
    )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
