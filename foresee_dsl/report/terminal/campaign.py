"""The terminal report of a campaign: a block for each finding, then what broke; without either, the nearest misses."""

from __future__ import annotations

import io
import math
import os
import shlex
from collections import Counter
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from foresee_dsl.avoidance.judge import R157
from foresee_dsl.avoidance.judges import AnyJudgement
from foresee_dsl.avoidance.r157.assessing import Preventability, Preventable
from foresee_dsl.campaign.findings.grouping import Finding
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome
from foresee_dsl.campaign.results import CampaignResult, is_problem
from foresee_dsl.files import write_whole
from foresee_dsl.report.safe_text import safe
from foresee_dsl.report.terminal.raw_numbers import raw_numbers
from foresee_dsl.report.terminal.tables import duration
from foresee_dsl.report.verdicts import WHOLE, changed_lines, counted, verdicts_line, without_verdict
from foresee_dsl.simulate.results.near_misses import NearMisses
from foresee_dsl.simulate.results.verdict import Verdict

SHOWN = 30
"""Maximum number of findings that are printed. Ours: three screens; the page and `campaign.json` have all."""
NEAREST = 5
"""Maximum number of near misses that are printed."""
NAMED = 5
"""Maximum number of test cases that are named if many broke in the same way."""


def save_campaign(file: Path, result: CampaignResult, out: Path, *, raw: bool = True) -> None:
    """Write the report to a file, as an SVG picture, HTML or plain text according to the file's suffix."""
    console = Console(record=True, width=100, file=io.StringIO(), highlight=False)
    print_campaign(console, result, out, raw=raw)
    texts = {
        ".svg": lambda: console.export_svg(title="foresee campaign"),
        ".html": lambda: console.export_html(inline_styles=True),
    }
    write_whole(file, texts.get(file.suffix, console.export_text)())


def print_campaign(console: Console, result: CampaignResult, out: Path, *, raw: bool = False) -> None:
    """Print the report of a campaign: headline, findings, what broke; with `raw` also the raw numbers.

    Each path is on a line of its own, which is never wrapped.
    """
    findings = sorted(result.findings, key=_triage)
    console.print()
    for line in _headline(result, findings):
        console.print(line)
    for number, finding in enumerate(findings[:SHOWN], start=1):
        console.print()
        _print_finding(console, number, finding, out)
    if len(findings) > SHOWN:
        console.print(
            f"\n... and {counted(len(findings) - SHOWN, 'more finding')}: campaign.json and the page have all"
        )
    _print_others(console, result, findings, out)
    _print_broken(console, result)
    _print_breaking(console, result)
    notes = [seed.notes for seed in result.seeds]
    notes += [clip.notes for clip in result.clips]
    notes += [child.notes for clip in result.clips for child in clip.children]
    for changed in changed_lines(notes):
        console.print(_indented(Text(changed, style="yellow")))
    if not result.failed and not result.broken:
        _print_nearest(console, result, out)
    if raw:
        console.print()
        for part in raw_numbers(result):
            console.print(part)
    if result.interrupted:
        console.print()
        console.print(Text(f"Interrupted: what was finished is kept in {safe(out, WHOLE)}.", style="yellow"))


def _triage(finding: Finding) -> tuple[int, int, str]:
    """Return the sort key of findings: avoidable, undecided, unavoidable; within these, many failures first."""
    answer = finding.preventability.verdict if finding.preventability else Preventable.UNKNOWN
    order = 0 if finding.avoidable else 2 if answer is Preventable.NO else 1
    return order, -finding.count, finding.name


def _headline(result: CampaignResult, findings: list[Finding]) -> Iterator[Text]:
    settings, total = result.settings, result.row()
    failing = sum(finding.count for finding in findings)
    bad = any(_triage(finding)[0] == 0 for finding in findings)
    if findings:
        text = Text(f"{counted(len(findings), 'finding')} from {counted(failing, 'failure')}", style="bold red")
        for name, counts in _answers(findings):
            text.append(f"; {name}: {counts}", "bold red" if bad else "bold")
        avoided = [finding.avoided for finding in findings if finding.avoided is not None]
        if avoided:
            text.append(f"; {sum(map(bool, avoided))} of {len(avoided)} avoided by another driver", "bold")
        yield text
    elif total.failed:
        yield Text(f"{counted(total.failed, 'failure')}", style="bold red")
    elif not result.failed and not result.broken:
        yield Text("no failures", style="bold green")
    if result.broken:
        yield Text(f"{counted(len(result.broken), 'step')} could not be done", style="bold red")
    failed = [seed for seed in result.seeds if not seed.passed]
    breaking = sum(map(_passed, failed))
    yield verdicts_line([s.verdict for s in result.seeds], [s.reason for s in failed], breaking=breaking)
    children = [child for clip in result.clips for child in clip.children]
    if children:
        notes = [child.reason for child in children if _broke(child)]
        more = f", {len(notes)} broke the driver" if notes else ""
        of = "1 mutated child" if len(children) == 1 else f"{len(children)} mutated children"
        yield Text(f"{total.failed} of {of} failed{more}", style="bold red" if total.failed or notes else "")
    if settings.allocation == "adaptive" and children:
        yield Text(_allocated(result))
    length = settings.before_s + settings.after_s
    yield Text(
        f"driver {safe(settings.driver)}, ranker {settings.ranker}, preset {settings.preset}, clips of {length:g} s, "
        f"{counted(settings.risky_points, 'risky point')} x {settings.children} children, seed {settings.seed}; "
        f"{counted(total.clips, 'clip')}, {duration(result.wall_s)}",
        style="dim",
    )


