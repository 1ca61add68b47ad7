"""When a careful driver sees a risk: tracks whose answers are worked out by hand. East is ahead."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from foresee_dsl.avoidance.r157.risk import (
    Perception,
    RecordedPath,
    critical_time_s,
    other_at,
    perceive,
    predicted,
)
from foresee_dsl.kernels.boxes import Mover, box_overlap
from foresee_dsl.simulate.results.outcome import impact
from foresee_dsl.simulate.sensing.sight import in_view
from foresee_dsl.simulate.trace import ACCELERATION, STEP_S, YAW_RATE, X
from tests.support.handmade_traces import EAST, NORTH, WEST, Track, clear_sight, make_trace, straight


def seen(ego: Track, other: Track, end_s: float | None = None) -> Perception | None:
    """What is perceived in a run that ends with the contact, or at a time."""
    trace = make_trace({"ego": ego, "other": other})
    if end_s is None:
        met = np.flatnonzero(box_overlap(trace.boxes(0), trace.boxes(1)))
        frames = int(met[0]) + 1 if met.size else trace.frames
    else:
        frames = round(end_s / STEP_S) + 1
    part = replace(trace, time_s=trace.time_s[:frames], states=trace.states[:frames])
    return perceive(part, 1, clear_sight(part))


def test_what_is_slower_ahead_is_a_risk_two_seconds_before() -> None:
    # Bumpers 40 m apart, closing with 10 - 4 = 6 m/s: 12 m are left after 4.67 s, looked at every 0.05 s.
    found = seen(straight("car", 0, 0, EAST, 10.0), straight("car", 44, 0, EAST, 4.0))
    assert found is not None
    assert found.onset_s == pytest.approx(4.70, abs=0.051)
    assert found.perceived_s == pytest.approx(found.onset_s + 0.4)
    assert found.brakes_s == pytest.approx(found.onset_s + 1.15)


def test_what_stands_is_a_risk_while_hard_braking_still_suffices() -> None:
    # 14 m/s to shed: 1.15 + 14 / 10 = 2.55 s, 35.7 m before the bumpers meet.
    assert critical_time_s(14.0, 0.0) == pytest.approx(2.55)
    assert critical_time_s(14.0, -10.0) == pytest.approx(2.55)
    assert critical_time_s(14.0, 9.0) == 2.0
    found = seen(straight("car", 0, 0, EAST, 14.0), straight("car", 74, 0, EAST, 0.0))
    assert found is not None
    assert found.onset_s == pytest.approx((70 - 35.7) / 14, abs=0.06)


@pytest.mark.parametrize(
    "other",
    [
        straight("car", 60, 0, EAST, 12.0),  # goes away
        straight("car", -30, 0, EAST, 11.0),  # comes from behind
        straight("car", 100, 3.3, WEST, 10.0),  # oncoming in its own lane
        straight("car", 30, 2.6, EAST, 5.0),  # 2.6 - 1.8 = 0.8 m beside, more than 0.375 m
        straight("pedestrian", 60, -30, NORTH, 1.4),  # comes when the ego has gone
    ],
)
def test_what_keeps_out_of_the_corridor_is_none(other: Track) -> None:
    assert seen(straight("car", 0, 0, EAST, 10.0), other) is None


def test_what_wanders_into_the_margin_is_one() -> None:
    # 2.1 - 1.8 = 0.3 m beside; the fronts are level after 8 s.
    assert seen(straight("car", 0, 0, EAST, 10.0), straight("car", 40, 2.1, EAST, 5.0), end_s=7.5) is not None


def test_what_crosses_is_seen_two_seconds_before_it_is_in_the_way() -> None:
    found = seen(straight("car", 0, 0, EAST, 5.0), straight("car", 32, -48, NORTH, 8.0))
    # The other's front is in the corridor (1.275 m wide to a side) from 5.59 s on. The ego's front comes to the other's
    # side (32 - 0.9 m) with its middle at 29.1 m: at 5.82 s. That is the touch; 2 s before it is 3.82 s.
    assert found is not None
    assert found.onset_s == pytest.approx(3.85, abs=0.06)


def test_a_risk_that_has_passed_is_another_one() -> None:
    # A car that stands 50 m ahead from 3.0 s on, for so long; the run ends when it has been away for `gone`.
    def after(there_s: float, gone_s: float, again_s: float = 0.0) -> Perception | None:
        other = straight("car", 200, 0, EAST, 0.0)
        back = 3.0 + there_s + gone_s
        for begin, end in ((3.0, 3.0 + there_s), (back, back + again_s)):
            other.states[round(begin / STEP_S) : round(end / STEP_S), X] = 50.0
        return seen(straight("car", 0, 0, EAST, 10.0), other, end_s=back + again_s)

    assert after(0.5, 0.3) == Perception(3.0, at_once=False)
    assert after(0.5, 0.6) is None
    assert after(0.2, 0.3, 0.3) == Perception(3.0, at_once=False)
    assert after(0.2, 0.5, 0.3) == Perception(3.7, at_once=False)


def test_the_risk_of_the_first_frame_is_said() -> None:
    found = seen(straight("car", 0, 0, EAST, 10.0), straight("car", 10, 0, EAST, 2.0))
    assert found == Perception(0.0, at_once=True)


def predicted_from(column: int, value: float, after_s: list[float]) -> np.ndarray:
    """Where a car at 4 m/s eastwards from (0, 0) will be when one of its states has this value."""
    track = straight("car", 0, 0, EAST, 4.0)
    track.states[:, column] = value
    now = other_at(make_trace({"ego": straight("car", -50, 0, EAST, 0.0), "b": track}), 1, 0)
    assert now is not None
    return predicted(now, np.array(after_s))


def test_a_prediction_brakes_to_a_stand_and_turns() -> None:
    assert predicted_from(ACCELERATION, -2.0, [1.0, 9.0])[:, 0] == pytest.approx([4.0 - 1.0, 4.0])  # 4^2 / (2 * 2)
    assert predicted_from(ACCELERATION, 2.0, [1.0, 9.0])[:, 0] == pytest.approx([4.0, 36.0])
    # 0.4 rad/s at 4 m/s is a radius of 10 m; a quarter of the circle takes pi / 0.8 seconds.
    assert predicted_from(YAW_RATE, 0.4, [math.pi / 0.8])[0, :3] == pytest.approx([10.0, 10.0, math.pi / 2])


def test_the_recorded_way_is_driven_by_length() -> None:
    path = RecordedPath(make_trace({"ego": straight("car", 3, 0, NORTH, 2.0, seconds=4.0, start_s=2.0)}))
    assert path.along[-1] == pytest.approx(4.0)
    assert path.at(np.array([0.0, 1.0, 6.0]))[:, 1] == pytest.approx([0.0, 1.0, 6.0], abs=1e-6)
    assert path.at(np.array([6.0]))[0, 0] == pytest.approx(3.0)


def test_a_van_hides_and_a_crate_does_not() -> None:
    for kind, hidden in (("van", True), ("obstacle", False)):
        trace = make_trace(
            {
                "ego": straight("car", 0, 0, EAST, 8.0),
                "walker": straight("pedestrian", 30, -3, NORTH, 1.4),
                "between": straight(kind, 25, -2.5, EAST, 0.0),
            }
        )
        assert in_view(trace, 1, 0, clear_sight(trace)) is not hidden
    # Beside the van: seen once the ego's line of sight is past its corner.
    assert in_view(trace, 2, 0, clear_sight(trace))


def mover(x: float, y: float, heading: float, speed: float) -> Mover:
    return Mover(x, y, heading, speed, 4.0, 2.0)


@pytest.mark.parametrize(
    ("b", "speed", "striker"),
    [
        (mover(3.9, 0, EAST, 2.0), 10.0, "ego"),  # runs up
        (mover(-3.9, 0, EAST, 12.0), 2.0, "other"),  # is run up to
        (mover(2.9, 0, NORTH, 8.0), 10.0, "ego"),  # into a side
        (mover(0, -2.9, NORTH, 8.0), 10.0, "other"),  # in the side
        (mover(3.8, 0, WEST, 8.0), 10.0, "both"),
        (mover(3.9, 0, WEST, 8.0), 0.0, "other"),
        (mover(3.9, 0, WEST, 0.0), 8.0, "ego"),
        (mover(0, 1.9, EAST, 5.0), 10.0, "neither"),  # side by side
    ],
)
def test_who_struck_whom(b: Mover, speed: float, striker: str) -> None:
    a = mover(0, 0, EAST, speed)
    assert impact(a, b, "b").struck_by == striker
    assert impact(b, a, "a").struck_by == {"ego": "other", "other": "ego"}.get(striker, striker)
