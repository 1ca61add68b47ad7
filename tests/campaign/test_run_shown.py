"""What `foresee run` says of a run."""

from __future__ import annotations

import io
import math
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from foresee_dsl.campaign.execution.runs import CaseRun
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Scenario
from foresee_dsl.report.terminal.runs import print_case_run
from foresee_dsl.simulate.results.verdict import Impact, RunResult, Verdict
from tests.support.handmade_traces import EAST, make_trace, straight

CASE = TestCase("runs.foresee::r01", Scenario(name="runs", body=()), Path(), {}, "", Path("runs.foresee"))


def shown(result: RunResult) -> str:
    text = io.StringIO()
    one = CaseRun.of(result, case=CASE, result=result)
    print_case_run(Console(file=text, width=120), one, None)
    return text.getvalue()


def test_near_misses_are_a_block() -> None:
    trace = make_trace(
        {"ego": straight("car", 0, 0, EAST, 10, seconds=3), "lead": straight("car", 34, 0, EAST, 5, seconds=3)}
    )
    result = RunResult(Verdict.PASS, 3.0, "", "arrived at 3.00 s", 3.0, 60, trace)
    assert shown(result) == (
        "runs.foresee::r01: pass, arrived at 3.00 s (3.00 s, 60 steps)\n"
        "  nearest   15.00 m at 3.00 s, lead\n"
        "  TTC       3.00 s at 3.00 s, lead\n"
        "  braking   0.8 m/s^2 needed at 3.00 s, lead\n"
    )


def test_an_impact_is_described() -> None:
    trace = make_trace(
        {"ego": straight("car", 0, 0, EAST, 10, seconds=1), "lead": straight("car", 13.9, 0, EAST, 0, seconds=1)}
    )
    impact = Impact("lead", "front", "rear", 2.0, -0.25, math.pi / 6, "ego", 10.0, 9.9, 10.0, 0.0)
    result = RunResult(Verdict.F5, 1.0, "lead", "F5 rear collision with lead (car) at 1.00 s, 10.0 m/s", 1.0, 20, trace)
    assert shown(replace(result, impact=impact)).splitlines()[1:] == [
        "  impact    10.0 m/s (9.9 m/s onto each other), the ego's speed 10.0 m/s",
        "            the ego struck lead; headings 30 deg apart",
        "            at the ego's front (2.0 m ahead of the ego's centre, 0.2 m to the right), the other's rear",
        "  nearest   0.00 m at 1.00 s, lead",
        "  TTC       0.00 s at 1.00 s, lead",
        "  braking   none would have been enough at 1.00 s, lead",
    ]
