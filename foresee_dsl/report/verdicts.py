"""Lines that all reports of runs share: the headline, which counts failed runs by kind, endings, rules that were
broken, and triggers that never fired."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from rich.text import Text

from foresee_dsl.campaign.records import ClipOutcome, in_metres
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.report.safe_text import counted, safe
from foresee_dsl.simulate.results.infraction import Infraction
from foresee_dsl.simulate.results.verdict import EXPECTATION, DriverNotes, RunRecord, UnfiredTrigger, Verdict

WHOLE = 100_000
"""Maximum length of a text that must not be cut in practice, characters: a path, or a line that a driver printed."""


def ending(run: RunRecord) -> Text:
    """Return how a run ended, in one word: its verdict, or `expectation` if it passed but broke expectations."""
    if run.verdict is Verdict.PASS and run.broken_expectations:
        return Text(EXPECTATION, style="bold red")
    return Text(run.verdict.value, style=run.verdict.style)


def changed_lines(notes: Iterable[DriverNotes]) -> list[str]:
    """Return a line for each change that the driver made to its process in these runs, such as its working folder."""
    listed = list(notes)
    counts = Counter(phrase for note in listed for phrase in note.changed)
    often = (f" in {counted(count, 'run')}" if len(listed) > 1 else "" for count in counts.values())
    return [
        f"the driver {safe(phrase, WHOLE)}{runs}; the change was undone, and later runs used a fresh process"
        for phrase, runs in zip(counts, often, strict=True)
    ]


def rule_lines(infractions: Iterable[Infraction]) -> tuple[str, ...]:
    """Return a line for each traffic rule that the ego broke in a run."""
    return tuple(f"rule      {infraction.sentence}" for infraction in infractions)


def verdicts_line(runs: Sequence[RunRecord]) -> Text:
    """Return the headline of runs of test cases: how many failed, by kind; if the driver crashed or hung in all of
    them, the reason.
    """
    failed_runs, total = [run for run in runs if not run.passed], len(runs)
    if not failed_runs:
        return Text(f"{counted(total, 'test case')} passed", style="bold green")
    counts = Counter(run.verdict for run in failed_runs)
    breaking = counts.pop(Verdict.PASS, 0)
    hung = sum(run.exceeded_wall_time for run in failed_runs)
    if total in (counts[Verdict.CRASH], hung):
        often, times = Counter(run.reason for run in failed_runs).most_common(1)[0]
        begins = f"the driver {'hangs' if hung else 'crashed'} in {total} of {counted(total, 'test case')}: "
        more = "" if times == total else f" (in {times} of them)"
        return Text(begins + safe(short_crash(often), WHOLE) + more, style="bold red")
    kinds = [f"{counts[kind]} {kind.value}" for kind in Verdict if counts[kind]]
    kinds += [f"{breaking} {EXPECTATION}"] if breaking else []
    return Text(f"{len(failed_runs)} of {counted(total, 'test case')} failed: {', '.join(kinds)}", style="bold red")


def short_crash(reason: str) -> str:
    """Return the reason of a crash or hang, without the beginning that the headline already states."""
    for begins in ("timeout: ", "the driver raised ", "the driver broke: ", "the driver hangs: "):
        reason = reason.removeprefix(begins)
    return reason


def without_verdict(verdict: Verdict, reason: str) -> str:
    """Return a reason without the verdict at its beginning, to be shown after the verdict."""
    return reason.removeprefix(f"{verdict.value}: ").removeprefix(f"{verdict.value} ")


def not_deterministic(driver: str, rates: Sequence[str]) -> str:
    """Return the sentence about a driver that is not deterministic; `rates`: how many runs of each finding fail, "" if
    all runs are equal.
    """
    differing = sum(map(bool, rates))
    return (
        f"{driver} is not deterministic: {differing} of {counted(len(rates), 'finding')} ended differently in another "
        "process; k/n says how many runs fail"
    )


def unused_clips(clips: Iterable[ClipOutcome], settings: CampaignSettings) -> Iterator[str]:
    """Yield which clips were not mutated and why, and how many children do not count because of their clip."""
    limit_m = settings.fidelity_limit_m
    untrusted = [clip for clip in clips if not clip.trusted(limit_m)]
    without = [clip for clip in untrusted if not clip.dropped] if settings.children else []
    parts = []
    if failing := [clip for clip in without if clip.verdict is not Verdict.PASS]:
        parts.append(f"{counted(len(failing), 'clip does', 'clips do')} not pass without mutation")
    if straying := [clip.largest_m for clip in without if clip.verdict is Verdict.PASS]:
        strays, parent = ("clip strays", "its parent") if len(straying) == 1 else ("clips stray up to", "their parents")
        strays_m = f"{len(straying)} {strays} {in_metres(max(straying))} from {parent}"
        parts.append(f"{strays_m} ({limit_m:g} m are allowed)")
    if parts:
        yield f"not mutated: {'; '.join(parts)}"
    if dropped := [clip for clip in untrusted if clip.dropped]:
        of = f"{counted(sum(clip.dropped for clip in dropped), 'child', 'children')} of {counted(len(dropped), 'clip')}"
        yield f"not counted: {of} whose own run fails or strays from the parent's run"


_NEVER = "  never   "


def unfired_lines(triggers: Iterable[UnfiredTrigger], width: int) -> Iterator[Text]:
    """Yield the triggers and steps that never fired and how near they came, in lines of at most `width` columns (0: one
    line each)."""
    for trigger in triggers:
        alone = len(trigger.nearest) == 1 and trigger.nearest[0].text == trigger.text
        label = f"{trigger.name}: " if trigger.name else ""
        head = f"{'then when' if trigger.where else 'when'} {label}`{trigger.text}`"
        yield from _broken(f"{head}; {trigger.nearest[0].words}" if alone else head, _NEVER, width)
        if trigger.together:
            yield Text("            each part held at some time, but never all; when most did:", style="dim")
        for part in () if alone else trigger.nearest:
            yield from _broken(f"`{part.text}`: {part.words}", " " * 12, width)


def _broken(text: str, begins: str, width: int) -> Iterator[Text]:
    """Yield a sentence after `begins`, in lines; the second and later lines are indented by two columns more."""
    whole = safe(text, WHOLE)
    room = max(width - len(begins) - 2, 20)
    first, *rest = textwrap.wrap(whole, room, break_on_hyphens=False) if width and whole else [whole]
    yield Text.assemble((begins, "yellow"), (first, "dim" if not begins.strip() else ""))
    yield from (Text(f"{' ' * (len(begins) + 2)}{more}", style="dim") for more in rest)
