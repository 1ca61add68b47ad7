"""What is shown of a campaign while it runs."""

from __future__ import annotations

import io
import json
from contextlib import ExitStack
from pathlib import Path

from rich.console import Console

from foresee_dsl.campaign.storage.store import Row
from foresee_dsl.report.live import EVERY_S, JsonLog, PlainProgress, progress


def row(kind: str, verdict: str = "pass", name: str = "one", *, broken: bool = False) -> Row:
    return Row("k", kind, name, b"", verdict=verdict, reason=f"it was {verdict}", broken=broken)


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
    assert said == [
        "test cases 1/2; children 4/10; failures 2 F4, 1 crash; 0.8 runs/s; about 0:09 left of what is known"
    ]


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
        "could not be done: forecast r01: no idea",
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
