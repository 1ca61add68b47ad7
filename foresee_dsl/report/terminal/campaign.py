"""The terminal report of a campaign on one screen: its findings, failed steps, the commands to type next, and the
summary.
"""

from __future__ import annotations

import io
import math
import os
import shlex
import textwrap
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

from rich.console import Console
from rich.text import Text

from foresee_dsl.avoidance.responsibility import FOLDED, Whose
from foresee_dsl.campaign.campaign_file import NOBODY
from foresee_dsl.campaign.goal import GoalCounts
from foresee_dsl.campaign.grouping import Finding
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome
from foresee_dsl.campaign.results import CampaignResult, is_problem
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.triage.standing import Standing, standing_of
from foresee_dsl.campaign.written import WrittenCampaign
from foresee_dsl.derive.presets import preset
from foresee_dsl.drivers.registry import reference_drivers
from foresee_dsl.files import write_whole
from foresee_dsl.language.campaign_values import DEFAULT_CHILDREN
from foresee_dsl.report.safe_text import counted, safe
from foresee_dsl.report.terminal.findings_table import FindingRow, table_lines
from foresee_dsl.report.terminal.raw_numbers import raw_numbers
from foresee_dsl.report.terminal.tables import duration
from foresee_dsl.report.verdicts import (
    WHOLE,
    changed_lines,
    not_deterministic,
    unused_clips,
    verdicts_line,
    without_verdict,
)
from foresee_dsl.simulate.results.near_misses import NearMisses
from foresee_dsl.simulate.results.verdict import Verdict, without_measured

SCREEN_LINES, RESERVED_LINES = 40, 4
"""Number of lines of a screen, and number of these lines that the command needs after the report (for the page, and for
notes on the store). Ours: terminals are opened with 40 lines today."""
PIPE_COLUMNS, WIDEST_COLUMNS = 80, 500
"""Columns of the table when the output is not a terminal, and columns from which a console is taken as one that wraps
no lines. Ours: logs of builds and mails are read at 80 columns."""
LEAST_LINES = 14
"""Number of lines that the table of findings has even if many runs broke and need lines of the screen."""
NEAREST = 5
"""Maximum number of near misses that are printed."""
NAMED = 3
"""Maximum number of test cases, reasons or expectations that are named. Ours: there is no room for more on the
screen."""


def save_campaign(file: Path, result: CampaignResult, out: Path, store: Path | None = None) -> None:
    """Write the report to a file, as an SVG picture, HTML or plain text according to the file's suffix."""
    console = Console(record=True, width=100, file=io.StringIO(), highlight=False)
    print_campaign(console, result, out, store, raw=True)
    texts = {
        ".svg": lambda: console.export_svg(title="foresee campaign"),
        ".html": lambda: console.export_html(inline_styles=True),
    }
    write_whole(file, texts.get(file.suffix, console.export_text)())


def print_campaign(
    console: Console, result: CampaignResult, out: Path, store: Path | None = None, *, raw: bool = False
) -> None:
    """Print the report of a campaign on one screen: findings, what broke, what to type next, the summary last.

    With `raw` also the raw numbers. `store`: the folder of the stored results, None for the one in `out`. Each path is
    on a line of its own, which is never wrapped.
    """
    standing, width = standing_of(result, out), _width(console)
    table = _Table.of(result.findings, standing, out)
    # A long table leaves room for only one example of what else went wrong.
    for named in (NAMED, 1):
        end = list(_end(result, table, standing, out, store, named))
        room = SCREEN_LINES - RESERVED_LINES - sum(_height(line, width) for line in end)
        lines, whole = table.lines(width, max(room, LEAST_LINES))
        if whole and len(lines) <= room:
            break
    console.print()
    for line in (*lines, *end):
        console.print(line, soft_wrap=True)
    if raw:
        console.print()
        for part in raw_numbers(result):
            console.print(part)


