"""What is shown of a campaign while it runs."""

from __future__ import annotations

import io
import json
import re
from contextlib import ExitStack
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from rich.console import Console

from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.storage.store import StoredResult
from foresee_dsl.report.terminal.live import LONGEST_LINE, JsonLog, PlainProgress, TimeLeft, progress
from foresee_dsl.report.terminal.steps import EVERY_S


def row(kind: str, verdict: str = "pass", name: str = "one", *, broken: bool = False) -> StoredResult:
    return StoredResult("k", kind, name, b"", verdict=verdict, reason=f"it was {verdict}", broken=broken)


class Clock:
    """Time that passes when it is told to."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


def test_a_line_every_few_seconds() -> None:
    said: list[str] = []
    clock = Clock()
    shown = PlainProgress(said.append, clock)
    shown.planned("seed", 2)
    shown.planned("child", 10)
    shown.done(row("seed"), new=False)
    for verdict in ("F4", "F4", "pass", "crash"):
        clock.now += EVERY_S / 4
        shown.done(row("child", verdict))
    assert len(said) == 1
    assert said[0].endswith("; failures 2 F4, 1 crash; test cases 1/2; children 4/10; 0.8 runs/s")
    assert re.search(r"\d+% done, about \d+:\d\d left; ", said[0])
    assert len(said[0]) <= LONGEST_LINE


def test_the_time_left_does_not_jump() -> None:
    """A campaign like the library's: what follows from test cases is not known until they are done."""
    clock = Clock()
    left = TimeLeft(CampaignSettings(), clock)
    began, told = clock.now, []
    runs = [("seed", 0.6, "clip", 3)] * 60 + [("clip", 0.2, "child", 4)] * 180 + [("child", 0.12, "", 0)] * 720
    runs += [("minimise", 3.0, "", 0)] * 36
    whole_s = sum(wall_s for _, wall_s, *_ in runs) / 2
    left.planned("seed", 60)
    for number, (kind, wall_s, follows, count) in enumerate(runs):
        if kind == "minimise" and runs[number - 1][0] == "child":
            left.planned("minimise", 36)
        clock.now += wall_s / 2  # two workers
        failed = kind == "child" and number % 10 == 0
        left.done(replace(row(kind, "F2" if failed else "pass"), wall_s=wall_s), new=True)
        if follows:
            left.planned(follows, count)
        if (seconds := left.left_s) is not None:
            told.append((clock.now - began, seconds))
    assert told[-1][1] < 0.05 * whole_s and left.share > 0.9
    wholes = [took + seconds for took, seconds in told if took > 0.05 * whole_s]
    assert max(wholes) < 1.3 * whole_s and min(wholes) > 0.75 * whole_s
    assert all(abs(b - a) < 0.03 * whole_s for a, b in pairwise(wholes)), "from one moment to the next"


def test_one_test_case_alone_is_not_the_whole_work() -> None:
    """Between the end of a run and the plan of what follows from it, nothing seems to be left."""
    left = TimeLeft(CampaignSettings(), Clock())
    left.planned("seed", 1)
    left.done(replace(row("seed"), wall_s=1.0), new=True)
    assert left.share < 0.5
    left.planned("clip", 2)
    left.done(replace(row("clip"), wall_s=0.5), new=True)
    left.done(replace(row("clip"), wall_s=0.5), new=True)
    assert left.share < 0.7
    left.planned("child", 8)
    for _ in range(8):
        left.done(replace(row("child"), wall_s=0.5), new=True)
    assert left.share > 0.8


def test_test_cases_that_lead_to_nothing_are_nearly_all() -> None:
    left = TimeLeft(CampaignSettings(), Clock())
    left.planned("seed", 20)
    for _ in range(20):
        left.done(replace(row("seed"), wall_s=1.0), new=True)
    assert 0.85 < left.share < 1.0


def test_a_campaign_with_thousands_of_failures_is_not_said_to_make_each_of_them_smaller() -> None:
    """Like `make study`: 2,000 failures are some 80 findings; a line every ten seconds, not two a second."""
    clock = Clock()
    left = TimeLeft(CampaignSettings(), clock)
    began, told = clock.now, []
    left.planned("child", 36_000)
    runs = [("child", 0.06)] * 36_000 + [("minimise", 1.5)] * 82
    whole_s = sum(wall_s for _, wall_s in runs) / 2
    for number, (kind, wall_s) in enumerate(runs):
        if kind == "minimise" and runs[number - 1][0] == "child":
            left.planned("minimise", 82)
        clock.now += wall_s / 2  # two workers
        failed = kind == "child" and number % 18 == 0
        left.done(replace(row(kind, "F2" if failed else "pass"), wall_s=wall_s), new=True)
        if number % 300 == 0 and (seconds := left.left_s) is not None:
            told.append(clock.now - began + seconds)
    assert max(told) < 1.3 * whole_s and min(told) > 0.75 * whole_s


def test_a_line_every_ten_seconds_follows_as_fast_as_two_a_second() -> None:
    """The work doubles halfway: the second line after that has nearly all of it."""
    clock = Clock()
    left = TimeLeft(CampaignSettings(), clock)
    left.planned("child", 200)
    for number in range(120):
        if number == 100:
            left.planned("child", 200)
        clock.now += 1.0
        left.done(replace(row("child"), wall_s=1.0), new=True)
        if number % 10 == 9:
            seconds = left.left_s
    assert seconds is not None and seconds == pytest.approx(400 - 120, rel=0.1)


def test_what_is_not_usable_or_broken_is_said_at_once() -> None:
    said: list[str] = []
    shown = PlainProgress(said.append, Clock())
    shown.done(row("seed", "F2", "runner"))
    shown.done(row("child", "crash", "m1", broken=True))
    shown.done(row("child", "F2"))
    shown.broken("forecast r01: no idea")
    assert said == [
        "not usable: runner: it was F2",
        "broke: m1: it was crash",
        "could not be run: forecast r01: no idea",
    ]


def test_a_log_of_every_event() -> None:
    file, clock = io.StringIO(), Clock()
    log = JsonLog(file, clock)
    log.write("begin", test_cases=3)
    log.planned("clip", 1)
    log.done(row("clip"))
    log.done(row("forecast", ""), new=False)
    log.write("end", interrupted=False)
    events = [json.loads(line) for line in file.getvalue().splitlines()]
    assert [event["event"] for event in events] == ["begin", "planned", "done", "known", "end"]
    assert events[2]["verdict"] == "pass" and events[2]["stage"] == "clip" and events[2]["time"] == 100.0
    assert "verdict" not in events[3]


def test_bars_on_a_terminal_and_nothing_when_quiet(tmp_path: Path) -> None:
    for quiet in (False, True):
        console = Console(file=io.StringIO(), force_terminal=True, width=100, legacy_windows=False)
        with ExitStack() as stack:
            listeners, log = progress(stack, console, quiet=quiet, log=tmp_path / "sub" / "log.jsonl")
            for listener in listeners:
                listener.planned("child", 4)
                listener.done(row("child", "F3"))
                listener.done(row("seed", "F1", "odd[one]"))
                listener.broken("something")
        assert log is not None
        text = console.file.getvalue()  # type: ignore[attr-defined]
        assert text == "" if quiet else "children" in text and "F3" in text and "1/4" in text and "odd[one]" in text
    assert len((tmp_path / "sub" / "log.jsonl").read_text().splitlines()) == 4
