"""What actors do: triggers, orders, rules that are ignored, meetings, ghosts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from foresee_dsl.compile.bundle import PlacedActor, SumoBundle, TimedValue
from foresee_dsl.language.model import (
    ChangesLane,
    ChangesSpeed,
    Comparison,
    Ignores,
    Measure,
    Meets,
    MeetsState,
    Starts,
    Stops,
    When,
)
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import ACCELERATION, HEADING, SPEED, Trace, X, Y
from tests.support.scenes import Cruise, LaneKeeper, Town
from tests.support.worlds import q

NORTH = ("n10_n11", "n11_n12", "n12_n13")
EAST = ("n01_n11", "n11_n21", "n21_n31")


def after(seconds: float, *actions) -> When:  # type: ignore[no-untyped-def]  # actions of any kind
    time = Measure(what="time")
    return When(condition=Comparison(left=time, op=">=", right=q(seconds, "s")), actions=actions)


def parked(town: Town) -> PlacedActor:
    """An ego out of everybody's way."""
    return town.ego(("n30_n20", "n20_n10"), 10.0, speed=0.0)


def drive(town: Town, *actors: PlacedActor, end_s: float = 10.0, driver: Cruise | None = None, **scene) -> Trace:  # type: ignore[no-untyped-def]  # scene fields
    ego = scene.pop("ego", None) or parked(town)
    bundle: SumoBundle = town.bundle([ego, *actors], end_s=end_s, clip=True, **scene)
    result = run(bundle, driver or Cruise())
    assert result.verdict is Verdict.PASS, result.reason
    return result.trace


def speeds(trace: Trace, name: str) -> np.ndarray:
    return trace.states[:, trace.index(name), SPEED]


def shows_red(town: Town, edges: tuple[str, ...]) -> tuple[str, str, float]:
    """A signal state with a long red for a movement over n11."""
    movement = next(m for m in town.network.movements_from(edges[0]) if m.to_edge == edges[1])
    phases = town.signals["n11"].phases
    k = next(k for k, p in enumerate(phases) if p.state[movement.link] == "r" and p.duration_s >= 6)
    return "n11", f"phase_{k}", 0.0


@pytest.mark.parametrize("ignores", [(), (("signals", None),), (("signals", "n11"),), (("signals", "n22"),)])
def test_only_who_ignores_this_signal_runs_it(town: Town, ignores) -> None:  # type: ignore[no-untyped-def]  # see the parameters
    car = town.vehicle("car", NORTH, 40.0, speed=10.0, ignores=ignores)
    trace = drive(town, car, signals=(shows_red(town, NORTH),))
    over = trace.states[-1, 1, Y] > 120.0
    assert over == (ignores in ((("signals", None),), (("signals", "n11"),)))
    if over:
        assert speeds(trace, "car").min() > 8.0
        event = next(e for e in trace.events if e.what == "ignores")
        assert event.detail == {"what": "signals", "junction": ignores[0][1]}


def test_who_runs_a_red_does_not_yield_inside(town: Town) -> None:
    cross = [town.vehicle(f"cross_{k}", EAST, 62.0 - 12 * k, speed=10.0) for k in range(4)]
    car = town.vehicle("car", NORTH, 50.0, speed=10.0, ignores=(("signals", None),))
    alone = drive(town, car, signals=(shows_red(town, NORTH),))
    trace = drive(town, car, *cross, signals=(shows_red(town, NORTH),))
    assert trace.states[-1, 1, Y] == pytest.approx(alone.states[-1, 1, Y], abs=0.5)


@pytest.mark.parametrize("ignores", [(), (("priority", "n21"),)])
def test_priority_can_be_ignored(town: Town, ignores) -> None:  # type: ignore[no-untyped-def]  # see the parameters
    side = ("n20_n21", "n21_n22")
    stream = [town.vehicle(f"s_{k}", ("n11_n21", "n21_n31"), 85.0 - 11 * k, speed=9.0, cruise=9.0) for k in range(7)]
    car = town.vehicle("car", side, 60.0, speed=9.0, cruise=9.0, ignores=ignores)
    lowest = speeds(drive(town, car, *stream, end_s=6.0), "car")[:100].min()
    assert (lowest > 7.0) == bool(ignores)