def _end(
    result: CampaignResult, table: _Table, standing: Standing, out: Path, store: Path | None, named: int
) -> Iterator[Text]:
    """Yield the lines after the table.

    `named`: maximum number of test cases, reasons or expectations that are named.
    """
    yield from _broken_lines(result, named)
    yield from _breaking_lines(result.breaking, named)
    yield from _others_lines(result, table.findings, out)
    yield from _changed_lines(result)
    if table.findings:
        yield from _next_lines(table.findings, out)
    if not result.failed and not result.broken:
        yield from _nearest_lines(result)
        if not result.interrupted:
            yield from _suggested_lines(result, out, store)
    yield Text()
    yield from _standing_lines(standing)
    yield from _summary(result, table.findings)
    if result.interrupted:
        words = f"The campaign was interrupted; the finished runs are kept in {safe(out, WHOLE)}."
        yield Text(words, style="yellow")


def print_findings(
    console: Console,
    campaign: WrittenCampaign,
    standing: Standing = Standing(),  # noqa: B008 - immutable
) -> None:
    """Print all findings of a written campaign in its order, one line each, including those that the report folds; then
    the runs that break only an expectation, which belong to no finding.
    """
    rows = []
    for finding in campaign.grouped:
        campaign.require(finding, "number", "judgement", "title")
        changes = finding.minimised.changed if finding.minimised is not None else None if finding.clip else ()
        rows.append(FindingRow.of(finding, standing, changes))
    for line in table_lines(rows, _width(console))[0]:
        console.print(line, soft_wrap=True)
    for text in _standing_lines(standing):
        console.print(text, soft_wrap=True)
    if rows:
        console.print(Text(f"foresee review 1{_in(campaign.folder)} shows one of them with its reasons.", style="dim"))
    else:
        console.print("no findings")
    for line in _breaking_lines(campaign.breaking, most=None):
        console.print(line, soft_wrap=True)


def _standing_lines(standing: Standing) -> Iterator[Text]:
    """Yield what is new, still there and gone since the campaign before, and decisions that match no finding."""
    for note in standing.notes:
        yield Text(safe(note), style="dim")


@dataclass(frozen=True)
class _Table:
    """The table of the findings that a reader acts on, with the number of the others.

    `unlisted`: how many findings have no row, and why. `all`: the command that lists all findings.
    """

    findings: Sequence[Finding]
    rows: Sequence[FindingRow]
    unlisted: str
    all: str

    @classmethod
    def of(cls, findings: Sequence[Finding], standing: Standing, out: Path) -> _Table:
        others = [finding for finding in findings if finding.story_key not in standing.decisions]
        rows = [
            FindingRow.of(f.written, standing, f.run.changes if isinstance(f.run, ChildOutcome) else ())
            for f in others
            if f.responsibility.whose not in FOLDED
        ]
        counts = Counter(finding.responsibility.whose for finding in others)
        kinds = [f"{counts[whose]} {whose.counted}" for whose in FOLDED if counts[whose]]
        unlisted = ", ".join([*kinds, *filter(None, [standing.triaged])])
        return cls(findings, rows, unlisted, f"foresee review{_in(out)}")

    def lines(self, width: int, room: int) -> tuple[list[Text], bool]:
        """Return at most `room` lines, and whether all rows are in them."""
        end = textwrap.wrap(f"not listed: {self.unlisted}", width - 5) if self.unlisted else []
        lines, count = table_lines(self.rows, width, room - len(end))
        whole = count == len(self.rows)
        if not whole:
            lines, count = table_lines(self.rows, width, room - len(end) - 1)
            lines.append(Text(f"     and {len(self.rows) - count} more: {self.all} lists all", style="dim"))
        return [*lines, *(Text(f"     {line}", style="dim") for line in end)], whole


def _width(console: Console) -> int:
    """Return the width of the table: the width of the console, or `PIPE_COLUMNS` if lines are not wrapped, as in a
    pipe.
    """
    return console.width if console.width <= WIDEST_COLUMNS else PIPE_COLUMNS


