"""Step by step: what the driver saw, answered and gave as its reasons; asking changes nothing."""

from __future__ import annotations

import math
import os
import pty
import select
import subprocess
import sys
import time
from pathlib import Path

import pytest

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.drivers.consent import allowing
from foresee_dsl.drivers.protocol import Control
from foresee_dsl.errors import DriverError
from foresee_dsl.language.document import TestCase
from foresee_dsl.report.page.single import write_view
from foresee_dsl.report.show.page import Page
from foresee_dsl.report.show.sources import ShownRun
from foresee_dsl.report.show.steps import ShownStep, recorded_steps, step_lines
from foresee_dsl.report.show.walk import RunWalk
from tests.support.hidden_walker import hidden_walker


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> TestCase:
    return hidden_walker(tmp_path_factory.mktemp("project"))


@pytest.fixture(scope="module")
def shown(case: TestCase) -> ShownRun:
    return ShownRun("hidden_walker.foresee", case, run_test_case(case, "pdm", 0).trace, "pdm", 0)


@pytest.fixture(scope="module")
def steps(shown: ShownRun) -> tuple[ShownStep, ...]:
    found, same = recorded_steps(shown)
    assert same, "asking for reasons must change nothing"
    return found


@pytest.mark.parametrize("driver", ["idm", "frenetix"])
def test_asking_for_reasons_changes_nothing(case: TestCase, driver: str) -> None:
    if driver == "frenetix":
        pytest.importorskip("frenetix")
    shown = ShownRun("hidden_walker.foresee", case, run_test_case(case, driver, 0).trace, driver, 0)
    found, same = recorded_steps(shown)
    assert same
    assert all(step.reasons for step in found)
    assert len({reason.rule for step in found for reason in step.reasons}) > (driver == "idm")


@pytest.mark.parametrize(
    ("body", "why"),
    [("return 'because'", "returned 'because'; return a list"), ("raise ValueError('x')", "raised ValueError: x, at ")],
)
def test_a_driver_whose_reasons_are_none_is_named(case: TestCase, tmp_path: Path, body: str, why: str) -> None:
    (tmp_path / "odd.py").write_text(
        f"from foresee_dsl.drivers.idm import IdmDriver\nclass Odd(IdmDriver):\n    def explain(self): {body}\n",
        encoding="utf-8",
    )
    odd = f"python:{tmp_path / 'odd.py'}:Odd"
    with allowing([odd]), pytest.raises(DriverError, match="does not explain its answers: .*" + why):
        recorded_steps(ShownRun("hidden_walker.foresee", case, run_test_case(case, odd, 0).trace, odd, 0))
    with allowing([odd]):
        page = write_view(case.id, tmp_path / "page.html", driver=odd, allow_outside=True)
    assert "does not explain its answers: " in page.read_text(encoding="utf-8")


def test_the_walker_is_why_it_brakes(steps: tuple[ShownStep, ...], shown: ShownRun) -> None:
    brakes = [step for step in steps if isinstance(step.answer, Control) and step.answer.brake > 0.5]
    braking = [step for step in brakes if step.ego.speed_mps > 1]
    assert braking
    text = "\n".join(line.plain for line in step_lines(braking[2], shown.trace, "walker", 80))
    assert "pedestrian: walker is about to be in its way" in text
    assert "walker (pedestrian)" in text


def test_an_unseen_opponent_is_named(steps: tuple[ShownStep, ...], shown: ShownRun) -> None:
    hidden = [s for s in steps if 0.5 < s.time_s < 3.0 and all(seen.kind != "pedestrian" for seen in s.actors)]
    assert hidden
    lines = [line.plain for line in step_lines(hidden[0], shown.trace, "walker", 80)]
    assert any(line.split() == ["not", "seen", "walker"] for line in lines)
    assert max(map(len, lines)) <= 80


def test_only_the_steps_that_were_asked_for(shown: ShownRun) -> None:
    found, _ = recorded_steps(shown, 1.0, 2.0, 0.5)
    assert [round(step.time_s, 2) for step in found] == [1.0, 1.5, 2.0]


def test_a_driver_that_says_nothing_is_shown_too(steps: tuple[ShownStep, ...], shown: ShownRun) -> None:
    silent = ShownStep(**{**{n: getattr(steps[0], n) for n in ShownStep.__dataclass_fields__}, "reasons": ()})
    assert any("states no reasons" in line.plain for line in step_lines(silent, shown.trace, "", 80))


def test_keys_walk_through_the_run(steps: tuple[ShownStep, ...], shown: ShownRun) -> None:
    tour = RunWalk(Page(shown, None), steps)
    assert tour.after(0, b"\x1b[C") == 1
    assert tour.after(1, b"\x1b[D") == 0
    assert tour.after(0, b"\x1b[D") == 0
    assert tour.after(5, b"\x1b[B") == 25
    assert tour.after(5, b"\x1b[F") == len(tour) - 1
    assert tour.after(5, b"x") == 5
    assert tour.after(5, b"q") is None
    for width, height in ((80, 24), (160, 50), (40, 12)):
        screen = tour.screen(len(tour) - 1, width, height)
        assert len(screen) <= height
        assert all(len(line.plain) <= width for line in screen)
        assert any("▲" in line.plain or "█" in line.plain or "◆" in line.plain for line in screen)


def test_on_a_terminal_keys_are_obeyed_and_the_screen_is_given_back(case: TestCase) -> None:
    """A real pseudo-terminal: forward, back, leave."""
    ours, theirs = pty.openpty()
    command = [str(Path(sys.executable).parent / "foresee"), "show", str(case.source), "--driver", "idm", "--step"]
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "120", "LINES": "40"}
    with subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, env=environment) as process:
        os.close(theirs)
        text = _until(ours, "1/")
        os.write(ours, b"\x1b[C")
        text += _until(ours, "2/")
        os.write(ours, b"q")
        text += _until(ours, "\x1b[?1049l")
        assert process.wait(30) == 0
    os.close(ours)
    assert "\x1b[?1049h" in text
    assert "answers" in text


def _until(terminal: int, wanted: str) -> str:
    """Read what is written to a terminal until a text comes."""
    text, deadline = "", time.monotonic() + 60
    while wanted not in text and time.monotonic() < deadline:
        if select.select([terminal], [], [], 1)[0]:
            text += os.read(terminal, 65536).decode(errors="replace")
    assert wanted in text
    return text


def test_reasons_have_plain_numbers(steps: tuple[ShownStep, ...]) -> None:
    wishes = [reason.acceleration_mps2 for step in steps for reason in step.reasons]
    assert all(wish is None or math.isfinite(wish) for wish in wishes)
