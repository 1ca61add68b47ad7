import math

import numpy as np
import pytest

from foresee_dsl.errors import ForeseeError
from foresee_dsl.forecast.baselines import ExhaustiveRanker, ProximityRanker, RandomRanker
from foresee_dsl.forecast.foresee import ForeseeRanker
from foresee_dsl.forecast.protocol import Ranker
from foresee_dsl.forecast.registry import RANKERS, load_ranker
from tests.support.handmade_traces import EAST, NORTH, WEST, make_trace, straight

EGO = straight("car", 0, 0, EAST, 5)
TRACE = make_trace(
    {
        "ego": EGO,
        "runner": straight("car", 50, -48, NORTH, 4),
        "walker": straight("pedestrian", 40, 9, EAST, 0.0),
        "oncoming": straight("car", 100, 3.3, WEST, 6),
    }
)


def test_proximity_takes_all_close_actors_in_order_of_appearance():
    points = ProximityRanker().rank(TRACE)
    assert [p.actor for p in points] == ["walker", "oncoming", "runner"]
    assert [p.rank for p in points] == [1, 2, 3]
    assert {p.group for p in points} == {"close"}
    assert math.isnan(points[0].trajectory_distance_m)


def test_random_draws_waypoints_without_replacement():
    points = RandomRanker().rank(TRACE, seed=3, before_s=5)
    frames = [p.frame for p in points]
    assert len(set(frames)) == len(frames) == len([w for w in TRACE.waypoints if w[0] >= 25])
    assert min(frames) >= 100
    assert frames != sorted(frames)
    assert points == RandomRanker().rank(TRACE, seed=3, before_s=5)
    assert points != RandomRanker().rank(TRACE, seed=4, before_s=5)


def test_random_takes_the_frame_at_which_the_ego_was_nearest():
    trace = make_trace({"ego": EGO}, waypoints=np.array([[60.0, 0.4], [500.0, 0.0]]))
    (point,) = RandomRanker().rank(trace)
    assert (point.frame, point.actor, point.group) == (240, "", "none")


def test_exhaustive_takes_every_second_after_the_first_ones():
    points = ExhaustiveRanker().rank(TRACE, before_s=3)
    assert [p.time_s for p in points] == [float(s) for s in range(3, 21)]
    assert ExhaustiveRanker().rank(TRACE, before_s=2.5)[0].time_s == 3.0


def test_installed_rankers_are_found_by_name():
    assert {"foresee", "proximity", "random", "exhaustive"} <= set(RANKERS.names())
    assert load_ranker("foresee") == ForeseeRanker()
    for name in RANKERS.names():
        ranker = load_ranker(name)
        assert isinstance(ranker, Ranker)
        assert ranker.name == name


@pytest.mark.parametrize(
    ("name", "hint"), [("forsee", "did you mean 'foresee'?"), ("zzz", "installed: careful, exhaustive, foresee")]
)
def test_an_unknown_ranker_is_said_with_close_names(name, hint):
    with pytest.raises(ForeseeError, match="unknown ranker") as caught:
        load_ranker(name)
    assert hint in str(caught.value)