def _height(line: Text, width: int) -> int:
    return sum(max(1, math.ceil(part.cell_len / max(width, 1))) for part in line.split("\n", allow_blank=True))


def _in(out: Path) -> str:
    return "" if out == Path("out") else f" --campaign {shlex.quote(str(out))}"


def _next_lines(findings: Sequence[Finding], out: Path) -> Iterator[Text]:
    """Yield the commands that the user may type next."""
    first, where = findings[0].number, _in(out)
    commands = (
        (f"foresee show {first}{where}", "what happens, in pictures"),
        (f"foresee review {first}{where}", "why, and how near to passing"),
        (f"foresee keep {first}{where}", "make it a regression test"),
        (f"foresee review{where}", "list all findings"),
    )
    width = max(len(command) for command, _ in commands)
    yield Text("\nNext:", style="bold")
    for command, why in commands:
        yield Text.assemble("  ", (f"{safe(command, WHOLE):<{width}}", "cyan"), f"  {why}")


def _summary(result: CampaignResult, findings: Sequence[Finding]) -> Iterator[Text]:
    """Yield the counts: findings by their judgement, failed test cases and mutants, and the settings."""
    settings, total = result.settings, result.row()
    empty = bool(result.shard.text) and not (result.seeds or result.interrupted)
    if empty:
        yield Text(f"--shard {result.shard.text}: {result.shard.empty_text}", style="bold yellow")
    if result.goal is not None:
        yield Text(_goal_words(result.goal), style="bold red" if result.goal.children else "bold")
    if findings:
        failing = sum(finding.count for finding in findings)
        counts = Counter(finding.responsibility.whose for finding in findings)
        kinds = ", ".join(f"{counts[whose]} {whose.counted}" for whose in Whose if counts[whose])
        style = "bold red" if counts[Whose.DRIVER] else "bold"
        yield Text(f"{counted(len(findings), 'finding')} from {counted(failing, 'failure')}: {kinds}", style=style)
        if result.deterministic is False:
            yield Text(safe(not_deterministic(settings.driver, [finding.rate for finding in findings]), WHOLE),
                       style="bold yellow")  # fmt: skip
    elif total.failed:
        yield Text(f"{counted(total.failed, 'failure')}", style="bold red")
    elif not (result.failed or result.broken or empty):
        yield Text("no failures so far" if result.interrupted else "no failures", style="bold green")
    if result.broken:
        yield Text(f"{counted(len(result.broken), 'step')} could not be run", style="bold red")
    if not empty:
        yield verdicts_line(result.seeds)
    if cases := _without_clips(result):
        of = counted(len(result.seeds), "test case")
        yield Text(f"{len(cases)} of {of} without clips: no change there promises a failure that can be avoided")
    if children := result.children:
        notes = [child.reason for child in children if _broke(child)]
        more = f", {len(notes)} broke the driver" if notes else ""
        only = sum(child.verdict is Verdict.PASS and bool(child.broken_expectations) for child in children)
        more += f", {only} broke only an expectation" if only else ""
        of = "1 mutated child" if len(children) == 1 else f"{len(children)} mutated children"
        yield Text(f"{total.failed} of {of} failed{more}", style="bold red" if total.failed or notes or only else "")
    yield from map(Text, unused_clips(result.clips, settings))
    if settings.in_rounds and children:
        yield Text(_allocated(result))
    length = settings.before_s + settings.after_s
    yield Text(
        f"driver {safe(settings.driver)}, ranker {settings.ranker}, preset {settings.preset}, "
        f"clips of at most {length:g} s, {counted(settings.risky_points, 'risky point')} x "
        f"{counted(settings.children, 'child', 'children')}, {_seeds(settings)}"
        f"{f', shard {result.shard.text}' if result.shard.text else ''}; {counted(total.clips, 'clip')}, "
        f"{duration(result.wall_s)}",
        style="dim",
    )


