"""One failure as text of at most 80 columns: its review, with its boundary as a scale; how sure it is; and which part
of the driver causes it."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from math import isfinite

from foresee_dsl.avoidance.causes import Diagnosis, IdealRun
from foresee_dsl.campaign.findings.diagnosing import DiagnosedFailure
from foresee_dsl.campaign.findings.review import Review
from foresee_dsl.campaign.findings.sureness import HeatMap, Sureness
from foresee_dsl.campaign.records import ChildOutcome, WrittenMinimised
from foresee_dsl.derive.minimise.outcome import Boundary
from foresee_dsl.report.safe_text import COLUMNS, safe
from foresee_dsl.simulate.results.verdict import Verdict

_SCALE = 50
"""Width of a scale, columns: one for each hundredth of a change of 0.5, which is a usual size."""
_SIBLINGS = 5
"""Maximum number of other failures that are listed. Ours: they take two or three lines; `--json` has all of them."""
_LONGEST = 5000
"""Maximum length of a path or a command, characters. Nothing of this length is cut in practice."""
_MARKS = {"passes": "o", "otherwise": "x", "fails": "X"}
_MARGINS = {
    "distance_m": "{:.2f} m to {}",
    "ttc_s": "time to collision {:.2f} s with {}",
    "pet_s": "{:.2f} s between the ego and {}",
    "drac_mps2": "{:.1f} m/s^2 of braking for {}",
}


def review_text(review: Review) -> str:
    """Return a review as text for people."""
    return "\n".join(_review_lines(review)) + "\n"


def _review_lines(review: Review) -> Iterator[str]:
    finding = review.finding
    small, judgement = finding.minimised, finding.judgement
    yield from wrapped(f"{finding.number}. {finding.title}")
    yield safe(finding.name)
    yield from wrapped(f"{finding.verdict}, {finding.class_}")
    if judgement is not None:
        yield from wrapped(f"Judgement: {judgement.sentence}")
    if review.standing:
        yield from wrapped(f"History: {review.standing}")
    yield ""
    yield from wrapped((small.sentence if small is not None else "") or finding.sentence)
    if review.asked != finding.name:
        yield from ("", *wrapped(f"{review.asked} is one of the {finding.count} failures of this finding."))
    elif finding.count > 1:
        names, more = finding.siblings[:_SIBLINGS], len(finding.siblings) - _SIBLINGS
        listed = ", ".join(names) + (f" and {more} more" if more > 0 else "")
        yield from ("", *wrapped(f"It stands for {finding.count} failures, also for {listed}."))
    if review.why:
        yield from ("", *wrapped(f"Why its mutant was made: {review.why}"))
    if finding.clip:
        yield from _difference(small)
        yield from _boundary(small.boundary if small is not None else ())
        yield from _others(review.others)
    if finding.judgements:
        yield from ("", "Would a careful driver have avoided it?")
    for answer in finding.judgements:
        yield from wrapped(f"{answer.name}: {answer.answer}: {answer.why}", "  ")
    if finding.references:
        yield from ("", "Do other drivers avoid it?")
    for run in finding.references:
        how = ", ".join(run.how) or "it drives nearly the same way"
        no = f"not comparable, {run.apart or 'it fails before the mutation'}" if run.passes else f"no, {run.reason}"
        yield from wrapped(f"{run.driver}: {f'yes, {how}' if run.avoids else no}", "  ")
    yield from _cause_and_sureness(review)
    yield from ("", "Files")
    yield from _files(review)
    yield from ("", "Commands")
    for words, command in review.commands:
        yield from (f"  {words}:", f"    {safe(command, _LONGEST)}")


def _cause_and_sureness(review: Review) -> Iterator[str]:
    if review.diagnosis:
        yield from ("", "Which part of the driver causes it?", *wrapped(review.diagnosis, "  "))
    if review.sure is not None:
        yield from ("", "How sure is it?")
        yield from wrapped(f"{review.sure.failed} of {review.sure.seeds} sensor seeds fail", "  ")
        for edge in review.sure.edges:
            yield from wrapped(edge.text, "  ", more="  ")


def _difference(small: WrittenMinimised | None) -> Iterator[str]:
    yield from ("", "Difference")
    if small is None:
        yield from wrapped("not minimised yet: the campaign's command, once more, does that", "  ")
        return
    for change in small.changed:
        yield from wrapped(f"change {change}", "  ")
    counts = ((small.changes, "changes"), (small.actors, "actors"), (small.clip_lines, "lines of the clip"))
    parts = [f"{words} {count.before} -> {count.now}" for count, words in counts]
    shorter = small.dropped.seconds
    yield from wrapped("minimised: " + ", ".join([*parts, *([f"{shorter:.2f} s shorter"] if shorter else [])]), "  ")
    if small.note:
        yield from wrapped(small.note, "  ")


def _boundary(edges: Sequence[Boundary]) -> Iterator[str]:
    if not edges:
        return
    yield from ("", "Boundary (o passes, X this failure, x another failure)")
    for edge in edges:
        yield f"  {safe(edge.change)}"
        yield f"  {safe(edge.text(edge.was)):>9} {_scale(edge)} {safe(edge.text(edge.first))}"
        yield from wrapped(edge.sentence.removeprefix(f"{edge.change} "), " " * 12)


def _scale(edge: Boundary) -> str:
    """Return a line of marks, one for each value that was run, from the unmutated value to the mutated one."""
    marks, span = ["-"] * _SCALE, edge.first - edge.was
    order = list(_MARKS)
    # Failures are drawn last, so that they replace a pass at the same place.
    for run in sorted(edge.tried, key=lambda run: order.index(run.ended)):
        place = (run.value - edge.was) / span if span else 0.0
        if 0 <= place <= 1:
            marks[round(place * (_SCALE - 1))] = _MARKS[run.ended]
    return "".join(marks)


def _others(others: Iterable[ChildOutcome]) -> Iterator[str]:
    all_others = list(others)
    passed = [mutation for mutation in all_others if mutation.verdict is Verdict.PASS]
    yield from ("", f"Other mutations of the same clip: {len(passed)} of {len(all_others)} withstood")
    for mutation in all_others:
        changes = "; ".join(mutation.changes) or "?"
        yield from wrapped(f"{mutation.name.rpartition('_')[2]}: {changes}", "  ", more="    ")
        yield from wrapped(_margins(mutation) if mutation.verdict is Verdict.PASS else mutation.reason, "      ")


def _margins(mutation: ChildOutcome) -> str:
    near_misses = ((words, getattr(mutation.near, name, None)) for name, words in _MARGINS.items())
    texts = [words.format(near.value, near.actor) for words, near in near_misses if near and isfinite(near.value)]
    return "passed: " + (", ".join(texts) if texts else "no actor came near")


def _files(review: Review) -> Iterator[str]:
    finding, small = review.finding, review.finding.minimised
    if finding.clip is None:
        yield f"  {safe(finding.file, _LONGEST)}"
        return
    for words, file in (
        ("minimised", small.file if small else None),
        ("its clip", small.clip if small else None),
        ("as found", finding.file),
    ):
        if file is not None:
            yield f"  {words + ':':<11}{safe((review.campaign.folder / file).as_posix(), _LONGEST)}"
    yield f"  {'test case:':<11}{safe(finding.test_case, _LONGEST)}"


def wrapped(text: str, indent: str = "", *, more: str = "") -> list[str]:
    """Return text in lines of 80 columns with an indent; from the second line on, it is increased by `more`."""
    whole = " ".join(safe(text, _LONGEST).split())
    return textwrap.wrap(
        whole, COLUMNS, initial_indent=indent, subsequent_indent=indent + more, break_long_words=False,
        break_on_hyphens=False,
    ) or [indent]  # fmt: skip


_FAILS_MARKS = {True: "#", False: ".", None: " "}
"""Characters of the map: a run that fails, one that passes, and values that are not possible."""


def sureness_text(sure: Sureness) -> str:
    """Return how sure a failure is as text."""
    return "\n".join(_sureness_lines(sure)) + "\n"


def _sureness_lines(sure: Sureness) -> Iterator[str]:
    number = f"{sure.number}. " if sure.number else ""
    yield from wrapped(f"{number}{sure.name} with {sure.driver}: {sure.failed} of {sure.seeds} sensor seeds fail")
    if sure.note:
        yield from wrapped(sure.note, "  ")
    if sure.edges:
        yield from ("", "Boundary")
        for edge in sure.edges:
            yield from wrapped(edge.text, "  ", more="  ")
    if sure.map is not None:
        yield from ("", *_map_lines(sure.map))
    region = sure.region
    if region is not None:
        yield from ("", f"Failing region: {region.failed} of {region.drawn} cases drawn inside it fail")
        yield from (f"  {line}" for line in (*region.parameters, region.require))
        yield from map(str, region.files)


def _map_lines(heat_map: HeatMap) -> Iterator[str]:
    """Yield the map as characters, with the values at its sides."""
    yield f"{heat_map.across} across, {heat_map.down} down (# fails, . passes)"
    left = max(map(len, heat_map.rows))
    for name, row in zip(heat_map.rows, heat_map.fails, strict=True):
        yield f"  {name:>{left}}  " + " ".join(_FAILS_MARKS[fails] * 2 for fails in row)
    first, last = heat_map.columns[0], heat_map.columns[-1]
    room = 3 * len(heat_map.columns) - 1 - len(first)
    yield f"  {'':>{left}}  {first}{last:>{max(room, len(last) + 1)}}"


_NONE = "no part (planning, or a situation that comes too late)"
_ELSEWHERE = (
    "Passes elsewhere: the ego no longer comes into the situation in which it failed. That may be because of the part, "
    "or luck."
)
_PARTS = 22
"""Width of the column with the parts' names, columns."""


def diagnosis_text(result: DiagnosedFailure, *, short: bool = False) -> str:
    """Return a diagnosis as text; `short`: without the table of runs."""
    return "\n".join(_diagnosis_lines(result, short=short)) + "\n"


def _diagnosis_lines(result: DiagnosedFailure, *, short: bool) -> Iterator[str]:
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
