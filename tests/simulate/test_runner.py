"""Whole runs: how they end, what they hold, and that they are the same every time."""

from __future__ import annotations

import subprocess
import sys
import time
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.documents import plain
from foresee_dsl.drivers.deadlines import Deadlines
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.language.model import Comparison, Expect, Measure, Predicate, Quantity
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.sensing import IDEAL
from foresee_dsl.simulate.trace import FIELDS, X
from tests.support.scenes import Cruise, LaneKeeper, Town

EAST = ("n01_n11", "n11_n21", "n21_n31")
GREEN = (("n11", "phase_0", 0.0),)


def scene(town: Town, *others, at: float = 30.0, **more):  # type: ignore[no-untyped-def]  # actors and scene fields
    return town.bundle([town.ego(EAST, at), *others], **more)


def test_a_run_ends_at_its_goal(town: Town) -> None:
    result = run(scene(town, goal_s=60.0), LaneKeeper(8.0), meta={"case": "r01"})
    assert (result.verdict, result.with_) == (Verdict.PASS, "")
    assert result.trace.meta["case"] == "r01"
    assert result.trace.meta["verdict"] == "pass"
    assert result.trace.events[-1].what == "arrived"
    assert result.steps == result.trace.frames - 1
    line = town.network.line(EAST)
    assert line.project(*result.trace.states[-1, 0, :2].tolist())[0] >= 60.0


def test_who_must_arrive_times_out_and_others_pass(town: Town) -> None:
    assert run(scene(town, end_s=1.0, must_arrive=True), Cruise(0.0)).verdict is Verdict.TIMEOUT
    assert run(scene(town, end_s=1.0), Cruise(0.0)).verdict is Verdict.PASS


def test_a_clip_whose_goal_is_where_it_begins_goes_on(town: Town) -> None:
    result = run(scene(town, goal_s=29.0, end_s=2.0, clip=True), LaneKeeper(3.0))
    assert (result.verdict, result.duration_s) == (Verdict.PASS, 2.0)
    assert run(scene(town, goal_s=35.0, end_s=9.0, clip=True), LaneKeeper(3.0)).duration_s < 5.0


def test_leaving_the_road_is_f1(town: Town) -> None:
    class Left(Cruise):
        def step(self, observation: Observation) -> Control:
            return Control(-0.3, 0.2, 0.0)

    result = run(scene(town), Left())
    assert result.verdict is Verdict.F1
    assert result.trace.events[-1].what == "off_road"
    assert result.time_s == pytest.approx(result.trace.time_s[-1])


@pytest.mark.parametrize(("what", "verdict"), [("crate", Verdict.F1), ("walker", Verdict.F2), ("car", Verdict.F5)])
def test_collisions(town: Town, what: str, verdict: Verdict) -> None:
    x, y, _ = town.network.locate("n01_n11", 60.0)
    other = {
        "crate": town.crate("crate", x, y),
        "walker": town.walker("walker", [(x, y), (x, y + 1)], waits=True),
        "car": town.vehicle("car", EAST, 62.0, speed=0.0, waits=True),
    }[what]
    expects = (Expect(mode="never", condition=Predicate(what="collision", actor="ego")),)
    result = run(scene(town, other, expects=expects), LaneKeeper(8.0))
    assert (result.verdict, result.with_) == (verdict, what)
    assert [e.held for e in result.expectations] == [False]
    assert result.trace.events[-1].detail["with"] == what


def test_a_start_on_top_of_another_is_invalid(town: Town) -> None:
    x, y, _ = town.network.locate("n01_n11", 29.0)
    assert run(scene(town, town.crate("box", x, y)), Cruise()).verdict is Verdict.INVALID


def test_a_driver_that_breaks_is_a_result(town: Town) -> None:
    class Breaks(Cruise):
        def step(self, observation: Observation) -> Control:
            if observation.time_s > 0.5:
                raise ZeroDivisionError("no road")
            return Control(0.0, 0.0, 0.0)

    class Nan(Cruise):
        def step(self, observation: Observation) -> Control:
            return Control(float("nan"), 0.0, 0.0)

    result = run(scene(town), Breaks())
    assert result.verdict is Verdict.CRASH
    assert "ZeroDivisionError: no road" in result.reason
    assert result.trace.frames == 12
    assert "NaN" in run(scene(town), Nan()).reason


def test_a_driver_cannot_change_what_later_runs_use(town: Town) -> None:
    bundle = scene(town, goal_s=60.0)
    before = run(bundle, load_driver("pdm")).trace.digest

    class Shifts(LaneKeeper):
        def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
            mission.centreline[:] -= mission.centreline[0]

    class Slows(LaneKeeper):
        def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
            mission.speed_limit_mps[:] *= 0.5

    class MovesLanes(LaneKeeper):
        def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
            assert mission.road_map is not None
            for lane in mission.road_map.lanes.values():
                lane.centre[:] -= mission.centreline[0]

    for kind in (Shifts, Slows, MovesLanes):
        broken = run(bundle, kind(8.0))
        assert broken.verdict is Verdict.CRASH
        assert "read-only" in broken.reason
    assert run(bundle, load_driver("pdm")).trace.digest == before