def _seeds(settings: CampaignSettings) -> str:
    """Return, in words, the seeds with which clips are mutated, and whose failures are run first."""
    last = settings.seed + settings.repeat - 1
    seeds = f"seed {settings.seed}" if settings.repeat == 1 else f"seeds {settings.seed} to {last}"
    return f"{seeds}, first the failures of {safe(settings.first_from, WHOLE)}" if settings.first_from else seeds


def _without_clips(result: CampaignResult) -> list[CaseRunOutcome]:
    """Return the test cases that passed but of which no clip was cut, because the preset's search finds nothing."""
    if preset(result.settings.preset).search is None or result.interrupted:
        return []
    clipped = {clip.seed for clip in result.clips}
    return [case for case in result.seeds if _passed(case) and case.risky_points and case.id not in clipped]


def _goal_words(goal: GoalCounts) -> str:
    """Return, in words, how many runs break the goal, and how many failures keep it."""
    broken = [
        counted(goal.findings, "finding"),
        counted(goal.children, "child", "children"),
        *([counted(goal.test_cases, "unmutated test case")] if goal.test_cases else []),
    ]
    others = f"; {counted(goal.others, 'failing child keeps', 'failing children keep')} it" if goal.others else ""
    return f"goal {goal.name}: broken by {' and '.join([', '.join(broken[:-1]), broken[-1]])}{others}"


def _allocated(result: CampaignResult) -> str:
    """Return, in words, how many children the mutated clips got, and how many children vary an earlier one."""
    clips = [clip for clip in result.clips if clip.children]
    counts = Counter(len(clip.children) for clip in clips)
    allocation = ", ".join(
        f"{count} to {counted(clips, 'clip')}" for count, clips in sorted(counts.items(), reverse=True)
    )
    near = sum(bool(child.drawn_near) for child in result.children)
    return (
        f"{result.settings.allocation} allocation of mutants: {allocation}; {near} use the changes of an earlier mutant"
    )


def _others_lines(result: CampaignResult, findings: Sequence[Finding], out: Path) -> Iterator[Text]:
    """Yield failures without a story, which occur only in results of older versions."""
    listed = {name for finding in findings for name in (finding.name, *finding.siblings)}
    children = [child for child in result.to_open_first(len(listed) + NAMED) if child.name not in listed]
    others: list[tuple[str, Path | str]] = [
        *((s.reason, s.id) for s in result.seeds if s.verdict.is_failure and s.story is None),
        *((child.reason, out / child.file) for child in children),
    ]
    for reason, path in others[:NAMED]:
        yield Text(f"\n    {safe(reason, WHOLE)}")
        yield _path("    ", path)


def _broken_lines(result: CampaignResult, named: int) -> Iterator[Text]:
    """Yield runs that neither passed nor failed because of their driving: crashes, hangs, late and invalid runs."""
    driver = shlex.quote(result.settings.driver)
    cases = [seed for seed in result.seeds if not _passed(seed) and not seed.verdict.is_failure]
    if cases:
        yield Text("\nTest cases that broke or did not arrive (nothing was derived from them):", style="bold")
    reasons = list(dict.fromkeys((seed.verdict, seed.reason) for seed in cases))
    most = named if len(reasons) == 1 else 1
    for verdict, reason in reasons[:named]:
        names = [seed.id for seed in cases if (seed.verdict, seed.reason) == (verdict, reason)]
        yield Text(f"  {verdict.value}: {safe(without_verdict(verdict, reason), WHOLE)}")
        for name in names[:most]:
            yield _path("    ", name)
        if len(names) > most:
            yield Text(f"    ... and {len(names) - most} more")
        if verdict is Verdict.CRASH:
            yield _path("    more: ", f"foresee run {shlex.quote(names[0])} --driver {driver}")
    if len(reasons) > named:
        yield Text(f"  ... and {len(reasons) - named} other reasons: campaign.json has all")
    broke = [child for child in result.children if _broke(child)]
    if broke:
        yield Text(f"\nChildren that broke the driver ({len(broke)}):", style="bold")
    for reason in list(dict.fromkeys(child.reason for child in broke))[:named]:
        names = [child.name for child in broke if child.reason == reason]
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        yield Text(f"  {safe(reason, WHOLE)}: {names[0]}{more}")
    for what in result.broken[:named]:
        yield Text(f"   could not be run: {safe(what, WHOLE)}", style="red")


