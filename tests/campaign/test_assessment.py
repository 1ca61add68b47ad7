"""Drivers on plain test cases: the figures, worked out by hand, and real runs."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from foresee_dsl.campaign.assessment import Assessment, DriverRun, assess_drivers, hard_brakings, rows_of, run_one
from foresee_dsl.campaign.driving import DriverSetup
from foresee_dsl.documents import plain
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.report.terminal.drivers import print_assessment
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import ACCELERATION, STEP_S, Trace


def one(driver: str, family: str, verdict: Verdict, way_m: float = 200.0, brakings: int = 1) -> DriverRun:
    return DriverRun(
        f"f{family}.foresee", family, driver, "1", way_m, brakings, 0.5,
        verdict=verdict, reason="why", duration_s=20.0, digest="d",
    )  # fmt: skip


RUNS = (
    one("a", "3", Verdict.PASS),
    one("a", "3", Verdict.F2, way_m=100.0, brakings=0),
    one("a", "7", Verdict.F4),
    one("a", "7", Verdict.STUCK, way_m=0.0, brakings=0),
    one("b", "7", Verdict.TIMEOUT),
)


def test_rows_of_drivers_and_of_families() -> None:
    a, b = rows_of(RUNS)
    assert (a.cases, a.share(Verdict.PASS), a.failed, a.share(Verdict.STUCK)) == (4, 0.25, 0.5, 0.25)
    assert a.mean_mps == pytest.approx(500 / 80) and a.hard_brakings_per_km == pytest.approx(2 / 0.5)
    assert (b.failed, b.share(Verdict.TIMEOUT)) == (0.0, 1.0)
    assert [(row.driver, row.family, row.cases) for row in rows_of(RUNS, families=True)] == [
        ("a", "3", 2),
        ("a", "7", 2),
        ("b", "7", 1),
    ]


def trace_braking(*frames: int, mps2: float = -3.5) -> Trace:
    states = np.zeros((100, 1, 7))
    states[list(frames), 0, ACCELERATION] = mps2
    none = np.zeros((100, 0))
    return Trace(
        np.arange(100) * STEP_S, states, none.astype(np.int32), none, none.astype(np.int16), none, np.zeros((0, 2)),
        (), (), (), (),
    )  # fmt: skip


def test_brakings_close_together_are_one_event() -> None:
    assert hard_brakings(trace_braking()) == 0
    assert hard_brakings(trace_braking(*range(10, 20))) == 1
    assert hard_brakings(trace_braking(10, 20)) == 1, "half a second apart"
    assert hard_brakings(trace_braking(10, 21)) == 2
    assert hard_brakings(trace_braking(10, mps2=-3.0)) == 0, "harder than 3 m/s^2"


def shown(runs: Sequence[DriverRun], width: int) -> str:
    console = Console(width=width, file=io.StringIO(), highlight=False)
    print_assessment(console, runs, failures=True)
    file = console.file
    assert isinstance(file, io.StringIO)
    return file.getvalue()


@pytest.mark.parametrize("width", [80, 120])
def test_the_table_fits(width: int) -> None:
    text = shown(RUNS, width)
    assert max(len(line.rstrip()) for line in text.splitlines()) <= width
    assert "…" not in text
    assert "f7.foresee\n    stuck: why" in text


def test_json_has_the_rows_and_the_runs() -> None:
    found = plain(Assessment(tuple(RUNS), 0))
    assert found["drivers"][0]["verdicts"] == {"pass": 1, "F2": 1, "F4": 1, "stuck": 1}
    assert found["runs"][1]["verdict"] == "F2" and len(found["families"]) == 3


def untimed(runs: Sequence[DriverRun]) -> list[DriverRun]:
    return [replace(one, step_ms=0.0) for one in runs]


def test_order_and_number_of_workers_change_nothing(scenarios: Path) -> None:
    cases = load_test_cases([f"{scenarios}/scenario9.foresee::r01", f"{scenarios}/scenario7.foresee::r02"])
    told: list[DriverRun] = []
    runs = assess_drivers(cases, ["idm"], jobs=1, on_run=told.append)
    again = assess_drivers(cases[::-1], ["idm"], jobs=2)
    assert sorted(told, key=lambda r: r.case) == list(runs)
    assert untimed(runs) == untimed(again)
    assert {r.family for r in runs} == {"7", "9"} and all(r.way_m > 50 and r.step_ms > 0 for r in runs)


class Breaks:
    """A driver that fails at its third step."""

    name, version = "breaks", "1"

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        self.steps = 0

    def step(self, observation: Observation) -> Control:
        self.steps += 1
        if self.steps == 3:
            raise RuntimeError("third")
        return Control(0.0, 0.0, 0.0)


def test_a_driver_that_breaks_is_a_run_like_any_other(scenarios: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("foresee_dsl.campaign.driving.load_driver", lambda _: Breaks())
    monkeypatch.setattr("foresee_dsl.campaign.driving.find_driver", lambda _: None)
    found = run_one(f"{scenarios}/scenario9.foresee::r01", DriverSetup("breaks"))
    assert (found.verdict, found.duration_s) == (Verdict.CRASH, 0.1)