def _answers(findings: list[Finding]) -> Iterator[tuple[str, str]]:
    """Yield each judge's name with the counts of its answers."""
    by_name: dict[str, list[AnyJudgement]] = {}
    for judgement in (judgement for finding in findings for judgement in finding.judgements):
        by_name.setdefault(judgement.name, []).append(judgement)
    for name, judgements in by_name.items():
        counts = Counter(str(judgement.answer) for judgement in judgements)
        order = dict.fromkeys((*judgements[0].answers, *counts))
        yield name, ", ".join(f"{counts[answer]} {answer}" for answer in order if counts[answer])


def _allocated(result: CampaignResult) -> str:
    """Return in words how many children the mutated clips got, and how many children were drawn near another."""
    clips = [clip for clip in result.clips if clip.children]
    counts = Counter(len(clip.children) for clip in clips)
    allocation = ", ".join(
        f"{count} to {counted(clips, 'clip')}" for count, clips in sorted(counts.items(), reverse=True)
    )
    near = sum(bool(child.drawn_near) for clip in clips for child in clip.children)
    return f"adaptive allocation of mutants: {allocation}; {near} vary an earlier mutant"


def _print_finding(console: Console, number: int, finding: Finding, out: Path) -> None:
    siblings = f"; {counted(len(finding.siblings), 'sibling')}" if finding.siblings else ""
    console.print(_indented(Text(safe(finding.story.sentence, WHOLE), style="bold"), f"{number:>3} "))
    console.print(_indented(Text(f"{finding.verdict.value}, {finding.story.contact.value}{siblings}")))
    for judgement in finding.judgements:
        words = f"{judgement.name}: ", (str(judgement.answer), "bold"), f": {safe(judgement.why, WHOLE)}"
        console.print(_indented(Text.assemble(*words)))
    if finding.references:
        console.print(_indented(Text(_who_avoids(finding))))
    _print_path(console, "    ", file_of(finding, out))


def _who_avoids(finding: Finding) -> str:
    """Return in words which other drivers avoid the failure of the finding's run, and how."""
    runs = finding.references
    avoiding = [run.sentence for run in runs if run.passes]
    if not avoiding:
        others = f"; {counted(finding.avoided, 'sibling')} avoided" if finding.avoided else ""
        return f"fails with {', '.join(run.driver for run in runs)} too{others}"
    return f"avoided: {'; '.join(avoiding)}"


def file_of(finding: Finding, out: Path) -> Path | str:
    """Return the file of a finding's run; for a test case its address."""
    if isinstance(finding.representative, CaseRunOutcome):
        return finding.file
    return out / finding.run_file


def _print_others(console: Console, result: CampaignResult, findings: list[Finding], out: Path) -> None:
    """Print failures without a story, which only results of older versions hold."""
    listed = {name for finding in findings for name in (finding.name, *finding.siblings)}
    children = (child for child in result.to_open_first(SHOWN) if child.name not in listed)
    others: list[tuple[str, Preventability | None, Path | str]] = [
        *((child.reason, child.preventability, out / child.file) for child in children),
        *((s.reason, s.preventability, s.id) for s in result.seeds if s.verdict.is_failure and s.story is None),
    ]
    for reason, preventability, path in others:
        console.print()
        console.print(_indented(Text(safe(reason, WHOLE))))
        if preventability is not None:
            console.print(_indented(Text(f"{R157}: {preventability.verdict.value}: {safe(preventability.why, WHOLE)}")))
        _print_path(console, "    ", path)


