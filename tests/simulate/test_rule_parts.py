"""The parts of the traffic rules: who is made to brake by whom, who could still stop, how long a breach has to last."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from foresee_dsl.compile.roads.conflicts import Conflict
from foresee_dsl.compile.roads.route_line import Passage
from foresee_dsl.compile.roads.topology import Movement
from foresee_dsl.simulate.rules.giving_way import Contender, YieldArea
from foresee_dsl.simulate.rules.stopping import LineAhead, can_stop

OWN = Movement("a", "b", "a_0", "b_0", ("v_0",), "j", "straight", "s", None, -1, 0, frozenset({"car"}))
CROSSING_WAY = replace(OWN, from_lane="c_0", to_lane="d_0")
JOINING_WAY = replace(OWN, from_lane="c_0")


def area(of: Movement, *contenders: Contender, pedestrian: bool = False) -> YieldArea:
    conflict = Conflict(np.zeros((2, 2)), 0.0, (0.0, 4.0), (10.0, 14.0), True, pedestrian, "", -1, of)
    return YieldArea("j", 0.0, 4.0, conflict, OWN, entered_s=5.0, contenders=list(contenders))


@pytest.mark.parametrize(
    ("room_m", "speed_mps", "inside_s", "taken"),
    [
        (20.0, 10.0, 2.0, False),  # it comes there when the actor has left
        (17.0, 10.0, 2.0, False),  # 2 * 3 / 4 = 1.5 m/s^2 makes it late enough
        (13.1, 10.0, 2.0, True),  # 2 * 6.9 / 4 = 3.45 m/s^2
        (13.3, 10.0, 2.0, False),  # 3.35 m/s^2
        (14.5, 10.0, 9.0, True),  # it has to stop within 14.5 m: 3.45 m/s^2
        (15.0, 10.0, 9.0, False),  # 3.33 m/s^2
        (0.05, 0.8, 9.0, False),  # rooms under 0.1 m count as 0.1 m: 3.2 m/s^2
        (0.05, 0.9, 9.0, True),
    ],
)
def test_a_way_is_taken_from_a_vehicle_that_has_to_brake_harder_than_is_comfortable(
    room_m: float, speed_mps: float, inside_s: float, taken: bool
) -> None:
    contender = Contender("other", room_m, speed_mps)
    assert list(area(CROSSING_WAY, contender).taken_from(5.0 + inside_s, 10.0)) == ["other"] * taken


@pytest.mark.parametrize(
    ("room_m", "speed_mps", "own_mps", "taken"),
    [(10.0, 18.2, 10.0, False), (10.0, 18.3, 10.0, True), (1.0, 8.0, 10.0, False), (0.0, 10.8, 10.0, False)],
)
def test_who_joins_a_lane_counts_by_the_difference_of_speeds(
    room_m: float, speed_mps: float, own_mps: float, taken: bool
) -> None:
    """From 18.3 m/s to 10 m/s within 10 m takes 3.44 m/s^2."""
    contender = Contender("other", room_m, speed_mps)
    assert list(area(JOINING_WAY, contender).taken_from(9.0, own_mps)) == ["other"] * taken


@pytest.mark.parametrize(("room_m", "speed_mps", "taken"), [(0.0, 0.0, True), (2.8, 1.4, True), (2.9, 1.4, False)])
def test_a_pedestrian_is_hindered_who_would_be_in_the_way_before_the_actor_has_left(
    room_m: float, speed_mps: float, taken: bool
) -> None:
    contender = Contender("walker", room_m, speed_mps)
    assert list(area(CROSSING_WAY, contender, pedestrian=True).taken_from(7.0, 5.0)) == ["walker"] * taken


def test_an_actor_can_stop_after_a_reaction_of_0_75_s_with_3_4_mps2() -> None:
    needed_m = 10 * 0.75 + 100 / 6.8
    assert can_stop(needed_m + 0.01, 10.0) and not can_stop(needed_m - 0.01, 10.0)
    assert can_stop(0.0, 0.0)


def line() -> LineAhead:
    return LineAhead(Passage("j", 100.0, 120.0, OWN), must_stop=True)


def test_a_light_that_leaves_green_too_late_to_stop_binds_only_after_the_next_green() -> None:
    stop = line()
    assert not stop.see("green", 30.0, 10.0) and stop.could_stop
    stop.see("amber", 20.0, 10.0)  # 22.2 m are needed
    assert not stop.could_stop
    stop.see("red", 19.0, 10.0)
    assert not stop.could_stop
    stop.see("green", 18.0, 1.0)
    assert stop.could_stop
    stop.see("red", 17.0, 1.0)
    assert stop.could_stop


def test_what_was_too_late_at_the_first_frame_stays_too_late_at_amber() -> None:
    stop = line()
    stop.could_stop = False
    stop.see("amber", 100.0, 1.0)
    assert not stop.could_stop


def test_a_light_is_red_at_a_line_if_it_was_red_at_two_frames() -> None:
    stop = line()
    assert [stop.see(colour, 50.0, 1.0) for colour in ("amber", "red", "red", "amber", "red")] == [
        False, False, True, False, False,
    ]  # fmt: skip


def test_the_slowest_speed_is_that_within_5_m_of_the_inner_lanes() -> None:
    stop = line()
    stop.slow(5.1, 0.0)
    assert math.isinf(stop.slowest_mps)
    for room_m, speed_mps in ((4.9, 3.0), (3.0, 1.0), (1.0, 2.0)):
        stop.slow(room_m, speed_mps)
    assert stop.slowest_mps == 1.0
