"""The search for failures that a careful driver avoids: roll-outs, scores and the ranker, on handmade traces."""

from __future__ import annotations

import numpy as np
import pytest

from foresee_dsl.avoidance.candidates.behaviours import CarefulSettings, Kind
from foresee_dsl.avoidance.candidates.recorded import RecordedRun
from foresee_dsl.avoidance.candidates.scoring import NOTICE_S, Promise, ScoredCandidate, search
from foresee_dsl.avoidance.r157.risk import REACTION_S
from foresee_dsl.forecast.registry import load_ranker
from foresee_dsl.simulate.trace import STEP_S, Trace
from tests.support.handmade_traces import EAST, NORTH, Track, make_trace, straight


def crossing_car(*, behind_m: float) -> Trace:
    """The ego drives 10 m/s to the east for 10 s; a car comes from the south and crosses behind or before it."""
    # The ego is at x = 50 m after 5 s.
    runner = straight("car", 50, -40 - behind_m, NORTH, 8)
    tracks = {"ego": straight("car", 0, 0, EAST, 10)}
    tracks["runner"] = Track("car", runner.states, ("south", "north"), (), ("south_0",), 8.0)
    return make_trace(tracks).part(0, 201)


def found(trace: Trace, seed: int = 0) -> list[ScoredCandidate]:
    last = trace.frames - 1
    return search(RecordedRun.of(trace), [1], 0, last, last // 2, np.random.default_rng(seed), CarefulSettings())


def test_a_car_that_crosses_just_behind_is_found_to_hit_when_it_is_faster() -> None:
    best = found(crossing_car(behind_m=8))[0]
    assert best.score > 0.2
    assert best.avoidable > 0
    assert any(s.candidate.kind is Kind.PACE and s.candidate.strength > 1 for s in found(crossing_car(behind_m=8)))


def test_the_same_seed_finds_the_same() -> None:
    trace = crossing_car(behind_m=8)
    assert found(trace, 3) == found(trace, 3)
    assert found(trace, 3) != found(trace, 4)


def test_an_ego_that_stands_is_never_steered_into_nor_hit() -> None:
    ego = straight("car", 0, 0, EAST, 0)
    passer = straight("car", -40, 3, EAST, 8)
    tracks = {"ego": ego, "passer": Track("car", passer.states, ("west", "east"), (), ("west_0",), 8.0)}
    assert found(make_trace(tracks).part(0, 201)) == []


def test_somebody_far_away_does_nothing() -> None:
    assert found(crossing_car(behind_m=200)) == []


def test_a_clip_that_begins_too_late_for_a_driver_to_react_promises_nothing() -> None:
    """What could still be changed counts from the clip's own beginning, and a hit must leave the time to react."""
    assert NOTICE_S == REACTION_S
    trace = crossing_car(behind_m=8)
    promise = Promise(RecordedRun.of(trace), CarefulSettings())
    meets = round(5.0 / STEP_S)
    assert promise.of(meets, 0, trace.frames - 1)
    assert not promise.of(meets, meets - round(0.5 / STEP_S), trace.frames - 1)


def test_the_ranker_says_what_would_happen() -> None:
    trace = crossing_car(behind_m=8)
    points = load_ranker("careful").rank(trace)
    assert [p.rank for p in points] == list(range(1, len(points) + 1))
    assert points[0].actor == "runner"
    assert points[0].score > 0
    assert points[0].why.startswith("runner ")
    assert "contact at" in points[0].why
    assert str(load_ranker("careful").rank(trace)) == str(points)


@pytest.mark.parametrize("kind", list(Kind))
def test_strengths_stay_within_what_is_observed(kind: Kind) -> None:
    s = CarefulSettings()
    bounds = {
        Kind.LATE: s.late_s, Kind.PACE: s.vehicle_pace, Kind.BRAKES: s.brakes_mps2, Kind.HALTS: s.halts_mps2,
        Kind.HESITATES: s.hesitates_mps2, Kind.DRIFTS: s.drifts_m, Kind.CUTS_IN: (0.7 * s.cuts_in_m[0], s.cuts_in_m[1]),
    }  # fmt: skip
    if kind in bounds:
        of_kind = [x.candidate for x in found(crossing_car(behind_m=8)) if x.candidate.kind is kind]
        assert all(bounds[kind][0] <= abs(c.strength) <= bounds[kind][1] for c in of_kind)
        assert all(c.at_s is None or 0 <= c.at_s <= 200 * STEP_S for c in of_kind)
