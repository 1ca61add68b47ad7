"""The driver's mission: line, stop lines, signals and foes."""

import numpy as np
import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.simulate.actors.dynamics import limits_of
from foresee_dsl.simulate.mission import mission_of
from tests.support.worlds import EGO, PLAIN, case_of, four_arms, t_junction


def mission(turn, start="south", network=PLAIN, more=""):
    text = f"ego: car.sedan {{\n route from {start} {turn} over j4\n start at 30 m along {start}\n {more}\n}}"
    bundle = compile_test_case(case_of(text, network))
    return bundle, mission_of(bundle)


def foes_from(mission_, heading_deg):
    """Vehicles that come along a direction."""
    (passage,) = mission_.junctions
    found = []
    for foe in passage.foes:
        if not foe.pedestrian:
            (dx, dy) = foe.path[5] - foe.path[0]
            if abs((np.degrees(np.arctan2(dy, dx)) - heading_deg + 180) % 360 - 180) < 10:
                found.append(foe)
    return found


def test_the_line_and_its_marks():
    bundle, m = mission("straight")
    assert np.array_equal(m.centreline, bundle.scene.ego.line.points)
    assert (m.start_s, m.goal_s) == pytest.approx((30, 235))
    (passage,) = m.junctions
    entry = bundle.scene.ego.line.passages[0].entry_s
    assert (passage.junction, passage.turn, passage.stop_s) == ("j4", "straight", pytest.approx(entry - 1))
    assert passage.signal.startswith("j4:")
    assert m.speed_limit_mps.max() == pytest.approx(50 / 3.6, abs=0.01)


def test_the_line_goes_on_behind_the_goal():
    _, m = mission("straight", more="goal 10 m past j4 on ego.route")
    assert m.s[-1] == pytest.approx(m.goal_s + 80, abs=1.1)


def test_the_egos_own_speed_bounds_the_limit():
    _, m = mission("straight", more="speed 30 km/h")
    assert m.speed_limit_mps.max() == pytest.approx(30 / 3.6)


def test_who_turns_left_yields_to_oncoming_traffic():
    bundle, m = mission("left")
    (oncoming, *_) = [f for f in foes_from(m, -90) if abs(f.path[-1][1] - f.path[0][1]) > 75]
    assert oncoming.has_priority and not oncoming.pedestrian
    line = bundle.scene.ego.line
    first, last = oncoming.conflict_s
    assert m.junctions[0].stop_s < first < last <= m.junctions[0].exit_s
    crossed = line.at((first + last) / 2)
    assert crossed[0] == pytest.approx(-1.65, abs=0.7), "on the oncoming lane"
    assert 59 < oncoming.entry_s <= 61
    inside = oncoming.path[
        int(np.searchsorted(np.cumsum(np.hypot(*np.diff(oncoming.path, axis=0).T)), np.mean(oncoming.conflict_path_s)))
    ]
    assert np.hypot(*(inside - crossed[:2])) < 2.0, "both intervals are about the same place"


def test_who_has_red_meanwhile_need_not_be_let_go_first():
    _, m = mission("straight")
    crossing = foes_from(m, 0) + foes_from(m, 180)
    assert crossing and not any(f.has_priority for f in crossing)


def test_who_turns_yields_to_people_on_the_crossing_ahead():
    _, m = mission("right")
    walkers = [f for f in m.junctions[0].foes if f.pedestrian]
    yields = [f for f in walkers if f.has_priority]
    assert len(yields) == 1, "over the road that it turns into; the one in front of it is red"
    assert yields[0].path[:, 0].mean() > 5


def test_priority_without_signals():
    network = t_junction(control="priority")
    _, main = mission("straight", "west", network)
    _, stem = mission("left", "south", network)
    assert all(p.signal is None for p in (*main.junctions, *stem.junctions))
    assert not any(f.has_priority for f in foes_from(main, 90))
    assert all(f.has_priority for f in foes_from(stem, 0)), "the stem lets the main road go first"


def test_free_width_counts_the_lanes_of_its_direction():
    _, m = mission("straight", "west", four_arms(median=0, via=()))
    k = int(np.searchsorted(m.s, 60))
    assert m.left_m[k] + m.right_m[k] == pytest.approx(2 * 3.3)


def test_limits_come_from_the_model_and_the_weather():
    bundle = compile_test_case(case_of(EGO + "weather wetness 1.0"))
    limits = limits_of(bundle.scene.ego.model, bundle.scene.friction)
    assert limits.friction == pytest.approx(0.5)
    assert limits.wheelbase_m == bundle.scene.ego.model.wheelbase_m