@pytest.mark.parametrize(("waits_s", "why"), [(0, "the driver raised OSError: no answer"), (9, "for its close")])
def test_a_driver_that_cannot_be_closed_is_named(town: Town, waits_s: float, why: str) -> None:
    class NotClosed(LaneKeeper):
        def close(self) -> None:
            time.sleep(waits_s)
            raise OSError("no answer")

    result = run(scene(town, goal_s=60.0), NotClosed(8.0), deadlines=Deadlines(step_s=0.5))
    first, *more = result.notes.traceback.splitlines()
    assert result.verdict is Verdict.PASS
    assert first.startswith("the driver could not be closed after the run (the result of the run stands): the driver ")
    assert why in first and first == result.notes.not_closed
    assert more[0].startswith("Traceback")
    assert "not_closed" not in plain(result.notes)  # documents have it in the traceback, as before


def test_stuck_needs_nothing_to_wait_for(town: Town) -> None:
    result = run(scene(town, end_s=40.0, signals=GREEN), Cruise(0.0))
    assert result.verdict is Verdict.STUCK
    ahead = town.vehicle("car", EAST, 40.0, speed=0.0, waits=True)
    assert run(scene(town, ahead, end_s=26.0), Cruise(0.0)).verdict is Verdict.PASS


def test_expectations_have_margins(town: Town) -> None:
    def compare(what: str, op: str, value: str, unit: str) -> Comparison:
        return Comparison(left=Measure(what=what, actor="ego"), op=op, right=Quantity(value=Decimal(value), unit=unit))

    expects = (
        Expect(mode="always", condition=compare("speed", "<", "10", "m/s")),
        Expect(mode="never", condition=compare("speed", ">", "8.5", "m/s")),
        Expect(mode="eventually", condition=compare("speed", ">=", "20", "m/s")),
        Expect(
            mode="eventually",
            within=Quantity(value=Decimal(60), unit="s"),
            condition=Predicate(what="arrived", actor="ego"),
        ),
    )
    result = run(scene(town, goal_s=60.0, expects=expects), LaneKeeper(8.0))
    assert [e.held for e in result.expectations] == [True, True, False, True]
    top = result.trace.states[:, 0, 3].max()
    assert result.expectations[0].margin == pytest.approx(10 - top, abs=1e-5)
    assert result.expectations[2].margin == pytest.approx(top - 20, abs=1e-5)
    assert result.expectations[3].margin is None
    assert result.expectations[0].text == "expect always ego.speed < 10 m/s"


def test_the_driver_sees_what_is_near_and_no_names(town: Town) -> None:
    near = town.vehicle("near", EAST, 60.0)
    far = town.vehicle("far", ("n32_n33",), 20.0, speed=0.0)
    driver = Cruise(0.0)
    run(scene(town, near, far, end_s=2.0), driver, seed=5, sensors=IDEAL)
    first = driver.seen[0]
    assert len(first.actors) == 1
    assert (first.actors[0].kind, first.actors[0].length_m) == ("car", 4.0)
    assert len({a.track for o in driver.seen for a in o.actors}) == 1
    assert set(first.signals.values()) <= {"red", "amber", "green", "off"}
    assert len(first.signals) == 1
    again = Cruise(0.0)
    run(scene(town, near, far, end_s=2.0), again, seed=5, sensors=IDEAL)
    assert again.seen == driver.seen


def test_the_layout_of_a_trace(town: Town) -> None:
    walker = town.walker("walker", [(0.0, 0.0), (9.0, 0.0)])
    leaves = town.vehicle("leaves", ("n12_n11",), 80.0, speed=10.0)
    trace = run(scene(town, walker, leaves, end_s=4.0), Cruise(0.0)).trace
    assert trace.states.shape == (81, 3, len(FIELDS))
    assert trace.time_s[-1] == 4.0
    assert np.isnan(trace.states[-1, 2]).all()
    assert trace.lanes[-1, 2] == -1
    assert [e.actor for e in trace.events if e.what == "arrived"] == ["leaves"]
    assert trace.lane_ids[trace.lanes[0, 0]] == "n01_n11_1"
    assert trace.along[-1, 1] == pytest.approx(5.6, abs=0.1)
    assert np.isnan(trace.along[:, 0]).all()
    assert np.hypot(*np.diff(trace.waypoints, axis=0).T).max() < 2.01
    assert trace.waypoints[0, 0] - trace.states[0, 0, X] == pytest.approx(2.0)  # the scene starts at the front
    assert [i.route for i in trace.actors] == [EAST, (), ("n12_n11",)]


_AGAIN = """
import sys
from pathlib import Path
from foresee_dsl.simulate.runner import run
from tests.support.scenes import LaneKeeper, Town
town = Town(Path(sys.argv[1]))
bundle = town.bundle([town.ego(("n01_n11", "n11_n21", "n21_n31"), 30.0), *town.traffic(11, 12)])
print(run(bundle, LaneKeeper(5.0), seed=3).trace.digest)
"""


def test_the_same_in_another_process(town: Town, tmp_path: Path) -> None:
    bundle = town.bundle([town.ego(EAST, 30.0), *town.traffic(11, 12)])
    here = {run(bundle, LaneKeeper(5.0), seed=3).trace.digest for _ in range(2)}
    command = [sys.executable, "-c", _AGAIN, str(town.net)]
    checkout = Path(__file__).parents[2]  # `tests` is imported from there
    there = subprocess.run(command, check=True, capture_output=True, text=True, cwd=checkout).stdout
    assert here == {there.strip()}  # and nothing but the digest was printed
