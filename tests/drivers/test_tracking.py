"""The tracker: by hand where it is exact, against the truth where it filters noise, and in the drivers' loops."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from foresee_dsl.drivers.protocol import EgoState, Observation, SeenActor
from foresee_dsl.drivers.tracking import COAST_S, STANDING_COAST_S, Tracker, Tracks
from foresee_dsl.kernels.tracks import DOUBT_MPS
from tests.support.senses import blurred

STEP_S = 0.05
LATENCY_S = 0.1
EGO = EgoState(0, 0, 0, 0, 0, 0, 0)


def car(x: float = 30.0, y: float = 0.0, heading: float = 0.0, speed: float = 10.0, track: int = 1) -> SeenActor:
    return SeenActor(track, "car", x, y, heading, speed, 4.5, 1.8)


def seen(time_s: float, *actors: SeenActor, late_s: float = 0.0) -> Observation:
    return Observation(time_s, EGO, actors, {}, time_s - late_s)


# ---- exact ----------------------------------------------------------------------------------------------------------


def test_the_first_frame_is_the_measurement_carried_on_by_the_latency() -> None:
    heading = math.radians(60)
    tracks = Tracker().update(seen(5.0, car(30.0, 4.0, heading, 10.0), late_s=LATENCY_S))
    assert tracks.x == pytest.approx([30.0 + 0.5])  # 10 m/s for 0.1 s, half of it along x
    assert tracks.y == pytest.approx([4.0 + math.sqrt(3) / 2])
    assert (tracks.heading[0], tracks.speed[0], tracks.length[0], tracks.width[0]) == (heading, 10.0, 4.5, 1.8)
    assert tracks.seen() == (replace(car(30.0, 4.0, heading), x=float(tracks.x[0]), y=float(tracks.y[0])),)


def test_without_latency_the_first_frame_is_what_was_measured() -> None:
    actors = (car(), SeenActor(9, "pedestrian", 5.0, -4.0, 1.0, 1.4, 0.5, 0.5), car(60.0, track=4))
    assert Tracker().update(Observation(3.0, EGO, actors, {})).seen() == actors
    assert Tracker().update(Observation(3.0, EGO, (), {})).seen() == ()


def test_exact_measurements_at_constant_speed_are_kept_exactly() -> None:
    tracker = Tracker()
    for k in range(60):
        t = k * STEP_S
        tracks = tracker.update(seen(t, car(30 + 10 * (t - LATENCY_S), heading=0.0), late_s=LATENCY_S))
        assert tracks.x == pytest.approx([30 + 10 * t], abs=1e-9)
        assert tracks.speed == pytest.approx([10.0], abs=1e-9)


def test_a_heading_that_passes_half_a_turn_goes_on() -> None:
    tracker = Tracker()
    for k in range(60):
        heading = math.pi - 0.3 + 0.2 * k * STEP_S
        wrapped = (heading + math.pi) % (2 * math.pi) - math.pi
        tracks = tracker.update(seen(k * STEP_S, car(heading=wrapped, speed=1.0)))
        assert math.cos(tracks.heading[0] - heading) > math.cos(0.05)
    assert wrapped < 0


def test_an_object_list_that_comes_twice_says_nothing_new() -> None:
    once, twice = Tracker(), Tracker()
    for k in range(20):
        t, late = k * STEP_S, LATENCY_S + (k % 2) * STEP_S  # measured at 10 Hz
        actor = car(30 + 10 * (t - late) + 0.1 * (-1) ** (k // 2))
        both = twice.update(seen(t, actor, late_s=late))
        if k % 2 == 0:
            alone = once.update(seen(t, actor, late_s=late))
            assert np.array_equal(both.x, alone.x) and np.array_equal(both.speed, alone.speed)


def test_who_is_hidden_coasts_with_growing_doubt_then_is_forgotten() -> None:
    tracker = Tracker()
    for k in range(20):
        tracker.update(seen(k * STEP_S, car(30 + 10 * k * STEP_S)))
    counts = []
    for k in range(20, 60):
        tracks = tracker.update(seen(k * STEP_S))
        counts.append(len(tracks.x))
        if k == 39:  # 1 s later
            assert tracks.x == pytest.approx([30 + 10 * 1.95])
            assert tracks.lost_s == pytest.approx([1.0])
            assert tracks.length == pytest.approx([4.5 + 2 * DOUBT_MPS])
            assert tracks.width == pytest.approx([1.8 + 2 * DOUBT_MPS])
    assert counts == [1] * round(COAST_S / STEP_S) + [0] * (40 - round(COAST_S / STEP_S))


def test_who_stood_is_remembered_for_longer_and_does_not_grow() -> None:
    tracker = Tracker()
    for k in range(10):
        tracker.update(seen(k * STEP_S, car(speed=0.0)))
    kept = [tracker.update(seen(k * STEP_S)) for k in range(10, 100)]
    counts = [len(tracks.x) for tracks in kept]
    assert sum(counts) == round(STANDING_COAST_S / STEP_S)
    assert kept[70].length == pytest.approx([4.5])


@pytest.mark.parametrize(
    ("again", "same"),
    [
        (car(30 + 10 * 1.7 + 1.0, track=2), True),
        (car(30 + 10 * 1.7 - 6.0, track=2), False),  # 1.5 m + 1.5 m/s * 1.2 s is the most
        (replace(car(30 + 10 * 1.7, track=2), length_m=12.0), False),
        (replace(car(30 + 10 * 1.7, track=2), kind="truck"), False),
    ],
)
def test_a_new_number_where_somebody_was_lost_may_be_the_same(again: SeenActor, same: bool) -> None:
    tracker = Tracker()
    for k in range(11):
        tracker.update(seen(k * STEP_S, car(30 + 10 * k * STEP_S)))
    for k in range(11, 34):
        tracker.update(seen(k * STEP_S))
    tracks = tracker.update(seen(34 * STEP_S, again))
    assert tracks.numbers == ((2,) if same else (1, 2))
    if same:  # what was known smooths what is measured
        assert 30 + 10 * 1.7 < tracks.x[0] < 30 + 10 * 1.7 + 1.0


def test_two_that_cross_in_the_list_are_not_mixed_up() -> None:
    tracker = Tracker()
    for k in range(30):
        t = k * STEP_S
        pair = (car(30 + 10 * t, track=7), car(50 - 10 * t, y=3.5, heading=math.pi, track=3))
        tracks = tracker.update(seen(t, *(pair if k % 2 else pair[::-1])))
    places = dict(zip(tracks.numbers, tracks.x.tolist(), strict=True))
    assert places == {7: pytest.approx(44.5), 3: pytest.approx(35.5)}


def test_the_rest_are_not_mixed_up_when_a_lost_one_is_forgotten() -> None:
    tracker, both = Tracker(), (car(50.0, 3.5, track=5), car(70.0, track=8))
    tracker.update(seen(0.0, car(), *both))
    for k in range(1, 60):  # the first is lost, then forgotten; the list of the others stays the same
        way = 10 * k * STEP_S
        tracks = tracker.update(seen(k * STEP_S, *(replace(actor, x=actor.x + way) for actor in both)))
    assert tracks.numbers == (5, 8)
    assert tracks.x == pytest.approx([50.0 + way, 70.0 + way])
    assert tracks.y == pytest.approx([3.5, 0.0])


def test_a_jump_is_taken_over_at_once() -> None:
    tracker = Tracker()
    for k in range(40):
        tracker.update(seen(k * STEP_S, car(speed=0.0)))
    tracks = tracker.update(seen(2.0, car(34.0, speed=5.0)))
    assert (tracks.x[0], tracks.speed[0]) == (34.0, 5.0)


def test_time_that_begins_anew_or_a_reset_forgets_everything() -> None:
    tracker = Tracker()
    for k in range(20):
        tracker.update(seen(10 + k * STEP_S, car(30 + 0.3 * (-1) ** k), car(60.0, track=2)))
    fresh = Tracker().update(seen(4.0, car(31.0)))
    assert tracker.update(seen(4.0, car(31.0))).seen() == fresh.seen()
    tracker.reset()
    assert tracker.update(seen(9.0, car(31.0))).seen() == fresh.seen()


# ---- against noise --------------------------------------------------------------------------------------------------


def cruises(t: float) -> tuple[float, float, float, float]:
    return 10 * t, 0.0, 0.0, 10.0


def brakes(t: float) -> tuple[float, float, float, float]:
    """With 4 m/s^2 from 3 s on."""
    b = min(max(t - 3.0, 0.0), 2.5)
    return 10 * min(t, 3.0 + b) - 2 * b * b, 0.0, 0.0, 10 - 4 * b


def turns(t: float) -> tuple[float, float, float, float]:
    """With 5 m/s on a radius of 10 m."""
    return 10 * math.sin(t / 2), 10 - 10 * math.cos(t / 2), t / 2, 5.0


def stands(_t: float) -> tuple[float, float, float, float]:
    return 0.0, 0.0, 0.3, 0.0


def errors(way: Callable[[float], tuple[float, float, float, float]], *, tracked: bool) -> np.ndarray:
    """RMS of place (m), heading (rad) and speed (m/s), of 10 runs from 1 s on; of raw measurements or of tracks."""
    found = []
    for seed in range(10):
        rng, tracker = np.random.default_rng(seed), Tracker()
        for k in range(140):
            t = k * STEP_S
            x, y, heading, speed = way(max(t - LATENCY_S, 0.0))
            raw = blurred(car(30 + x, y, heading, speed), EGO, rng)
            observation = seen(t, *([] if raw is None else [raw]), late_s=LATENCY_S)
            tracks = tracker.update(observation)
            if t > 1.0 and raw is not None:
                got = tracks.seen()[0] if tracked else raw
                true_x, true_y, true_heading, true_speed = way(t)
                away = math.hypot(got.x - 30 - true_x, got.y - true_y)
                found.append((away, got.heading_rad - true_heading, got.speed_mps - true_speed))
    return np.asarray(np.sqrt(np.mean(np.square(found), axis=0)))


@pytest.mark.parametrize(
    ("way", "place_m", "heading_rad", "speed_mps"),
    [(cruises, 0.13, 0.025, 0.17), (brakes, 0.15, 0.025, 0.25), (turns, 0.15, 0.035, 0.15), (stands, 0.05, 0.01, 0.01)],
)
def test_it_is_nearer_to_the_truth_than_what_is_measured(
    way: Callable[[float], tuple[float, float, float, float]], place_m: float, heading_rad: float, speed_mps: float
) -> None:
    raw, tracked = errors(way, tracked=False), errors(way, tracked=True)
    assert (tracked < (place_m, heading_rad, speed_mps)).all()
    assert (tracked < 0.9 * raw).all()


def test_somebody_on_foot_who_sets_off_is_noticed_within_a_fifth_of_a_second() -> None:
    late = []
    for seed in range(10):
        rng, tracker = np.random.default_rng(seed), Tracker()
        for k in range(120):
            t = k * STEP_S
            walker = SeenActor(1, "pedestrian", 20.0, -3 + 1.4 * max(t - 3.0, 0.0), 1.57, 1.4 * (t > 3.0), 0.5, 0.5)
            raw = blurred(walker, EGO, rng)
            tracks = tracker.update(seen(t + LATENCY_S, *([raw] if raw else [])))
            if tracks.speed.max(initial=0.0) > 0.7:
                late.append(t - 3.0)
                break
    assert len(late) == 10
    assert max(late) < 0.2


def noisy_lists(count: int, frames: int) -> Iterator[Observation]:
    rng = np.random.default_rng(0)
    for k in range(frames):
        actors = (blurred(car(20.0 + 2 * n + 0.5 * k, float(n), track=n), EGO, rng) for n in range(count))
        yield seen(k * STEP_S, *(a for a in actors if a is not None), late_s=LATENCY_S)


def test_it_is_a_function_of_what_it_saw() -> None:
    def run() -> list[Tracks]:
        tracker = Tracker()
        return [tracker.update(o) for o in noisy_lists(6, 60)]

    for one, other in zip(run(), run(), strict=True):
        assert one.seen() == other.seen()