def test_an_actor_waits_for_its_trigger_and_its_delay(town: Town) -> None:
    line = town.network.locate("n12_n11", 50.0)
    x, y = line[0] - 5.0, line[1]
    walker = town.walker("walker", [(x, y), (x + 10, y)], waits=True, delay_s=0.5)
    car = town.vehicle("car", EAST, 20.0, speed=0.0, waits=True)
    whens = (after(2.0, Starts(actor="walker"), Starts(actor="car")),)
    trace = drive(town, walker, car, whens=whens)
    moving = [int(np.argmax(speeds(trace, name) > 0)) for name in ("walker", "car")]
    assert moving == [51, 41]
    assert speeds(trace, "walker").max() == pytest.approx(1.4)
    assert trace.along[-1, 1] == pytest.approx(1.4 * 7.5, abs=1.0)
    assert [(e.actor, e.what, e.time_s) for e in trace.events] == [
        ("", "trigger", 2.0),
        ("walker", "starts", 2.0),
        ("car", "starts", 2.0),
    ]


def test_changes_of_speed_are_linear_and_last(town: Town) -> None:
    car = town.vehicle("car", EAST, 5.0, speed=10.0, cruise=10.0)
    trace = drive(town, car, end_s=5.0, whens=(after(1.0, ChangesSpeed(actor="car", to=q(4, "m/s"), over=q(2, "s"))),))
    v = speeds(trace, "car")
    assert v[20] == pytest.approx(10.0)
    assert v[40] == pytest.approx(7.0, abs=0.05)
    assert v[60:] == pytest.approx(4.0, abs=0.01)
    assert next(e for e in trace.events if e.what == "changes_speed").detail["to_mps"] == 4.0


def test_stops_for_a_time(town: Town) -> None:
    car = town.vehicle("car", EAST, 5.0, speed=9.0, cruise=9.0)
    trace = drive(town, car, whens=(after(0.5, Stops(actor="car", duration=q(2, "s"))),))
    v = speeds(trace, "car")
    standing = np.flatnonzero(v < 0.1)
    assert len(standing) * 0.05 == pytest.approx(2.0, abs=0.3)
    assert trace.states[:, 1, ACCELERATION].min() == pytest.approx(-3.0, abs=0.2)
    assert v[-1] > 5.0


def test_a_lane_change_moves_sideways_in_time(town: Town) -> None:
    car = town.vehicle("car", EAST, 10.0, speed=10.0, cruise=10.0)
    trace = drive(town, car, end_s=6.0, whens=(after(0.5, ChangesLane(actor="car", side="left")),))
    assert trace.lane_ids[trace.lanes[60, 1]] == "n01_n11_2"
    across = np.abs(np.diff(trace.states[:, 1, Y]))
    assert 3.0 < abs(trace.states[-1, 1, Y] - trace.states[0, 1, Y]) < 3.5
    assert across.max() < 0.08
    assert np.degrees(np.abs(trace.states[:, 1, HEADING])).max() < 12


@pytest.mark.parametrize(("order", "gap"), [("after", 1.5), ("before", 1.0)])
def test_meets_at_the_crossing_with_the_gap(town: Town, order: str, gap: float) -> None:
    ego = town.ego(EAST, 40.0, speed=8.0)
    runner = town.vehicle(
        "runner", NORTH, 30.0, speed=8.0, cruise=12.0, ignores=(("signals", None), ("priority", None))
    )
    meets = Meets(actor="runner", other="ego", junction="n11", gap=q(gap, "s"), order=order)
    trace = drive(town, runner, ego=ego, driver=LaneKeeper(8.0), whens=(after(0.2, meets),), end_s=11.5)
    # both drive straight: they cross where the ego's y is the runner's
    y, x = trace.states[0, 0, Y], trace.states[0, 1, X]
    ego_at = int(np.argmax(trace.states[:, 0, X] + 2.0 >= x))
    runner_at = int(np.argmax(trace.states[:, 1, Y] + 2.0 >= y))
    signed = (runner_at - ego_at) * 0.05
    assert signed == pytest.approx(gap if order == "after" else -gap, abs=0.35)
    assert speeds(trace, "runner").max() <= 1.3 * 12.0


def test_meeting_can_be_a_state(town: Town) -> None:
    state = MeetsState(other="ego", junction="n11", gap=q(1.5, "s"))
    runner = town.vehicle("runner", NORTH, 30.0, speed=8.0, meets=(state,), ignores=(("signals", "n11"),))
    trace = drive(town, runner, ego=town.ego(EAST, 40.0), driver=LaneKeeper(8.0), end_s=1.0)
    assert trace.events[1].detail == {"other": "ego", "junction": "n11", "gap_s": 1.5, "order": "after"}


