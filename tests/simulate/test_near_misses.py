"""How near runs came to a failure, on cases with an answer worked out by hand. Cars are 4 m x 1.8 m."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foresee_dsl.documents import plain
from foresee_dsl.simulate.results.near_misses import HORIZON_S, NearMiss, near_misses
from foresee_dsl.simulate.trace import STEP_S, Trace
from tests.support.handmade_traces import EAST, NORTH, SIZES, WEST, Track, make_trace, straight, until
from tests.support.plain_metrics import minimum_distance, pet

STEP_OFF_MPS2 = 2.5


def along(xs: np.ndarray, speeds: np.ndarray, y: float = 0.0) -> Track:
    """A car that goes east with given places and speeds."""
    states = np.zeros((len(xs), 7))
    states[:, 0], states[:, 1], states[:, 3] = xs, y, speeds
    return Track("car", states)


def on_circle(radius: float, turns: float, speed: float, begins: float = 0.0) -> Track:
    """A car on a circle about the origin: `turns` is 1 (counter-clockwise) or -1; it begins at an angle."""
    angle = begins + turns * np.arange(101) * STEP_S * speed / radius
    states = np.zeros((101, 7))
    states[:, 0], states[:, 1] = radius * np.cos(angle), radius * np.sin(angle)
    states[:, 2], states[:, 3] = angle + turns * math.pi / 2, speed
    return Track("car", states)


def value(found: NearMiss | None) -> tuple[float, float, str] | None:
    return None if found is None else (found.value, found.time_s, found.actor)


def test_two_in_line() -> None:
    # 30 m of room at first, 15 m after 3 s, closing with 5 m/s: 15 / 5 s, and 5^2 / (2 x 15) m/s^2.
    found = near_misses(
        make_trace(
            {"ego": straight("car", 0, 0, EAST, 10, seconds=3), "lead": straight("car", 34, 0, EAST, 5, seconds=3)}
        )
    )
    assert value(found.distance_m) == pytest.approx((15.0, 3.0, "lead"))
    assert value(found.ttc_s) == (pytest.approx(3.0, abs=1e-3), 3.0, "lead")
    assert value(found.drac_mps2) == (pytest.approx(25 / 30, abs=1e-3), 3.0, "lead")
    assert found.pet_s is None  # a time gap is none


def test_crossing_with_one_second_between() -> None:
    # The other's middle is at the crossing 1.58 s after ego's. Ego's tail leaves the square 0.29 s after its middle,
    # the other's front comes to it 0.29 s before its own: 1.0 s. With the speeds kept they never touch.
    ego = straight("car", -30, 0, EAST, 10)
    other = straight("car", 0, -45.8, NORTH, 10)
    found = near_misses(make_trace({"ego": ego, "other": other}))
    assert found.pet_s is not None
    assert found.pet_s.value == pytest.approx(1.0, abs=STEP_S + 1e-9)
    # The other comes into the square at 3 + 1.58 - 0.29 s.
    assert found.pet_s.time_s == pytest.approx(4.29, abs=STEP_S + 1e-9)
    assert (found.ttc_s, found.drac_mps2) == (None, None)
    # Nearest when ego's tail is as far beyond the other's side as the other's front is short of ego's: 5 m each.
    assert value(found.distance_m) == (pytest.approx(math.hypot(5, 5), abs=0.01), 3.8, "other")


def test_crossing_that_would_meet() -> None:
    # The other's near side is at x = 19.1, which ego's front reaches after 1.71 s; its front is then at y = 0.55.
    # Looked at until 1 s: 0.71 s and 7.1 m are left.
    ego, other = (
        straight("car", 0, 0, EAST, 10, seconds=1.0),
        straight("car", 20, -10, NORTH, 5, seconds=1.0),
    )
    found = near_misses(make_trace({"ego": ego, "other": other}))
    assert value(found.ttc_s) == (pytest.approx(0.71, abs=1e-3), 1.0, "other")
    assert value(found.drac_mps2) == (pytest.approx(100 / (2 * 7.1), rel=2e-3), 1.0, "other")
    assert found.pet_s is None  # nobody has been there yet


def test_head_on() -> None:
    # After 1 s 20 m are left of 40, closing with 20 m/s: 1 s, and 20^2 / 40 m/s^2.
    ego, other = straight("car", 0, 0, EAST, 10, seconds=1), straight("car", 44, 0, WEST, 10, seconds=1)
    found = near_misses(make_trace({"ego": ego, "other": other}))
    assert value(found.ttc_s) == (pytest.approx(1.0, abs=1e-3), 1.0, "other")
    assert value(found.drac_mps2) == (pytest.approx(10.0, abs=0.02), 1.0, "other")


def test_oncoming_in_the_next_lane_is_no_near_miss() -> None:
    ego, other = straight("car", 0, 0, EAST, 10), straight("car", 100, 3.3, WEST, 10)
    found = near_misses(make_trace({"ego": ego, "other": other}))
    assert (found.ttc_s, found.pet_s, found.drac_mps2) == (None, None, None)
    assert value(found.distance_m) == (pytest.approx(1.5), pytest.approx(5.0, abs=0.2), "other")  # beside each other


def test_oncoming_in_the_next_lane_of_a_bend_is_none_either() -> None:
    # Straight ahead each would run into the other's lane within 2 s.
    found = near_misses(make_trace({"ego": on_circle(20, 1, 8), "other": on_circle(23.3, -1, 8, begins=2.5)}))
    assert found.distance_m is not None
    assert 1.0 < found.distance_m.value < 1.6
    assert (found.ttc_s, found.pet_s, found.drac_mps2) == (None, None, None)


def test_everybody_stands() -> None:
    found = near_misses(make_trace({"ego": straight("car", 0, 0, EAST, 0), "other": straight("car", 6, 0, EAST, 0)}))
    assert value(found.distance_m) == pytest.approx((2.0, 0.0, "other"))
    assert (found.ttc_s, found.pet_s, found.drac_mps2) == (None, None, None)


def test_passing_a_parked_car() -> None:
    found = near_misses(
        make_trace({"ego": straight("car", 0, 0, EAST, 10), "parked": straight("car", 40, 2.3, EAST, 0)})
    )
    assert value(found.distance_m) == pytest.approx((0.5, 3.6, "parked"))
    assert (found.ttc_s, found.pet_s, found.drac_mps2) == (None, None, None)


def test_stopping_behind_a_parked_car() -> None:
    # From 10 m/s with 2.5 m/s^2 to a stand 3 m behind it. With g = 3 + v^2 / 5 left, g / v is least at v = sqrt(15):
    # 2 sqrt(3 / 5) s, after 2.45 s. v^2 / 2g grows with v: 100 / 46 m/s^2 at the beginning.
    time_s = np.arange(121) * STEP_S
    braking = np.minimum(time_s, 4.0)
    speeds = 10 - STEP_OFF_MPS2 * braking
    ego = along(10 * braking - STEP_OFF_MPS2 / 2 * braking**2, speeds)
    found = near_misses(make_trace({"ego": ego, "parked": straight("car", 27, 0, EAST, 0, seconds=6)}))
    assert found.ttc_s is not None
    assert found.ttc_s.value == pytest.approx(2 * math.sqrt(3 / 5), abs=2e-3)
    assert found.ttc_s.time_s == pytest.approx(2.45, abs=0.1)
    assert value(found.drac_mps2) == (pytest.approx(100 / 46, abs=2e-3), 0.0, "parked")
    assert value(found.distance_m) == pytest.approx((3.0, 4.0, "parked"))


def test_who_stands_and_is_struck_need_not_brake() -> None:
    # 8 m/s from behind, 6 m of room: they touch after 0.75 s.
    ego, tail = straight("car", 0, 0, EAST, 0, seconds=0.75), straight("car", -10, 0, EAST, 8, seconds=0.75)
    found = near_misses(make_trace({"ego": ego, "tail": tail}))
    assert value(found.ttc_s) == (pytest.approx(0.0, abs=1e-3), pytest.approx(0.75), "tail")
    assert found.drac_mps2 is None
    assert value(found.distance_m) == pytest.approx((0.0, 0.75, "tail"), abs=1e-9)


def test_a_contact_cannot_be_braked_away() -> None:
    ego, lead = straight("car", 0, 0, EAST, 10, seconds=1), straight("car", 13.9, 0, EAST, 0, seconds=1)
    found = near_misses(make_trace({"ego": ego, "lead": lead}))
    assert found.drac_mps2 is not None
    assert found.drac_mps2.value == math.inf
    assert plain(found)["drac_mps2"] == {"value": None, "time_s": 1.0, "with": "lead"}
    assert plain(found)["ttc_s"] == {"value": 0.0, "time_s": 1.0, "with": "lead"}


def test_who_stood_on_the_spot_counts_from_when_it_left() -> None:
    # The other stands across ego's way, its middle in it, and leaves at 2.0 s with 5 m/s: its tail (y = -2) has left
    # y = 0.9 after 0.58 s. Ego's front comes to its side (x = 39.1) at 5.0 s.
    ego = straight("car", 39.1 - 2 - 50, 0, EAST, 10, seconds=8)
    other = straight("car", 40, 0, NORTH, 5, seconds=8, start_s=2.0)
    found = near_misses(make_trace({"ego": ego, "other": other}))
    assert found.pet_s is not None
    assert found.pet_s.value == pytest.approx(5.0 - 2.58, abs=2 * STEP_S)
    assert found.pet_s.time_s == pytest.approx(5.0, abs=2 * STEP_S)


def test_the_worst_of_several_is_named() -> None:
    tracks = {
        "ego": straight("car", 0, 0, EAST, 10, seconds=3),
        "far": straight("car", 60, 0, EAST, 0, seconds=3),
        "near": straight("car", 50, 0, EAST, 9, seconds=3),
        "beside": straight("pedestrian", 20, 3, EAST, 1, seconds=3),
        "nowhere": until(straight("car", 0, 50, EAST, 0, seconds=3), -STEP_S),
    }
    found = near_misses(make_trace(tracks))
    # 56 m - 30 m at 10 m/s; the pedestrian is 3 - 0.9 - 0.25 m away.
    assert value(found.ttc_s) == (pytest.approx(2.6, abs=1e-3), 3.0, "far")
    assert found.distance_m is not None
    assert (found.distance_m.value, found.distance_m.actor) == (pytest.approx(1.85), "beside")


def test_alone() -> None:
    ego = straight("car", 0, 0, EAST, 10, seconds=3)
    gone = until(straight("car", 9, 0, EAST, 0, seconds=3), -STEP_S)
    for tracks in ({"ego": ego}, {"ego": ego, "gone": gone}):
        assert set(vars(near_misses(make_trace(tracks))).values()) == {None}


def boxes(trace: Trace, actor: int) -> np.ndarray:
    _, length, width, _ = SIZES[trace.actors[actor].kind]
    return np.column_stack([trace.states[:, actor, :3], np.tile([length, width], (trace.frames, 1))])


@settings(max_examples=60)
@given(
    st.floats(0, 14),
    st.floats(1, 14),
    st.floats(0.4, 2.7),
    st.floats(-40, 40),
    st.sampled_from(["car", "pedestrian", "van"]),
)
def test_distance_and_pet_are_those_of_the_single_pair(
    ego_speed: float, speed: float, angle: float, back: float, kind: str
) -> None:
    ego = straight("car", -40, 0, EAST, ego_speed, seconds=8)
    other = straight(kind, back * math.cos(angle), back * math.sin(angle), angle, speed, seconds=8)
    trace = make_trace({"ego": ego, "other": other})
    found = near_misses(trace)
    a, b = boxes(trace, 0), boxes(trace, 1)
    assert found.distance_m is not None
    distance, frame = minimum_distance(a, b)
    assert found.distance_m.value == pytest.approx(distance, abs=1e-9)
    assert trace.time_s[frame] <= found.distance_m.time_s + 1e-9
    expected = pet(a, b, horizon_s=HORIZON_S)
    if expected == math.inf:
        assert found.pet_s is None
    else:
        assert found.pet_s is not None
        assert found.pet_s.value == pytest.approx(expected)


@pytest.mark.parametrize("at_frame", range(40, 46))
def test_a_worst_value_between_the_frames_that_are_looked_at_first_counts(at_frame: int) -> None:
    """The ego drives at 10 m/s towards a standing car, and brakes hard from a frame on: then the time is smallest."""
    speeds = np.where(np.arange(81) <= at_frame, 10.0, 1.0)
    ego = along(np.concatenate([[0.0], np.cumsum(speeds[:-1] * STEP_S)]), speeds)
    trace = make_trace({"ego": ego, "lead": straight("car", 40, 0, EAST, 0, seconds=4)})
    found = near_misses(trace).ttc_s
    assert value(found) == (pytest.approx(3.6 - at_frame * STEP_S), round(at_frame * STEP_S, 6), "lead")


def test_nothing_of_a_run_is_changed() -> None:
    trace = make_trace({"ego": straight("car", 0, 0, EAST, 10), "lead": straight("car", 34, 0, EAST, 5)})
    before = replace(trace).digest
    near_misses(trace)
    assert replace(trace).digest == before