def _print_broken(console: Console, result: CampaignResult) -> None:
    """Print runs that neither passed nor failed by their driving: crashes, hangs, late and invalid runs."""
    driver = shlex.quote(result.settings.driver)
    cases = [seed for seed in result.seeds if not _passed(seed) and not seed.verdict.is_failure]
    if cases:
        console.print(Text("\nTest cases that broke or did not arrive (nothing was derived from them):", style="bold"))
    for verdict, reason in dict.fromkeys((seed.verdict, seed.reason) for seed in cases):
        names = [seed.id for seed in cases if (seed.verdict, seed.reason) == (verdict, reason)]
        console.print(_indented(Text(f"{verdict.value}: {safe(without_verdict(verdict, reason), WHOLE)}")))
        for name in names[:NAMED]:
            _print_path(console, "      ", name)
        if len(names) > NAMED:
            console.print(f"      ... and {len(names) - NAMED} more")
        if verdict is Verdict.CRASH:
            _print_path(console, "      more: ", f"foresee run {shlex.quote(names[0])} --driver {driver}")
    broke = [child for clip in result.clips for child in clip.children if _broke(child)]
    if broke:
        console.print(Text(f"\nChildren that broke the driver ({len(broke)}):", style="bold"))
    for reason in dict.fromkeys(child.reason for child in broke):
        names = [child.name for child in broke if child.reason == reason]
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        console.print(_indented(Text(f"{safe(reason, WHOLE)}: {names[0]}{more}")))
    for what in result.broken:
        console.print(_indented(Text(f"could not be done: {safe(what, WHOLE)}", style="red")))


def _print_breaking(console: Console, result: CampaignResult) -> None:
    """Print the broken expectations of runs with the verdict `pass`, each with these runs."""
    names: dict[str, list[str]] = {}
    for run in result.breaking:
        for sentence in run.broken_expectations:
            names.setdefault(sentence, []).append(run.id if isinstance(run, CaseRunOutcome) else run.name)
    if names:
        runs = counted(len(result.breaking), "run")
        console.print(Text(f"\nExpectations that do not hold, in {runs} without another failure:", style="bold"))
    for sentence, of in names.items():
        console.print(_indented(Text(safe(sentence, WHOLE))))
        for name in of[:NAMED]:
            _print_path(console, "      ", name)
        if len(of) > NAMED:
            console.print(f"      ... and {len(of) - NAMED} more")


def _print_nearest(console: Console, result: CampaignResult, out: Path) -> None:
    """Print the runs that came nearest to a failure, and what to try next."""
    runs: list[tuple[float, str, str]] = [
        (*_nearest(seed.near), seed.id) for seed in result.seeds if seed.near is not None and _passed(seed)
    ]
    for clip in result.clips:
        runs += [
            (*_nearest(child.near), f"{child.name} (mutant of {clip.seed})")
            for child in clip.children
            if child.near is not None and child.verdict is Verdict.PASS
        ]
    nearest = sorted(run for run in runs if math.isfinite(run[0]))[:NEAREST]
    if nearest:
        console.print(Text("\nThe nearest misses:", style="bold"))
    for _, how, name in nearest:
        _print_path(console, "    ", f"{how}  {name}")
    settings = result.settings
    paths = sorted({seed.id.partition("::")[0] for seed in result.seeds})
    if not paths:
        return
    folder = os.path.commonpath([Path(path).parent for path in paths]) or "."
    named = shlex.join(paths) if len(paths) <= 3 else shlex.quote(folder)
    chosen = "".join(
        f" --{field.name.removesuffix('_s').replace('_', '-')} {getattr(settings, field.name):g}"
        for field in fields(settings)
        if field.name in ("before_s", "after_s", "handover_s", "seed")
        and getattr(settings, field.name) != field.default
    )
    again = f"foresee campaign {named} --driver {shlex.quote(settings.driver)} --out {shlex.quote(str(out))}{chosen}"
    console.print(Text("\nWhat to try next (what is known is not run again):", style="bold"))
    ranker = "exhaustive" if settings.ranker != "exhaustive" else "foresee"
    preset = "paper" if settings.preset != "paper" else "focused"
    for why, more in (
        (
            "more points, more children",
            f"--risky-points {2 * settings.risky_points} --children {2 * settings.children}",
        ),
        ("other moments", f"--ranker {ranker}"),
        ("other mutations", f"--preset {preset} --repeat 2"),
    ):
        _print_path(console, "    ", f"{again} {more}   # {why}")


def _nearest(near: NearMisses) -> tuple[float, str]:
    """Return the smallest gap of a run, m, and the gap and time to collision in words."""
    ttc, gap = near.ttc_s, near.distance_m
    if gap is None:
        return math.inf, ""
    words = f"{gap.value:.2f} m from {safe(gap.actor)} at {gap.time_s:.2f} s"
    return gap.value, words + (f", time to collision {ttc.value:.2f} s" if ttc is not None else "")


def _passed(seed: CaseRunOutcome) -> bool:
    return seed.verdict is Verdict.PASS


def _broke(child: ChildOutcome) -> bool:
    return is_problem(child.verdict, child.notes) and not child.verdict.is_failure


def _indented(text: Text, first: str = "    ") -> Table:
    """Return a text whose second and later lines, on a narrow terminal, begin below its first word."""
    grid = Table.grid()
    grid.add_column(width=len(first), no_wrap=True, style="dim")
    grid.add_column(overflow="fold")
    grid.add_row(first, text)
    return grid


def _print_path(console: Console, before: str, path: Path | str) -> None:
    console.print(Text.assemble(before, (safe(path, WHOLE), "cyan")), soft_wrap=True)
