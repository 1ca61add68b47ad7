"""How a passing driver differs from a failing one, where the actor that was hit stands: on straight tracks."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from foresee_dsl.avoidance.comparison import RunComparison, compared
from foresee_dsl.simulate.trace import ACCELERATION, SPEED, STEP_S, Event, Trace, X, Y
from tests.support.handmade_traces import EAST, NORTH, Track, make_trace, straight

NO_BUNDLE: Any = SimpleNamespace()
"""An actor that stands needs no map: the conflict can be foreseen from the beginning."""
END_S, Y_M = 5.0, 20.0
"""Time of the contact, and place of the straight road."""
VAN = straight("van", 50.0 + 5.0, Y_M, EAST, 0.0, seconds=8.0)


def slowing(begin_s: float, decel_mps2: float, *, seconds: float, least_mps: float = 0.0) -> Track:
    """A car from x = 0 at 10 m/s that brakes from a time on, down to a speed."""
    track = straight("car", 0.0, Y_M, EAST, 10.0, seconds=seconds)
    time_s = np.arange(len(track.states)) * STEP_S
    speed = np.clip(10.0 - decel_mps2 * np.maximum(time_s - begin_s, 0.0), least_mps, None)
    track.states[:, SPEED] = speed
    track.states[:, X] = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * STEP_S)])
    track.states[:, ACCELERATION] = np.where((time_s >= begin_s) & (speed > least_mps), -decel_mps2, 0.0)
    return track


def trace_of(ego: Track, *, hits: bool = False) -> Trace:
    frames = len(ego.states)
    van = replace(VAN, states=VAN.states[:frames])
    events = [Event(END_S, "ego", "collision", {"with": "van"})] if hits else []
    return make_trace({"ego": ego, "van": van}, events=events)


FAILED = trace_of(slowing(9.0, 1.0, seconds=END_S), hits=True)
"""The ego drives at 10 m/s to x = 50 m, where it touches the van."""


def against(ego: Track, failed: Trace = FAILED) -> RunComparison:
    return compared(failed, trace_of(ego), NO_BUNDLE)


def beside(aside_m: float, from_s: float) -> Track:
    """A car that is aside, m to the left, from a time on."""
    track = slowing(9.0, 1.0, seconds=7.0)
    track.states[round(from_s / STEP_S) :, Y] += aside_m
    return track


def test_braking_is_told_with_its_time_before_the_contact() -> None:
    assert against(slowing(3.3, 4.0, seconds=8.0)).how == ("brakes 1.7 s before it", "stays 4.5 m away from the place")


@pytest.mark.parametrize(
    ("decel_mps2", "how"),
    [(0.9, ()), (1.1, ("brakes 1.0 s before it", "is 4 km/h slower there"))],
)
def test_who_only_rolls_out_does_not_brake(decel_mps2: float, how: tuple[str, ...]) -> None:
    assert against(slowing(4.0, decel_mps2, seconds=8.0)).how == how


@pytest.mark.parametrize(
    ("aside_m", "from_s", "how"),
    [
        (1.5, 2.0, ("passes 1.5 m farther left",)),
        (-1.5, 2.0, ("passes 1.5 m farther right",)),
        (0.4, 2.0, ("passes 0.4 m farther left",)),
        (0.25, 2.0, ()),  # no more than the sensors' error
        (1.5, 0.0, ()),  # it has always been there
    ],
)
def test_evading_is_a_change_of_the_lateral_place(aside_m: float, from_s: float, how: tuple[str, ...]) -> None:
    assert against(beside(aside_m, from_s)).how == how


def test_who_ends_in_the_same_line_has_not_evaded() -> None:
    track = slowing(9.0, 1.0, seconds=7.0)
    track.states[: round(1.0 / STEP_S), Y] += 1.5
    assert against(track).how == ()


def test_who_takes_another_way_is_not_compared() -> None:
    other = straight("car", 0.0, Y_M, NORTH, 10.0, seconds=8.0)
    assert against(other) == RunComparison(apart="it takes another way")
    six_m_aside = straight("car", 0.0, Y_M + 5.9, EAST, 10.0, seconds=8.0)
    assert against(six_m_aside).apart == ""


@pytest.mark.parametrize(
    ("begin_s", "apart"),
    [
        (1.5, ""),  # it stands at x = 40 m, because of the van
        (0.5, "it takes another way"),  # 4.5 s before the van: too early to be because of it
    ],
)
def test_a_driver_that_stops_far_before_a_standing_actor_reacts_to_it(begin_s: float, apart: str) -> None:
    comparison = against(slowing(begin_s, 2.0, seconds=8.0))
    assert comparison.apart == apart
    if not apart:
        assert comparison.how == ("brakes 3.5 s before it", "stays 10 m away from the place")


def test_a_driver_that_stops_behind_another_actor_is_not_compared() -> None:
    ego = slowing(1.5, 2.0, seconds=8.0)
    van = replace(VAN, states=VAN.states[: len(ego.states)])
    for y_m, apart in ((Y_M, "it takes another way"), (Y_M + 4.0, "")):
        queue = straight("car", 48.0, y_m, EAST, 0.0, seconds=8.0)
        queue = replace(queue, states=queue.states[: len(ego.states)])
        passed = make_trace({"ego": ego, "van": van, "queue": queue})
        assert compared(FAILED, passed, NO_BUNDLE).apart == apart


def test_a_driver_that_brakes_and_turns_off_takes_another_way() -> None:
    ego = slowing(1.5, 2.0, seconds=8.0, least_mps=4.0)
    from_frame = round(4.6 / STEP_S)  # at x = 32 m, before it comes within 6 m of the place
    turned = ego.states[from_frame:, X] - ego.states[from_frame, X]
    ego.states[from_frame:, X] = ego.states[from_frame, X]
    ego.states[from_frame:, Y] += turned
    assert against(ego).apart == "it takes another way"


def test_waiting_counts_as_a_reaction() -> None:
    waits = straight("car", 0.0, Y_M, EAST, 10.0, seconds=12.0, start_s=6.0)
    failed = trace_of(slowing(9.0, 1.0, seconds=END_S), hits=True)
    van = replace(VAN, states=np.repeat(VAN.states[:1], len(waits.states), axis=0))
    passed = make_trace({"ego": waits, "van": van})
    assert compared(failed, passed, NO_BUNDLE).how[0] == "waits"


@pytest.mark.parametrize(
    ("begin_s", "decel_mps2", "how"),
    [
        (2.7, 2.0, ("brakes 0.3 s earlier",)),
        (2.8, 2.0, ()),  # two decisions of a driver
        (3.0, 3.1, ("brakes with 3.1 instead of 2.0 m/s^2",)),
        (3.0, 2.9, ("brakes longer",)),
    ],
)
def test_of_two_who_brake_the_earlier_then_the_harder_counts(
    begin_s: float, decel_mps2: float, how: tuple[str, ...]
) -> None:
    failed = trace_of(slowing(3.0, 2.0, seconds=END_S, least_mps=6.0), hits=True)
    passed = trace_of(slowing(begin_s, decel_mps2, seconds=6.0))
    assert compared(failed, passed, NO_BUNDLE).how[:1] == how


def test_braking_long_after_the_failure_is_no_reaction_to_it() -> None:
    failed = trace_of(slowing(3.0, 2.0, seconds=END_S, least_mps=6.0), hits=True)
    ego = slowing(3.0, 2.0, seconds=12.0, least_mps=6.0)
    ego.states[round(8.5 / STEP_S) :, ACCELERATION] = -6.0  # 3.5 s after the failure
    van = replace(VAN, states=np.repeat(VAN.states[:1], len(ego.states), axis=0))
    assert compared(failed, make_trace({"ego": ego, "van": van}), NO_BUNDLE).how == ()


def test_without_another_actor_every_passing_driver_avoids_it() -> None:
    alone = make_trace({"ego": slowing(9.0, 1.0, seconds=END_S)})
    assert compared(alone, FAILED, NO_BUNDLE) == RunComparison(("drives on",))
    absent = make_trace({"ego": slowing(9.0, 1.0, seconds=8.0)})
    assert compared(FAILED, absent, NO_BUNDLE) == RunComparison(apart="van is not there")
