import math
from dataclasses import replace

import numpy as np
import pytest

from foresee_dsl.forecast.foresee import ForeseeRanker, _best_per_actor, _PerturbedEgo, close_encounters, passes
from foresee_dsl.forecast.settings import ForeseeSettings
from foresee_dsl.simulate.trace import X, Y
from tests.support.handmade_traces import EAST, NORTH, SOUTH, WEST, make_trace, straight

# The ego drives east along y = 0 at 5 m/s from x = 0; it is at x = 50 after 10 s.
EGO = straight("car", 0, 0, EAST, 5)


def rank(tracks, **options):
    return ForeseeRanker().rank(make_trace({"ego": EGO, **tracks}), **options)


def test_critical_crossing_behind_the_ego():
    # Crosses x = 50 northward, two seconds after the ego was there.
    (point,) = rank({"runner": straight("car", 50, -48, NORTH, 4)})
    assert (point.rank, point.actor, point.group) == (1, "runner", "critical crossing")
    assert 10.0 < point.time_s < 12.0
    assert 1.0 < point.distance_m < 5.0
    assert point.trajectory_distance_m == 0.0
    where = f"runner passes {point.distance_m:.1f} m behind the ego at {point.time_s:.2f} s"
    assert point.why == f"critical crossing: {where}"


@pytest.mark.parametrize(("heading", "turn"), [(NORTH, 1), (SOUTH, -1)])
def test_the_side_of_an_actor_is_told_in_the_direction_of_the_ego(heading, turn):
    ego = straight("car", 0, 0, heading, 5)
    for ahead_m, left_m, side in ((8, 0, "ahead of"), (-8, 0, "behind"), (0, 3, "left of"), (0, -3, "right of")):
        other = straight("car", -turn * left_m, turn * ahead_m, heading, 5)
        (encounter, *_) = close_encounters(make_trace({"ego": ego, "lead": other}), ForeseeSettings(), before_s=5)
        assert passes(make_trace({"ego": ego, "lead": other}), encounter).split(" the ego")[0].endswith(f" m {side}")


def test_crossing_far_from_the_ego_is_not_critical():
    # Crosses x = 30 after 14 s; when the ego passes there after 6 s, it is still 8 m aside.
    points = rank({"walker": straight("pedestrian", 30, -14, NORTH, 1.0)})
    assert [p.group for p in points] == ["crossing"]
    assert points[0].distance_m > ForeseeSettings().limited_distance_m


def test_oncoming_within_the_threshold_is_critical_without_crossing():
    (point,) = rank({"oncoming": straight("car", 100, 3.3, WEST, 5)})
    assert point.group == "critical"
    assert point.distance_m == pytest.approx(1.5, abs=1e-6)  # 3.3 m between the centres of cars 1.8 m wide
    assert point.trajectory_distance_m == pytest.approx(3.3, abs=1e-6)
    assert point.why.startswith("critical: oncoming passes 1.5 m left of the ego at 9.")


@pytest.mark.parametrize(("aside_m", "expected"), [(2.0, ["critical"]), (2.05, ["critical"]), (2.2, []), (5.0, [])])
def test_perturbed_egos_reach_the_threshold_and_the_localisation_error_further(aside_m, expected):
    # The footprints pass `aside_m` apart. In 3 s at 5 m/s half a degree grows to 0.07 m.
    points = rank({"oncoming": straight("car", 100, -(aside_m + 1.8), WEST, 5)})
    assert [p.group for p in points] == expected


@pytest.mark.parametrize("speed", [5.0, 14.0, 30.0])
def test_perturbed_trajectories_stay_within_the_bounds_at_the_encounter(speed):
    settings = ForeseeSettings()
    corners = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0], [0.0, 0.0]])
    trace = make_trace({"ego": straight("car", 0, 0, EAST, speed)})
    rolled = _PerturbedEgo(trace, settings, corners).perturbed(100, 180, 60)
    off = rolled[:, 60] - trace.states[160, 0, :3]
    assert np.abs(off[:, 0]).max() == pytest.approx(settings.longitudinal_error_m, abs=0.01)
    aside = min(settings.lateral_error_m, settings.heading_error_rad * 3 * speed / 2)
    assert np.abs(off[:, 1]).max() == pytest.approx(aside, abs=0.01)
    assert np.abs(off[:, 2]).max() <= settings.heading_error_rad + 1e-12
    assert np.allclose(rolled[4], trace.states[100:181, 0, :3])


def test_a_standing_ego_is_not_perturbed_out_of_its_place():
    trace = make_trace({"ego": straight("car", 0, 0, EAST, 0)})
    rolled = _PerturbedEgo(trace, ForeseeSettings(), np.ones((1, 2))).perturbed(100, 180, 60)
    assert np.allclose(rolled[0, :, :2], 0.0)


def test_actors_beyond_their_radius_are_discarded():
    # 14 m beside the ego: over th1 for a bicycle, within th2 for a pedestrian (which nothing makes critical).
    tracks = {"cyclist": straight("bicycle", 0, 14, EAST, 5), "walker": straight("pedestrian", 50, 14, EAST, 1)}
    assert rank(tracks) == ()
    found = close_encounters(make_trace({"ego": EGO, **tracks}), ForeseeSettings(), before_s=5)
    assert {e.actor for e in found} == {2}