def _breaking_lines(
    breaking: Sequence[CaseRunOutcome | ChildOutcome], named: int | None = None, most: int | None = 1
) -> Iterator[Text]:
    """Yield the broken expectations of runs with the verdict `pass`, and the runs that break each of them.

    `named`, `most`: maximum numbers of expectations, and of runs of each, that are named; None: all.
    """
    measured: dict[str, dict[str, str]] = {}
    for run in breaking:
        name = run.id if isinstance(run, CaseRunOutcome) else run.name
        for sentence in run.broken_expectations:
            expectation = without_measured(sentence)
            measured.setdefault(expectation, {})[name] = sentence.removeprefix(expectation)
    if measured:
        runs = counted(len(breaking), "run")
        yield Text(f"\nExpectations that do not hold, in {runs} without another failure:", style="bold")
    entries = list(measured.items())[:named]
    for expectation, values in entries:
        yield Text(f"  {safe(expectation, WHOLE)}")
        for name, value in list(values.items())[:most]:
            yield _path("    ", name).append(safe(value, WHOLE))
        if most is not None and len(values) > most:
            yield Text(f"    ... and {counted(len(values) - most, 'more run')}")
    if more := len(measured) - len(entries):
        others = len(breaking) - len({name for _, values in entries for name in values})
        runs = f" in {counted(others, 'more run')}" if others else ""
        yield Text(f"  ... and {counted(more, 'more expectation')}{runs}: campaign.json has all")


def _changed_lines(result: CampaignResult) -> Iterator[Text]:
    """Yield the changes that the driver made to its process."""
    changed = changed_lines([run.notes for runs in (result.seeds, result.clips, result.children) for run in runs])
    for line in changed[:NAMED]:
        yield Text(f"  {line}", style="yellow")
    if len(changed) > NAMED:
        yield Text(f"  ... and {len(changed) - NAMED} more changes of the driver's process", style="yellow")


def _nearest_lines(result: CampaignResult) -> Iterator[Text]:
    """Yield the runs that came nearest to a failure."""
    runs: list[tuple[float, str, str]] = [(*_nearest(seed), seed.id) for seed in result.seeds if _passed(seed)]
    for clip in result.clips:
        runs += [
            (*_nearest(child), f"{child.name} (mutant of {clip.seed})")
            for child in clip.children
            if child.verdict is Verdict.PASS
        ]
    nearest = sorted(run for run in runs if math.isfinite(run[0]))[:NEAREST]
    if nearest:
        yield Text("\nThe nearest misses:", style="bold")
    for _, how, name in nearest:
        yield _path("    ", f"{how}  {name}")


def _suggested_lines(result: CampaignResult, out: Path, store: Path | None) -> Iterator[Text]:
    """Yield the commands to try next."""
    settings = result.settings
    cases = sorted({seed.id for seed in result.seeds})
    if not cases:
        return
    named = _paths_of(cases)
    elsewhere = store is not None and store != out / "store"
    shard = ["--shard", result.shard.text] if result.shard.text else []
    folders = ["--out", str(out), *(["--store", str(store)] if elsewhere else []), *shard]
    again = shlex.join(["foresee", "campaign", *named, "--driver", settings.driver, *folders])
    yield Text("\nWhat to try next (runs that are in the store are not repeated):", style="bold")
    ranker = "exhaustive" if settings.ranker != "exhaustive" else "foresee"
    mutations = "paper" if settings.preset != "paper" else "focused"
    nothing = bool(_without_clips(result))
    suggested: dict[str, dict[str, str | int]] = {}
    if nothing:
        suggested["also what no driver can avoid"] = {"preset": "focused"}
    if result.clips or not nothing:
        more = {"risky_points": 2 * settings.risky_points, "children": 2 * settings.children or 2 * DEFAULT_CHILDREN}
        suggested["more points, more children"] = dict(more)
    suggested["other moments"] = {"ranker": ranker}
    suggested["other mutations"] = {"preset": mutations, "repeat": 2}
    settings = replace(settings, children=settings.children or DEFAULT_CHILDREN)
    references = reference_drivers(settings.driver)
    for why, other in suggested.items():
        yield _path("    ", f"{again}{_options(settings, other, references)}   # {why}")


