"""Criticality at a moment, on cases with an answer worked out by hand. Cars are 4 m x 1.8 m and weigh 1,500 kg."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest

from foresee_dsl.kernels.constants import HARDEST_BRAKING_MPS2 as HARDEST
from foresee_dsl.simulate.results.criticality import CriticalityMeasure, criticality
from foresee_dsl.simulate.results.near_misses import near_misses, times_between
from foresee_dsl.simulate.trace import ACCELERATION
from tests.support.handmade_traces import EAST, NORTH, WEST, Track, make_trace, straight


def at_the_end(tracks: Mapping[str, Track]) -> dict[str, float]:
    """The measures of the ego and the other actor at the last frame, by name; those without a value are left out."""
    series = criticality(make_trace(tracks), 1)
    return {measure.value: float(values[-1]) for measure, values in series.items() if not math.isnan(values[-1])}


def test_two_in_line() -> None:
    # After 3 s there are 15 m between 10 m/s and 5 m/s.
    values = at_the_end(
        {"ego": straight("car", 0, 0, EAST, 10, seconds=3), "lead": straight("car", 34, 0, EAST, 5, seconds=3)}
    )
    ttb, tts = 3.0 - 5 / (2 * HARDEST), 3.0 - math.sqrt(2 * 1.8 / HARDEST)
    # RSS: 11.75 m during the response up to 13.5 m/s, 13.5^2 / 8 m braking, less 5^2 / 16 m of the lead.
    assert values == pytest.approx(
        {
            "ttc_s": 3.0, "drac_mps2": 5 / 6, "btn": 5 / 6 / HARDEST, "ttb_s": ttb, "tts_s": tts, "ttr_s": ttb,
            "thw_s": 1.5, "rss_m": 15 - (11.75 + 13.5**2 / 8 - 25 / 16), "delta_v_mps": 2.5,
            "injury_risk": 1 / (1 + math.exp(6.954 - 0.1637 * 2.5 * 3600 / 1609.344)),
        },
        abs=1e-3,
    )  # fmt: skip


def test_braking_lead_needs_more() -> None:
    lead = straight("car", 34, 0, EAST, 5, seconds=3)
    lead.states[:, ACCELERATION] = -2.0
    values = at_the_end({"ego": straight("car", 0, 0, EAST, 10, seconds=3), "lead": lead})
    assert values["btn"] == pytest.approx((5 / 6 + 2) / HARDEST, abs=1e-3)
    assert values["drac_mps2"] == pytest.approx(5 / 6, abs=1e-3)


def test_pedestrian_from_the_side() -> None:
    # At 2 s the ego's front is at 22 m; where both touch, the pedestrian is 0.3 m to its right.
    ego = straight("car", 0, 0, EAST, 10, seconds=2)
    walker = straight("pedestrian", 40, -6, NORTH, 1.5, seconds=2)
    values = at_the_end({"ego": ego, "walker": walker})
    assert values["ttc_s"] == pytest.approx((40 - 0.25 - 22) / 10, abs=2e-3)
    impact = math.hypot(10, 1.5)
    assert values["injury_risk"] == pytest.approx(1 / (1 + math.exp(6.9 - 0.09 * impact * 3.6)), rel=1e-3)
    assert values["delta_v_mps"] == pytest.approx(impact * 75 / 1575, rel=1e-3)
    assert "thw_s" not in values and "rss_m" not in values  # it crosses


def test_towards_each_other_and_beside() -> None:
    ego = straight("car", 0, 0, EAST, 10, seconds=1)
    values = at_the_end({"ego": ego, "other": straight("car", 60, 0, WEST, 10, seconds=1)})
    way = 11.75 + 13.5**2 / 6 + 11.75 + 13.5**2 / 8
    assert values["rss_m"] == pytest.approx(40 - 4 - way, abs=1e-3)
    assert "thw_s" not in values
    # 3.5 m to the left: 1.7 m between the sides, of which 0.1 + 2 * 0.125 m are needed; the larger margin counts.
    values = at_the_end({"ego": ego, "other": straight("car", 20, 3.5, EAST, 10, seconds=1)})
    assert values == pytest.approx({"rss_m": 1.7 - 0.35})


def test_worst_values_and_their_times() -> None:
    trace = make_trace(
        {"ego": straight("car", 0, 0, EAST, 10, seconds=3), "lead": straight("car", 34, 0, EAST, 5, seconds=3)}
    )
    worst = near_misses(trace)
    for measure, series in criticality(trace, 1).items():
        near_miss = getattr(worst, measure.value)
        assert near_miss.value == pytest.approx(measure.sign * np.nanmax(measure.sign * series)), measure
        assert near_miss.actor == "lead"
    assert worst.ttb_s is not None and worst.ttb_s.time_s == 3.0


@pytest.mark.parametrize(
    ("lead_m", "lead_mps", "time_s", "ttc_s", "braking_mps2", "btn", "delta_v_mps"),
    [
        (34, 5, 1, 4.99, 0.50, 0.0659, None),
        (34, 5, 2, 3.99, 0.63, 0.0830, None),
        (40, 0, 0, 3.60, 1.39, 0.1831, 5.0),
        (40, 0, 1, 2.60, 1.93, 0.2543, 5.0),
        (40, 0, 2, 1.60, 3.13, 0.4124, 5.0),
    ],
)
def test_figures_of_commonroad_crime(
    lead_m: float, lead_mps: float, time_s: float, ttc_s: float, braking_mps2: float, btn: float,
    delta_v_mps: float | None,
) -> None:  # fmt: skip
    """CommonRoad-CriMe 0.4.5 gave these figures (TTC, ALongReq, BTN, DeltaV) for the same two cars.

    In its scene they drive on a straight lane with heading 0.01 rad, as CriMe takes a heading of 0 for a missing one,
    in steps of 0.05 s, and `a_lon_max` is our hardest braking. It rounds to two decimals, BTN to four. Where its
    definitions are others, docs/background/method.md says so.
    """
    tracks = {
        "ego": straight("car", 0, 0, EAST, 10, seconds=2),
        "lead": straight("car", lead_m, 0, EAST, lead_mps, seconds=2),
    }
    series = criticality(make_trace(tracks), 1)
    at = round(time_s / 0.05)
    assert series[CriticalityMeasure.TTC][at] == pytest.approx(ttc_s, rel=0.01)
    assert series[CriticalityMeasure.DRAC][at] == pytest.approx(braking_mps2, rel=0.01)
    assert series[CriticalityMeasure.BTN][at] == pytest.approx(btn, rel=0.01)
    if delta_v_mps is not None:
        assert series[CriticalityMeasure.DELTA_V][at] == pytest.approx(delta_v_mps, rel=0.01)


def test_every_measure_is_a_near_miss() -> None:
    empty = near_misses(make_trace({"ego": straight("car", 0, 0, EAST, 10, seconds=1)}))
    assert {measure.value for measure in CriticalityMeasure} | {"distance_m", "pet_s"} == set(vars(empty))
    assert set(vars(empty).values()) == {None}


def test_the_time_between_two_at_each_spot() -> None:
    # The ego's middle is at the crossing at 2 s, the other's at 3 s; the footprints reach 2 m and 0.9 m further.
    trace = make_trace(
        {"ego": straight("car", -20, 0, EAST, 10, seconds=4), "other": straight("car", 0, -30, NORTH, 10, seconds=4)}
    )
    between = times_between(trace, 1)
    worst = near_misses(trace).pet_s
    assert worst is not None and np.nanmin(between) == pytest.approx(worst.value)
    # Over the spot from 2.9 m before the crossing to 2.9 m behind it, 0.29 s each; the ego leaves it for the other.
    assert np.flatnonzero(~np.isnan(between)) * 0.05 == pytest.approx(np.arange(1.75, 2.26, 0.05), abs=0.06)
    assert between[round(2.25 / 0.05)] == pytest.approx(3 - 0.29 - 2.25, abs=0.06)
    along = straight("car", -40, 0, EAST, 10, seconds=4)
    assert np.isnan(
        times_between(make_trace({"ego": straight("car", -20, 0, EAST, 10, seconds=4), "b": along}), 1)
    ).all()
