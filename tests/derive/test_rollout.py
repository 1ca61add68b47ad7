import math

import pytest

from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.derive.operators import predicted_gap_m
from foresee_dsl.kernels.boxes import box_distance
from foresee_dsl.language.model import Change
from tests.support.handmade_traces import EAST, NORTH, make_trace, straight
from tests.support.situations import MODELS, walker
from tests.support.worlds import q

SPECS = {name: spec_of(model) for name, model in MODELS.items()}
# The ego drives east at 5 m/s; the other crosses x = 50 northward and is on the ego's way after 12 s, 2 s too late.
TRACE = make_trace({"ego": straight("car", 0, 0, EAST, 5), "other": straight("car", 50, -48, NORTH, 4)})


def gap(*changes, trace=TRACE):
    return predicted_gap_m(trace, 1, changes, SPECS)


def timing(factor):
    return Change(actor="other", property="timing", was=q("1"), now=q(factor))


def test_no_change_gives_the_recorded_distance():
    recorded = box_distance(TRACE.boxes(0), TRACE.boxes(1)).min()
    assert gap()[0] == pytest.approx(recorded)
    assert gap(timing("1.00"))[0] == pytest.approx(recorded)


def test_the_right_timing_meets_the_ego():
    assert gap(timing("1.20")) == (0.0, pytest.approx(0.0, abs=0.2))
    assert gap(timing("0.80"))[0] > gap()[0]


def test_a_factor_counts_from_the_one_with_which_the_track_was_recorded():
    """An actor that drove 0.5 times as fast drives twice as fast as recorded with 1.00."""
    as_planned = Change(actor="other", property="timing", was=q("0.50"), now=q("1.00"))
    assert gap(as_planned) == pytest.approx(gap(timing("2.00")))


def test_a_delay_moves_the_encounter_by_its_time():
    early = make_trace({"ego": straight("car", 0, 0, EAST, 5), "other": straight("car", 50, -36, NORTH, 4)})
    delay = Change(actor="other", property="delay", was=q("0 s"), now=q("1 s"))
    assert gap(trace=early)[1] > 2
    assert gap(delay, trace=early)[1] == pytest.approx(0.0, abs=0.2)


def test_a_longer_model_comes_nearer_to_who_follows():
    behind = make_trace({"ego": straight("car", 0, 0, EAST, 5), "lead": straight("car", 10, 0, EAST, 5)})
    swap = Change(actor="lead", property="model", was="car.compact", now="car.long")
    assert predicted_gap_m(behind, 1, (), SPECS)[0] == pytest.approx(6.0)
    assert predicted_gap_m(behind, 1, (swap,), SPECS)[0] == pytest.approx(4.5)  # its front stays


@pytest.mark.parametrize(("share", "nearer"), [("0.10", True), ("-0.10", False)])
def test_steering_goes_to_the_side_that_it_says(share, nearer):
    # Oncoming, on the ego's left: its own left is the ego's side.
    oncoming = make_trace({"ego": straight("car", 0, 0, EAST, 5), "other": straight("car", 100, 4, math.pi, 5)})
    steer = Change(actor="other", property="steer", was=q("0"), now=q(share), start=q("8 s"), duration=q("1 s"))
    before = gap(trace=oncoming)[0]
    assert (gap(steer, trace=oncoming)[0] < before - 0.3) is nearer


def test_a_line_and_a_head_start_move_the_track():
    # A walker crosses ahead of the ego's front, 1.5 s too early, from the right; its left is west, nearer to the ego.
    tracks = {"ego": straight("car", 0, 0, EAST, 5), "other": walker(30, -6, NORTH, 1.5)}
    trace = make_trace(tracks)

    def centres(prop, was, now):
        return gap(Change(actor="other", property=prop, was=q(was), now=q(now)), trace=trace)[1]

    assert centres("line", "0.00 m", "0.00 m") == pytest.approx(gap(trace=trace)[1])
    assert centres("line", "0.00 m", "0.60 m") < gap(trace=trace)[1] < centres("line", "0.00 m", "-0.60 m")
    assert centres("line", "0.60 m", "0.60 m") == pytest.approx(gap(trace=trace)[1])
    # 2 s earlier the ego is further away when it is on its way; 3 m back is 2 s later, and the ego is there.
    assert centres("moving", "3.00 m", "6.00 m") > gap(trace=trace)[1] > centres("moving", "3.00 m", "0.00 m")


def test_less_delay_is_earlier():
    trace = make_trace({"ego": straight("car", 0, 0, EAST, 5), "other": walker(30, -6, NORTH, 1.5)})
    less = Change(actor="other", property="delay", was=q("2.00 s"), now=q("1.00 s"))
    more = Change(actor="other", property="delay", was=q("1.00 s"), now=q("2.00 s"))
    assert gap(less, trace=trace)[1] > gap(trace=trace)[1] > gap(more, trace=trace)[1]
