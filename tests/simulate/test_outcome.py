"""What kind of failure a collision is, and when a run is over. North is up, east to the right; > < ^ v are bonnets."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foresee_dsl.compile.bundle import ActorKind
from foresee_dsl.drivers.protocol import VehicleLimits
from foresee_dsl.kernels.boxes import Mover, overlaps
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState
from foresee_dsl.simulate.results.outcome import (
    FLUSH_M,
    OutcomeJudge,
    RunEnd,
    classify,
    impact,
    off_road_points,
)
from foresee_dsl.simulate.results.verdict import Verdict

EAST, NORTH, WEST, SOUTH = 0.0, math.pi / 2, math.pi, -math.pi / 2
DEG = math.radians(1)


def car(x: float, y: float, heading: float, speed: float) -> Mover:
    return Mover(x, y, heading, speed, 4.0, 2.0)


EGO = car(0, 0, EAST, 10)
CASES = {
    # [ego>][<other]
    "head on": (EGO, car(3.5, 0, WEST, 10), Verdict.F3),
    # [ego>]
    #     [<other]     a quarter of the width, 1 m deep at 20 Hz
    "head on with small overlap": (EGO, car(3.0, -1.5, WEST, 10), Verdict.F3),
    # [ego>] /other comes at 30 degrees off opposite
    "head on askew": (EGO, car(3.6, 0.5, WEST + 30 * DEG, 10), Verdict.F3),
    # [ego>][other>]   ego runs up
    "ego strikes": (EGO, car(3.8, 0, EAST, 2), Verdict.F5),
    # [other>][ego>]   ego is run up to
    "ego is struck": (car(0, 0, EAST, 2), car(-3.8, 0.5, EAST, 12), Verdict.F5),
    # [ego>][other>]   it stands
    "ego strikes what stands": (EGO, car(3.9, -0.8, EAST, 0), Verdict.F5),
    # [ego>] other has turned in by 20 degrees and is struck in the rear
    "ego strikes what turns": (EGO, car(3.7, 0, 20 * DEG, 4), Verdict.F5),
    #        [o]
    # [ego>] [^]       into the side of what crosses
    "ego strikes a side": (EGO, car(2.8, 0, NORTH, 8), Verdict.F4),
    # [ego>]
    #    [^]           struck in the side
    #    [o]
    "ego is struck in the side": (EGO, car(0, -2.9, NORTH, 15), Verdict.F4),
    # [other>]
    # [ego>]           side by side, drifting together by 5 degrees
    "side swipe": (EGO, car(0.5, 1.95, -5 * DEG, 10), Verdict.F4),
    # [<other]
    # [ego>]           oncoming, drifting into ego's side
    "oncoming side swipe": (car(0, 0, EAST, 0.5), car(-0.5, 1.95, WEST + 10 * DEG, 5), Verdict.F4),
    # Corner to corner, coming from the side at 60 degrees: neither opposite nor equal.
    "from the side at an angle": (EGO, car(2.6, -1.6, 60 * DEG, 10), Verdict.F4),
}


@pytest.mark.parametrize("name", CASES)
def test_kind_of_collision(name: str) -> None:
    ego, other, expected = CASES[name]
    assert overlaps(ego.box, other.box)
    assert classify(impact(ego, other, "it"), "car") is expected


@pytest.mark.parametrize("name", CASES)
def test_the_kind_does_not_depend_on_which_of_the_two_is_the_ego(name: str) -> None:
    ego, other, expected = CASES[name]
    assert classify(impact(other, ego, "it"), "truck") is expected


@given(turn=st.floats(-7, 7), name=st.sampled_from(sorted(CASES)), mirrored=st.booleans())
def test_the_kind_does_not_depend_on_the_compass_or_the_side_of_traffic(turn: float, name: str, mirrored: bool) -> None:
    ego, other, expected = CASES[name]
    side = -1 if mirrored else 1
    c, s = math.cos(turn), math.sin(turn)

    def moved(m: Mover) -> Mover:
        x, y = m.x, side * m.y
        return m._replace(x=x * c - y * s + 40, y=x * s + y * c - 7, heading=side * m.heading + turn)

    assert classify(impact(moved(ego), moved(other), "it"), "car") is expected


def test_what_is_hit_decides_first() -> None:
    ego, other, _ = CASES["head on"]
    assert classify(impact(ego, other, "it"), "obstacle") is Verdict.F1
    assert classify(impact(ego, other, "it"), "pedestrian") is Verdict.F2
    kinds: tuple[ActorKind, ...] = ("car", "van", "truck", "bus", "motorcycle", "bicycle")
    assert {classify(impact(ego, other, "it"), kind) for kind in kinds} == {Verdict.F3}


def sides(ego: Mover, other: Mover) -> tuple[str, str]:
    contact = impact(ego, other, "it")
    return contact.side, contact.other_side


def test_deep_overlap_does_not_turn_a_front_into_a_side() -> None:
    # 20 m/s each: 2 m deep after one step, while only 0.5 m of the width overlaps.
    ego, other = car(0, 0, EAST, 20), car(2.0, 1.5, WEST, 20)
    assert sides(ego, other) == ("front", "front")


def test_sides_when_nothing_moves() -> None:
    assert sides(car(0, 0, EAST, 0), car(3.9, 0, EAST, 0)) == ("front", "rear")
    assert sides(car(0, 0, EAST, 0), car(0, 1.9, EAST, 0)) == ("left", "right")


# ------------------------------------------------------------------------------------------------ the impact


IMPACTS = {
    # ego 10 m/s into one that goes on with 2 m/s in front of it, half a metre to its right
    "ego runs up": (EGO, car(3.8, -0.5, EAST, 2), ("front", "rear", 2.0, -0.25, 0.0, "ego", 8.0, 8.0)),
    "ego is run up to": (
        car(0, 0, EAST, 2),
        car(-3.8, 0, EAST, 12),
        ("rear", "front", -2.0, 0.0, 0.0, "other", 10, 10),
    ),
    "head on": (EGO, car(3.5, 0.8, WEST, 5), ("front", "front", 2.0, 0.4, math.pi, "both", 15.0, 15.0)),
    # one from the right, its bonnet (y from -1 to 1 of it) into ego's right side 1 m behind the middle
    "struck on the right": (
        car(0, 0, EAST, 0),
        car(-1.0, -2.9, NORTH, 6),
        ("right", "front", -1.0, -1.0, math.pi / 2, "other", 6.0, 6.0),
    ),
    "struck on the left": (
        car(0, 0, EAST, 0),
        car(0.5, 2.9, SOUTH, 6),
        ("left", "front", 0.5, 1.0, -math.pi / 2, "other", 6.0, 6.0),
    ),
    # ego's bonnet into the left side of one that stands across
    "ego strikes a side": (EGO, car(2.9, 0.0, NORTH, 0), ("front", "left", 2.0, 0.0, math.pi / 2, "ego", 10.0, 10.0)),
    # side by side at 10 m/s, the other drifts in by 10 degrees: a corner of it at ego's left side, closing 1.74 m/s
    "drifts in": (
        EGO,
        car(0, 2.29, -10 * DEG, 10),
        ("left", "right", None, 1.0, -10 * DEG, "other", 20 * math.sin(5 * DEG), 10 * math.sin(10 * DEG)),
    ),
}


@pytest.mark.parametrize("name", IMPACTS)
def test_impact_by_hand(name: str) -> None:
    ego, other, (side, theirs, ahead, left, turned, striker, relative, closing) = IMPACTS[name]
    assert overlaps(ego.box, other.box)
    found = impact(ego, other, "runner")
    assert (found.side, found.other_side, found.struck_by) == (side, theirs, striker)
    assert found.left_m == pytest.approx(left, abs=1e-9)
    assert ahead is None or found.ahead_m == pytest.approx(ahead, abs=1e-9)
    assert abs(math.remainder(found.turned_rad - turned, math.tau)) < 1e-9
    assert (found.relative_mps, found.closing_mps) == pytest.approx((relative, closing))
    assert (found.ego_mps, found.other_mps) == (ego.speed, other.speed)


def test_a_corner_touches_where_it_is() -> None:
    # The other stands askew to the left; its corner that lies lowest touches ego's left side, which is at y = 1.
    heading = SOUTH - 30 * DEG
    x = 0.4
    c, s = math.cos(heading), math.sin(heading)
    corners = [(2 * c - side * s, 2 * s + side * c) for side in (1, -1)]
    lowest = min(corners, key=lambda corner: corner[1])
    other = car(x - lowest[0], 1.0 - lowest[1], heading, 0.0)  # that corner at (0.4, 1)
    found = impact(car(0, 0, EAST, 0), other, "runner")
    assert (found.side, found.ahead_m, found.left_m) == ("left", pytest.approx(0.4), pytest.approx(1.0))


poses = st.tuples(st.floats(-4, 4), st.floats(-4, 4), st.floats(-3, 3), st.floats(0, 15))


@given(poses, st.floats(0, 15))
def test_the_place_is_on_egos_outline_and_the_other_sees_the_same(pose: tuple[float, ...], speed: float) -> None:
    ego, other = car(0, 0, EAST, speed), Mover(*pose, 4.0, 2.0)
    if not overlaps(ego.box, other.box):
        return
    found, turned = impact(ego, other, "other"), impact(other, ego, "ego")
    on_a_side = abs(abs(found.ahead_m) - 2) < FLUSH_M or abs(abs(found.left_m) - 1) < FLUSH_M
    assert on_a_side
    assert abs(found.ahead_m) <= 2 + FLUSH_M
    assert abs(found.left_m) <= 1 + FLUSH_M
    assert found.relative_mps == pytest.approx(turned.relative_mps)
    assert abs(found.closing_mps) <= found.relative_mps + 1e-9


# ---------------------------------------------------------------------------------------------- the judge

FAR = [100.0, 100.0, 0.0]


def judge(**values: object) -> OutcomeJudge:
    settings: dict[str, object] = {
        "ids": ["runner", "walker", "crate"],
        "kinds": ["car", "pedestrian", "obstacle"],
        "sizes": np.array([[4.0, 2.0], [0.5, 0.5], [1.0, 1.0]]),
        "ego_size": (4.0, 2.0),
        "end_s": 60.0,
        **values,
    }
    return OutcomeJudge(**settings)  # type: ignore[arg-type]  # tests vary single arguments


def look(watcher: OutcomeJudge, time_s: float, *poses: list[float], speed: float = 10.0, **seen: bool) -> RunEnd | None:
    rows = np.array([*poses, *[FAR] * (3 - len(poses))])
    flags = {"off_road": False, "arrived": False, "may_wait": False, **seen}
    return watcher.look(time_s, BicycleState(0, 0, 0, speed), rows, np.full(3, 5.0), **flags)


def test_collisions_are_named() -> None:
    decision = look(judge(), 3.15, [2.8, 0, NORTH])
    assert decision is not None
    assert decision.reason == "F4 lateral collision with runner (car) at 3.15 s, 11.2 m/s"  # 10 east and 5 north
    assert (decision.verdict, decision.time_s, decision.with_) == (Verdict.F4, 3.15, "runner")
    decision = look(judge(), 1.0, FAR, [2.1, 0, NORTH])
    assert decision is not None
    assert decision.verdict is Verdict.F2
    assert decision.reason == "F2 collision with walker (pedestrian) at 1.00 s, 11.2 m/s"
    decision = look(judge(), 1.0, FAR, FAR, [2.1, 0, 0])
    assert decision is not None
    assert decision.verdict is Verdict.F1
    assert decision.reason == "F1 collision with crate (obstacle) at 1.00 s, 5.0 m/s"
    assert decision.impact is not None
    assert (decision.impact.with_, decision.impact.side) == ("crate", "front")


def test_what_touches_at_the_first_frame_is_invalid() -> None:
    decision = look(judge(), 0.0, [2.8, 0, NORTH])
    assert decision is not None
    assert (decision.verdict, decision.with_) == (Verdict.INVALID, "runner")
    decision = look(judge(), 0.0, off_road=True)
    assert decision is not None
    assert decision.verdict is Verdict.INVALID


def test_off_the_road_arrival_and_time() -> None:
    assert look(judge(), 5.0) is None
    off = look(judge(), 5.0, off_road=True, arrived=True)
    assert off == RunEnd(Verdict.F1, 5.0, "", "F1 left the drivable area at 5.00 s")
    there = look(judge(), 5.0, arrived=True)
    assert there == RunEnd(Verdict.PASS, 5.0, "", "arrived at 5.00 s")
    late = look(judge(must_arrive=True), 1200 * 0.05)
    assert late is not None
    assert late.verdict is Verdict.TIMEOUT
    free = look(judge(), 60.0)
    assert free is not None
    assert free.verdict is Verdict.PASS


def test_a_collision_comes_before_an_arrival() -> None:
    decision = look(judge(), 5.0, [2.8, 0, NORTH], arrived=True, off_road=True)
    assert decision is not None
    assert decision.verdict is Verdict.F4


def frames_until_stuck(waits: range) -> float | None:
    watcher = judge()
    for k in range(1000):
        decision = look(watcher, k * 0.05, speed=0.0 if k >= 40 else 5.0, may_wait=k in waits)
        if decision is not None:
            assert decision.verdict is Verdict.STUCK
            return decision.time_s
    return None


def test_stuck_after_standing_with_nothing_to_wait_for() -> None:
    assert frames_until_stuck(range(0)) == pytest.approx(2.0 + 20.0)
    assert frames_until_stuck(range(0, 200)) == pytest.approx(10.0 + 20.0)  # a red signal until 10 s
    assert frames_until_stuck(range(700, 1000)) == pytest.approx(22.0)
    assert frames_until_stuck(range(400, 1000)) is None
    assert frames_until_stuck(range(240, 241)) == pytest.approx(12.05 + 20.0)  # a moment with something to wait for


def test_lists_must_match() -> None:
    with pytest.raises(ValueError, match="3 kinds"):
        judge(ids=["runner"])


def test_a_wheel_over_the_kerb_is_off_the_road_and_the_bumper_is_not() -> None:
    limits = VehicleLimits("car", 4.7, 1.8, 2.8, 0.9, 50, 3, 4, 8, 0.6, 7)
    bicycle = Bicycle(limits)
    # The kerb is the line y = 0; the car drives along it, then stands square to it with its nose over it.
    along = off_road_points(bicycle, BicycleState(0, 0.65, EAST, 5))
    assert min(y for _, y in along) > 0  # 0.25 m of the body hang over
    over = off_road_points(bicycle, BicycleState(0, 0.55, EAST, 5))
    assert min(y for _, y in over) < 0
    nose = off_road_points(bicycle, BicycleState(0, 1.6, SOUTH, 5))
    assert min(y for _, y in nose) > 0  # 0.75 m of bonnet


def test_a_step_forward_begins_the_stand_anew() -> None:
    watcher = judge()
    decisions = (look(watcher, k * 0.05, speed=1.0 if k == 300 else 0.0) for k in range(1, 1000))  # it moves after 15 s
    ended = next(decision for decision in decisions if decision is not None)
    assert (ended.verdict, ended.time_s) == (Verdict.STUCK, pytest.approx(15.05 + 20.0))