def test_who_meets_keeps_its_speed_near_the_junction_and_says_so(town: Town) -> None:
    state = MeetsState(other="ego", junction="n11", gap=q(2.5, "s"))
    runner = town.vehicle("runner", NORTH, 30.0, speed=8.0, cruise=12.0, meets=(state,), ignores=(("signals", None),))
    trace = drive(town, runner, ego=town.ego(EAST, 40.0), driver=LaneKeeper(8.0), end_s=11.0)
    events = {e.what: e for e in trace.events if e.actor == "runner"}
    keeps, met = events["keeps_speed"], events["met"]
    v = speeds(trace, "runner")[trace.frame_at(keeps.time_s) + 1 : trace.frame_at(met.time_s)]
    assert v == pytest.approx(keeps.detail["speed_mps"], abs=1e-6)
    assert speeds(trace, "runner")[-1] > keeps.detail["speed_mps"]


def test_cars_stop_for_someone_on_the_road_and_go_on(town: Town) -> None:
    x, y, _ = town.network.locate("n11_n21", 60.0)
    car = town.vehicle("car", ("n11_n21", "n21_n31"), 15.0, speed=9.0, cruise=9.0)
    walker = town.walker("walker", [(x, y - 4), (x, y + 8)], speed=1.2)
    trace = drive(town, car, walker)
    v = speeds(trace, "car")
    assert v.min() < 5.0
    assert v[-1] > 4.0
    both = trace.states[:, 1:, :2]
    assert np.hypot(*(both[:, 0] - both[:, 1]).T).min() > 2.2


def test_who_walks_beside_the_road_stops_nobody(town: Town) -> None:
    x, y, _ = town.network.locate("n11_n21", 30.0)
    car = town.vehicle("car", ("n11_n21", "n21_n31"), 15.0, speed=9.0, cruise=9.0)
    walker = town.walker("walker", [(x, y - 2.6), (x + 40, y - 2.6)])
    assert speeds(drive(town, car, walker, end_s=4.0), "car").min() > 8.5


@pytest.mark.parametrize(("aside", "blocks"), [(0.0, True), (2.4, False)])
def test_cars_stop_behind_an_obstacle_on_their_lane(town: Town, aside: float, blocks: bool) -> None:
    x, y, _ = town.network.locate("n10_n11", 60.0)
    car = town.vehicle("car", NORTH, 10.0, speed=9.0)
    box = town.crate("box", x + aside, y)
    trace = drive(town, car, box, signals=())
    assert (trace.states[-1, 1, Y] < y - 2.0) == blocks
    assert trace.states[-1, 1, Y] > y - 6.0


def test_walkers_wait_for_green(town: Town) -> None:
    link = next(k for k, c in enumerate(town.signals["n11"].phases[0].state) if c == "r")
    green = next(p for p, phase in enumerate(town.signals["n11"].phases) if phase.state[link] in "gG")
    path = [(60.0, 100.0), (60.0, 130.0)]
    walker = town.walker("walker", path, walk_stops=((4.0, 12.0, "n11", link),))
    waits = drive(town, walker, signals=(("n11", "phase_0", 0.0),))
    goes = drive(town, walker, signals=(("n11", f"phase_{green}", 0.0),))
    assert waits.along[-1, 1] == pytest.approx(3.5, abs=0.05)
    assert goes.along[-1, 1] > 6.0


@pytest.mark.parametrize("factor", [0.8, 1.2])
def test_timing_scales_the_way_that_is_driven(town: Town, factor: float) -> None:
    car = town.vehicle("car", ("n11_n21", "n21_n31"), 10.0, speed=9.0, cruise=9.0)
    walker = town.walker("walker", [(0.0, 0.0), (30.0, 0.0)])
    plain = drive(town, car, walker, end_s=3.0)
    timed = drive(town, replace(car, timing=factor), replace(walker, timing=factor), end_s=3.0)
    way = [float(np.hypot(*(t.states[-1, 1:, :2] - t.states[0, 1:, :2]).T)[0]) for t in (plain, timed)]
    assert way[1] / way[0] == pytest.approx(factor, abs=1e-3)
    assert timed.along[-1, 2] / plain.along[-1, 2] == pytest.approx(factor, abs=1e-3)


