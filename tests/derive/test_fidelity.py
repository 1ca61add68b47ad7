from dataclasses import replace

import numpy as np
import pytest

from foresee_dsl.derive.clipping.clip import clip
from foresee_dsl.derive.clipping.fidelity import deviation, share_within, with_fidelity
from foresee_dsl.language.model import Fidelity, Quantity
from tests.support.handmade_traces import EAST, make_trace, straight, until
from tests.support.situations import case_with, crossing, risky


def window(trace, first, last):
    """The run that a perfect clip would give."""
    arrays = {name: getattr(trace, name)[first:last] for name in ("states", "lanes", "along", "stages", "elapsed")}
    return replace(trace, time_s=trace.time_s[: last - first], **arrays)


def moved(trace, actor, by_m, frame):
    states = trace.states.copy()
    states[frame:, actor, 0] += by_m
    return replace(trace, states=states)


PARENT = make_trace(crossing(lead=straight("car", 20, 0, EAST, 5), side=straight("van", 0, 9, EAST, 5)))


def test_the_same_run_deviates_by_nothing():
    found = deviation(PARENT, 100, window(PARENT, 100, 301))
    assert (found.largest_m, found.median_others_m, share_within(tuple(found.actors.values())), found.frames) == (
        0.0,
        0.0,
        1.0,
        201,
    )


def test_the_largest_the_median_and_the_share():
    child = moved(moved(window(PARENT, 100, 301), 1, 0.05, 50), 2, 3.0, 150)
    found = deviation(PARENT, 100, child)
    assert found.actors == pytest.approx({"ego": 0, "runner": 0.05, "lead": 3.0, "side": 0})
    assert found.largest_m == pytest.approx(3.0)
    assert found.median_others_m == pytest.approx(0.05)
    assert share_within(tuple(found.actors.values())) == 0.75


def test_an_actor_that_leaves_in_one_run_only_counts_from_where_it_was():
    child = window(PARENT, 100, 301)
    states = child.states.copy()
    states[101:, 2] = np.nan  # gone after 5 s; 5 s later the parent's is 25 m on
    found = deviation(PARENT, 100, replace(child, states=states))
    assert found.actors["lead"] == pytest.approx(25.0)


def test_who_was_not_there_at_the_beginning_is_not_compared():
    parent = make_trace(crossing(early=until(straight("car", 10, 50, EAST, 9), 3.0)))
    child = make_trace(crossing())
    assert set(deviation(parent, 100, window(child, 100, 301)).actors) == {"ego", "runner"}


def test_a_run_that_ended_early_is_compared_as_far_as_it_goes():
    assert deviation(PARENT, 100, window(PARENT, 100, 151)).frames == 51


def test_a_run_without_an_actor_of_the_window_is_refused():
    with pytest.raises(ValueError, match="no actor 'lead'"):
        deviation(PARENT, 100, window(make_trace(crossing()), 100, 301))
    with pytest.raises(ValueError, match="401 frames"):
        deviation(PARENT, 401, PARENT)


def test_fidelity_is_written_once_in_centimetres():
    cut = clip(case_with(), PARENT, risky(PARENT, "runner", 11), before_s=5, after_s=5, name="x", parent="runs.foresee")
    found = deviation(PARENT, 100, moved(window(PARENT, 100, 301), 1, 0.126, 50))
    for _ in range(2):
        cut = with_fidelity(cut, found)
    (line,) = [item for item in cut.body if isinstance(item, Fidelity)]
    assert line.deviation == Quantity.of(0.13, "length", 2)
    assert cut.body[-1] is line


def test_an_actor_that_the_clip_could_not_place_is_infinitely_far():
    child = window(PARENT, 100, 301)
    states = child.states.copy()
    states[:, 2] = np.nan
    found = deviation(PARENT, 100, replace(child, states=states))
    assert found.actors["lead"] == found.largest_m == np.inf


def test_within_means_a_tenth_of_a_metre():
    assert share_within((0.0, 0.1, 0.11, 0.2)) == 0.5
    assert share_within(()) == 1.0
