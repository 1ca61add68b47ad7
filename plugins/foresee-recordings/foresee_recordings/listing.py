"""What `foresee mine` prints for people: the situations of a recording as a table, and what was left out."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from foresee_dsl.report.safe_text import safe
from foresee_recordings.mined import WrittenCase
from foresee_recordings.mining.situation import Situation, measure_text
from foresee_recordings.recording import Recording


def print_recording(console: Console, recording: Recording) -> None:
    """Print what was read: actors and times, what was guessed, and what was left out."""
    times = f"{recording.begins_s:.2f} s to {recording.ends_s:.2f} s"
    about = f"{recording.source.name}: {len(recording.tracks)} actors, {times}"
    console.print(Text(safe(about), style="bold"), soft_wrap=True)
    roads = recording.roads
    notes = [*recording.notes, *(roads.notes if roads is not None else ())]
    notes += [f"left out: {count} {what}" for what, count in recording.left_out.items()]
    for note in notes:
        console.print(Text(f"  {safe(note)}", style="dim"), soft_wrap=True)


def print_situations(console: Console, situations: Sequence[Situation], *, total: int) -> None:
    """Print a list of situations; `total`: how many there are, of which these are the most critical."""
    if not situations:
        console.print("no situations: nothing in this recording is as searched for")
        return
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading, justify, whole in (
        ("no.", "right", True),
        ("time", "right", True),
        ("situation", "left", True),
        ("ego", "left", False),
        ("what happens", "left", False),
    ):
        table.add_column(heading, justify="right" if justify == "right" else "left", no_wrap=whole, overflow="fold")
    for number, situation in enumerate(situations, 1):
        measures = ", ".join(measure_text(key, value) for key, value in situation.measures.items())
        words = Group(Text(safe(situation.sentence)), Text(measures, style="dim"))
        ego = Text(safe(situation.ego))
        table.add_row(str(number), f"{situation.moment_s:.2f} s", situation.name, ego, words)
    console.print(table)
    if total > len(situations):
        console.print(f"These are the {len(situations)} most critical of {total} situations; --top shows more.")


def print_cases(console: Console, cases: Sequence[WrittenCase]) -> None:
    """Print which test cases were written, and why others were not."""
    for case in cases:
        if case.file is None:
            console.print(Text(safe(f"not written: no. {case.situation}: {case.reason}")), soft_wrap=True)
            continue
        beside = f"{case.actors} actors beside the ego, {case.left_out} left out"
        console.print(Text(safe(f"wrote {case.file} ({beside})")), soft_wrap=True)
        for note in case.notes:
            console.print(Text(safe(f"  {note}"), style="dim"), soft_wrap=True)
    written = sum(case.file is not None for case in cases)
    if written < len(cases):
        console.print(f"{written} of {len(cases)} written")