def _paths_of(cases: Sequence[str]) -> list[str]:
    """Return at most `_NAMED_CASES` paths that contain the test cases: as many of these themselves as there is room
    for, of the files with the fewest first; else their files, or else the one folder of these."""
    of_file: dict[str, list[str]] = {}
    for case in cases:
        of_file.setdefault(case.partition("::")[0], []).append(case)
    if len(of_file) > _NAMED_CASES:
        return [os.path.commonpath([Path(file).parent for file in of_file]) or "."]
    names = {file: [file] for file in of_file}
    for file, own in sorted(of_file.items(), key=lambda item: len(item[1])):
        if sum(map(len, names.values())) - 1 + len(own) <= _NAMED_CASES:
            names[file] = own
    return [name for file in sorted(names) for name in names[file]]


REPEATED = ("ranker", "preset", "before_s", "after_s", "handover_s", "seed", "allocation", "rules", "goal",
            "first_from", "against", "risky_points", "children", "repeat")  # fmt: skip
"""Settings that a suggested command repeats if they differ from their defaults. The driver is always named."""
_NAMED_CASES = 3
"""Maximum number of test cases, or of files, that a suggested command names one by one."""


def _options(settings: CampaignSettings, other: Mapping[str, str | int], references: tuple[str, ...]) -> str:
    """Return the options of a campaign with some `other` settings, each that differs from its default; the default of
    the reference drivers is `references`."""
    defaults = {field.name: field.default for field in fields(settings)} | {"against": references}
    chosen = {name: other.get(name, getattr(settings, name)) for name in REPEATED}
    return "".join(
        f" --{name.removesuffix('_s').replace('_', '-')} " + _option_text(value)
        for name, value in chosen.items()
        if name in other or value != defaults[name]
    )


def _option_text(value: object) -> str:
    """Return the value of an option as one types it: a name with a comma in double quotes, `none` for an empty list."""
    if isinstance(value, tuple):
        return shlex.quote(",".join(f'"{name}"' if "," in name else name for name in value) or NOBODY)
    return f"{value:g}" if isinstance(value, float) else shlex.quote(str(value))


def _nearest(run: CaseRunOutcome | ChildOutcome) -> tuple[float, str]:
    """Return how near a run came to a failure, smaller is nearer, and the same in words.

    It is the smallest gap, m, with the time to collision; in a campaign with a goal, one minus the nearness to it.
    """
    if (goal := run.goal) is not None and goal.margin is not None and goal.time_s is not None:
        return 1.0 - goal.nearness, f"{goal.name} kept by {goal.margin:.2f} {goal.unit} at {goal.time_s:.2f} s"
    near: NearMisses | None = run.near if run.goal is None else None
    if near is None or near.distance_m is None:
        return math.inf, ""
    ttc, gap = near.ttc_s, near.distance_m
    words = f"{gap.value:.2f} m from {safe(gap.actor)} at {gap.time_s:.2f} s"
    return gap.value, words + (f", time to collision {ttc.value:.2f} s" if ttc is not None else "")


def _passed(seed: CaseRunOutcome) -> bool:
    return seed.verdict is Verdict.PASS


def _broke(child: ChildOutcome) -> bool:
    return is_problem(child.verdict, hangs=child.hangs) and not child.verdict.is_failure


def _path(before: str, path: Path | str) -> Text:
    return Text.assemble(before, (safe(path, WHOLE), "cyan"))