def test_obstacles_are_no_actors_to_rank():
    assert rank({"box": straight("obstacle", 50, 1.5, EAST, 0)}) == ()


def test_a_leader_crosses_nothing_but_may_be_critical():
    (point,) = rank({"lead": straight("car", 5.9, 0.1, EAST, 5)})
    assert point.group == "critical"
    assert "1.9 m ahead of the ego" in point.why


def test_an_actor_that_comes_from_beside_into_the_egos_corridor_crosses_at_any_angle():
    cut_in, beside = (straight("car", 8, 3.3, EAST, 5) for _ in range(2))
    cut_in.states[:, Y] = np.interp(np.arange(len(cut_in.states)), [100, 260], [3.3, 0.0])  # at 5 degrees
    points = rank({"cut_in": cut_in, "beside": beside})
    assert {p.actor: p.group for p in points}["cut_in"] == "critical crossing"
    assert "beside" not in {p.actor for p in points}


def test_order_group_then_pedestrians_then_nearness():
    points = rank(
        {
            "beside": straight("car", 100, 3.3, WEST, 5),
            "nearer": straight("car", 110, 3.1, WEST, 5.5),
            "late_walker": straight("pedestrian", 30, -14, NORTH, 1.0),
            "runner": straight("car", 50, -48, NORTH, 4),
            "walker": straight("pedestrian", 60, 12.6, SOUTH, 1.0),
        }
    )
    firsts = list(dict.fromkeys(p.actor for p in points))
    assert firsts == ["walker", "runner", "late_walker", "nearer", "beside"]
    assert [p.rank for p in points] == list(range(1, len(points) + 1))
    first_points = [next(p for p in points if p.actor == a) for a in firsts]
    assert [p.score for p in first_points] == sorted((p.score for p in first_points), reverse=True)


def test_every_actor_comes_once_before_any_comes_twice():
    # Swings past the ego twice: two minima of one actor.
    shuttle = straight("car", 0, 3.2, EAST, 5)
    states = shuttle.states.copy()
    states[:, 0] += 9 * np.cos(np.arange(len(states)) * 0.05 * 2 * math.pi / 12)
    points = rank({"shuttle": replace(shuttle, states=states), "oncoming": straight("car", 100, -3.4, WEST, 5)})
    assert {p.actor for p in points[:2]} == {"shuttle", "oncoming"}
    assert [p.actor for p in points[2:]].count("shuttle") >= 1


def test_standing_side_by_side_is_one_point_that_begins_when_it_may():
    ego, other = straight("car", 0, 0, EAST, 0), straight("car", 0, 3.3, EAST, 0)
    (point,) = ForeseeRanker().rank(make_trace({"ego": ego, "other": other}), before_s=5)
    assert point.time_s == 5.0
    assert "stands 1.5 m left of the ego" in point.why


def test_points_of_the_first_seconds_are_left_out():
    early = {"runner": straight("car", 15, -10, NORTH, 4)}
    assert [p.time_s < 3 for p in rank(early, before_s=2)] == [True]
    assert rank(early, before_s=5) == ()


def test_a_rank_is_the_same_every_time_and_hardly_depends_on_the_seed():
    tracks = {"runner": straight("car", 50, -48, NORTH, 4), "oncoming": straight("car", 100, 3.3, WEST, 5)}
    assert rank(tracks, seed=1) == rank(tracks, seed=1)
    assert [p.actor for p in rank(tracks, seed=1)] == [p.actor for p in rank(tracks, seed=2)]


def test_a_run_with_only_the_ego_has_no_risky_point():
    assert rank({}) == ()


def test_step_1c_goes_on_for_a_second_after_the_encounter():
    # Beside the ego all along: half a degree that is reached after 3 s is 0.07 m then and 0.12 m a second later.
    tracks = {"beside": straight("car", 0, 2.09 + 1.8, EAST, 5)}
    (point,) = rank(tracks)
    assert point.group == "critical"
    shorter = ForeseeRanker(ForeseeSettings(beyond_s=0.0))
    assert shorter.rank(make_trace({"ego": EGO, **tracks})) == ()


def test_points_of_one_actor_within_a_second_are_one_encounter():
    (point,) = rank({"runner": straight("car", 50, -48, NORTH, 4)})
    again, later = (replace(point, time_s=point.time_s + apart_s) for apart_s in (0.95, 1.0))
    assert _best_per_actor([point, again, later], same_s=1.0) == ([point], [later])


def test_the_corridor_counts_both_half_widths():
    for side_m, group in ((1.7, "critical crossing"), (1.9, "critical")):  # both cars are 1.8 m wide
        comes_near = straight("car", 8, 3.3, EAST, 5)
        comes_near.states[:, Y] = np.interp(np.arange(len(comes_near.states)), [100, 260], [3.3, side_m])
        comes_near.states[:, X] -= np.interp(np.arange(len(comes_near.states)), [100, 260], [0.0, 7.0])
        assert {p.group for p in rank({"near": comes_near})} == {group}
