"""Where the time goes: `--profile` of runs and campaigns, which changes no result."""

from __future__ import annotations

import io
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from foresee_dsl import measuring
from foresee_dsl.campaign.profiling.clock import EVERY, Clock, Measurement, Spent
from foresee_dsl.campaign.profiling.profile import Profile
from foresee_dsl.measuring import Part
from foresee_dsl.report.terminal.profile import driver_sentence, print_profile
from tests.support.first_project import checked, foresee
from tests.support.small_campaign import SMALL, published, write_project

PROGRAM = """
import json, sys
for line in sys.stdin:
    kind = json.loads(line)["type"]
    if kind == "end":
        break
    answer = {"type": "ready", "name": "mine", "version": "1"} if kind == "reset" else dict.fromkeys(
        ("steer", "throttle", "brake"), 0.1)
    print(json.dumps(answer), flush=True)
"""
CAMPAIGN = (*SMALL, "--driver", "idm", "--before", "3", "--after", "3", "--risky-points", "1", "--children", "2",
            "--against", "none", "--jobs", "1", "--quiet", "--exit-zero")  # fmt: skip
IN_EVERY_RUN = {"driver", "driver_begins", "sumo", "world", "actors", "director", "sensing", "judging", "recording",
                "loop", "placing", "compile", "start", "reading", "handing"}  # fmt: skip


def parts(document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    found = {part["part"]: part for part in document["profile"]["parts"]}
    assert all(part["wall_s"] >= 0 and part["cpu_s"] >= 0 for part in found.values())
    assert sum(part["share"] for part in found.values()) == pytest.approx(1, abs=0.01)
    shares = [part["share_of_runs"] for part in found.values() if part["share_of_runs"] is not None]
    assert not shares or sum(shares) == pytest.approx(1, abs=0.01)
    return found


def test_without_a_clock_nothing_is_counted_and_with_one_blocks_nest() -> None:
    with Part.COMPILE:
        assert measuring.clock() is None
    clock = Clock(Part.REST)
    measuring.start(clock)
    try:
        with Part.COMPILE:
            Part.START.measured(lambda: sum(range(3000)))()
            assert clock.part is Part.COMPILE
        with Part.PLACING, Part.SUMO:
            assert clock.part is Part.PLACING, "what SUMO does before the first frame"
    finally:
        measuring.start(None)
    assert set(clock.take().spent) == {Part.REST, Part.COMPILE, Part.START, Part.PLACING, Part.MEASURING}


def test_a_function_is_timed_only_with_a_clock() -> None:
    def double(number: int) -> int:
        return 2 * number

    assert Part.SENSING.timed(double) is double
    measuring.start(clock := Clock(exactly=True))
    try:
        timed = Part.SENSING.timed(double)
        assert timed(4) == 8
        assert clock.take().spent[Part.SENSING].wall_ns > 0
    finally:
        measuring.start(None)


def test_a_part_has_its_own_time_alone_and_all_of_them_the_whole() -> None:
    clock = Clock(Part.REST)
    for _ in range(2 * EVERY):
        clock.begin_decision(first=False)
        clock.begin(Part.SENSING)
        sum(range(3000))
        clock.end()
        clock.end()
    found = clock.take()
    assert found.decisions == 2 * EVERY
    assert set(found.spent) == {Part.REST, Part.DRIVER, Part.SENSING, Part.MEASURING}
    assert found.spent[Part.SENSING].wall_ns > found.spent[Part.DRIVER].wall_ns
    assert clock.take().decisions == 0
    assert (found + found).spent[Part.SENSING].wall_ns == 2 * found.spent[Part.SENSING].wall_ns


def test_a_run_with_a_program_as_its_driver_is_the_same_with_and_without(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(PROGRAM)
    case = f"{write_project(tmp_path)}::after"
    driver = f"external:{sys.executable} {tmp_path / 'mine.py'}"
    plain, measured = (
        checked(foresee("run", case, "--driver", driver, "--exit-zero", "--json", *more).stdout)
        for more in ((), ("--profile",))
    )
    profile, by_part = measured["profile"], parts(measured)
    assert {key: value for key, value in measured.items() if key != "profile"} == plain
    assert IN_EVERY_RUN | {"pipe"} <= set(by_part)
    assert profile["runs"] == 1 and profile["drivers"] == [driver] and profile["not_measured"] == 0
    # The last frame asks for no decision; the first decision is counted with the reset.
    assert profile["decisions"] == measured["steps"] - 1
    assert profile["driver_share"] == pytest.approx(by_part["driver"]["share_of_runs"], abs=0.001)
    # A program's own time is its driver's, and only where it ran is it waited for.
    assert by_part["driver"]["cpu_s"] > 0 and by_part["driver_begins"]["wall_s"] > by_part["driver_begins"]["cpu_s"]


def test_several_runs_and_those_in_this_process_are_measured_too(tmp_path: Path) -> None:
    file = write_project(tmp_path)
    text = foresee("run", file, "--driver", "idm", "--debug", "--exit-zero", "--profile").stdout
    assert "Your driver (idm) takes " in text and " ms a decision" in text
    assert "3 runs, " in text and "SUMO's own step" in text
    table = text[text.index("Your driver") :].splitlines()
    assert max(map(len, table)) <= 80 and not any("\x1b" in line for line in table)


def test_a_campaign_is_the_same_with_and_without_and_says_what_was_not_measured(tmp_path: Path) -> None:
    case = f"{write_project(tmp_path)}::after"
    command = ("campaign", case, *CAMPAIGN, "--json", "--out")
    foresee(*command, tmp_path / "plain")
    measured = checked(foresee(*command, tmp_path / "measured", "--profile").stdout)
    assert published(tmp_path / "plain") == published(tmp_path / "measured")
    by_part, profile = parts(measured), measured["profile"]
    assert IN_EVERY_RUN | {"forecast", "clip", "mutate", "store", "engine", "folder"} <= set(by_part)
    assert profile["runs"] >= 4 and profile["simulated_s"] >= measured["simulated_s"] > 0
    assert profile["workers"] == 1 and profile["waited_s"] > 0 and profile["not_measured"] == 0
    file = tmp_path / "again.json"
    text = foresee(*command, tmp_path / "measured", "--profile", "--output", file).stderr
    again = checked(file.read_text())["profile"]
    assert again["runs"] == 0 and again["driver_share"] is None and again["not_measured"] >= 6
    assert f"{again['not_measured']} results were in the store already" in text
    assert "No decision of a driver was measured." in text


def test_the_sentence_says_who_is_slow() -> None:
    ms = 1_000_000
    spent = {Part.DRIVER: Spent(62 * ms, 62 * ms), Part.SUMO: Spent(38 * ms, 38 * ms), Part.START: Spent(ms, ms)}
    of_tasks = Measurement(spent, runs=1, decisions=20, simulated_s=1.05)
    profile = Profile.of(("pdm",), Measurement(), of_tasks)
    assert driver_sentence(profile) == "Your driver (pdm) takes 62% of a run's time: 3.1 ms a decision."
    slow = replace(of_tasks, spent={**spent, Part.DRIVER_BEGINS: Spent(0, 400 * ms)})
    assert driver_sentence(Profile.of(("pdm", "idm"), Measurement(), slow)) == (
        "Your driver (pdm, idm) takes 12% of a run's time: 3.1 ms a decision, and 400 ms for its reset, first "
        "step and close."
    )
    text = io.StringIO()
    print_profile(Console(file=text, width=80), profile)
    assert "driver: decisions                0.062   0.062      59.05    62.0%   61.4%" in text.getvalue()