def test_timing_scales_what_a_walker_does_once_it_is_started(town: Town) -> None:
    walker = town.walker("walker", [(0.0, 0.0), (30.0, 0.0)], waits=True, timing=0.8)
    trace = drive(town, walker, whens=(after(0.5, Starts(actor="walker")),), end_s=4.0)
    assert speeds(trace, "walker").max() == pytest.approx(0.8 * 1.4)


def test_timing_scales_a_change_of_speed(town: Town) -> None:
    car = town.vehicle("car", EAST, 5.0, speed=10.0, cruise=10.0, timing=0.8)
    change = ChangesSpeed(actor="car", to=q(5, "m/s"), over=q(1, "s"))
    v = speeds(drive(town, car, end_s=3.0, whens=(after(0.5, change),)), "car")
    assert v[0] == pytest.approx(8.0)
    assert v[-1] == pytest.approx(4.0, abs=0.01)


@pytest.mark.parametrize("begins", [0.0, 0.4])
def test_who_has_a_timing_does_not_make_up_for_it(town: Town, begins: float) -> None:
    ego, keeper = town.ego(EAST, 40.0, speed=8.0), LaneKeeper(8.0)
    state = MeetsState(other="ego", junction="n11", gap=q(1.5, "s"))
    action = Meets(actor="runner", other="ego", junction="n11", gap=q(1.5, "s"))
    more = {"meets": (state,)} if not begins else {}
    runner = town.vehicle("runner", NORTH, 10.0, speed=8.0, cruise=12.0, ignores=(("signals", None),), **more)
    whens = (after(begins, action),) if begins else ()
    plain = drive(town, runner, ego=ego, driver=keeper, whens=whens, end_s=6.0)
    timed = drive(town, replace(runner, timing=0.8), ego=ego, driver=keeper, whens=whens, end_s=6.0)
    first = round(begins / 0.05) + 30  # it has come to the speed that was asked for
    asked, kept = speeds(plain, "runner"), speeds(timed, "runner")
    assert np.ptp(kept[first:]) < 1e-6
    assert kept[-1] == pytest.approx(0.8 * asked[first], rel=0.06)
    if not begins:  # nothing has happened yet that would have changed the plan
        assert kept[-1] < asked[first:].min()


def test_a_delayed_car_stands_that_long(town: Town) -> None:
    car = town.vehicle("car", EAST, 20.0, speed=0.0, delay_s=1.0)
    assert int(np.argmax(speeds(drive(town, car), "car") > 0)) == 21


def test_a_steered_car_leaves_its_lane_and_comes_back(town: Town) -> None:
    car = town.vehicle("car", ("n11_n21", "n21_n31"), 10.0, speed=10.0, cruise=10.0)
    steered = replace(car, steering=TimedValue(0.05, 0.5, 1.5))
    trace, straight = drive(town, steered, end_s=7.0), drive(town, car, end_s=7.0)
    aside = np.abs(trace.states[:, 1, Y] - straight.states[:, 1, Y])
    assert aside[:11].max() < 1e-9
    assert aside.max() > 0.5
    assert aside[-1] < 0.4
    assert trace.states[30, 1, HEADING] != 0.0
    assert math.dist(trace.states[11, 1, :2], trace.states[10, 1, :2]) == pytest.approx(0.5, abs=0.02)


def test_triggers_fire_once_and_in_order(town: Town) -> None:
    near = Comparison(left=Measure(what="eta", actor="car", other="n11"), op="<", right=q(3, "s"))
    whens = (
        When(condition=near, actions=(Ignores(actor="car", what="signals", junction="n11"),)),
        after(0.0, Stops(actor="other")),
    )
    car = town.vehicle("car", NORTH, 40.0, speed=10.0, cruise=10.0)
    other = town.vehicle("other", EAST, 20.0)
    trace = drive(town, car, other, whens=whens, signals=(shows_red(town, NORTH),))
    fired = [(e.detail["index"], e.time_s) for e in trace.events if e.what == "trigger"]
    assert [index for index, _ in fired] == [1, 0]
    assert fired[0][1] == 0.0
    assert 1.5 < fired[1][1] < 5.0
    assert trace.states[-1, 1, Y] > 120.0
