"""The ranker `reach`: which change, of whom, from when on could still reach the ego; on handmade traces."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.derive.operators import operators
from foresee_dsl.derive.operators.paper import Steer, largest_share
from foresee_dsl.derive.presets import FOCUSED, PAPER
from foresee_dsl.derive.reach.ranker import ReachPromise, ReachRanker, Tale, in_order
from foresee_dsl.derive.reach.rolling import ReachSettings, RolledChange, RollOut
from foresee_dsl.forecast.protocol import Mutations, Proposes, Ranker
from foresee_dsl.forecast.registry import load_ranker
from foresee_dsl.simulate.trace import STEP_S, Trace
from tests.support.handmade_traces import EAST, WEST, Track, make_trace, straight
from tests.support.situations import MODELS

SPECS = {name: spec_of(model) for name, model in MODELS.items()}
MEETS_S = 10.0


def oncoming(*, beside_m: float = 3.3, mps: float = 10.0) -> Trace:
    """The ego drives 10 m/s to the east, a car comes towards it in the next lane; they pass each other after 10 s."""
    other = straight("car", 10 * MEETS_S + mps * MEETS_S, beside_m, WEST, mps)
    lane = Track("car", other.states, ("east", "west"), (), ("east_0",), mps)
    return make_trace({"ego": straight("car", 0, 0, EAST, 10), "other": lane})


def ranker(preset: str = "paper", models: Mapping[str, ModelSpec] = SPECS) -> ReachRanker:
    return ReachRanker().before(Mutations(preset, models))


def test_it_is_found_by_name_and_proposes() -> None:
    found = load_ranker("reach")
    assert isinstance(found, Ranker)
    assert isinstance(found, Proposes)
    assert found.rank(oncoming())[0].operator == "steer"  # without a campaign it takes usual vehicles and `focused`


def test_only_a_late_onset_reaches() -> None:
    """From the run's beginning a steered car has left the road long before the ego comes by."""
    trace = oncoming()
    made = replace(ranker(), settings=replace(ReachSettings(), within_m=400.0))
    steers = {p.onset: p for p in made.promises(trace) if isinstance(p.rolled.change.operator, Steer)}
    reaching = sorted(onset * STEP_S for onset, p in steers.items() if len(p.reaching))
    assert reaching
    assert max(reaching) < MEETS_S
    early = [p for onset, p in steers.items() if onset * STEP_S < min(reaching)]
    assert early  # looked at, and too far away for a change to reach the ego
    best = made.rank(trace)[0]
    assert best.actor == "other"
    assert best.operator == "steer"
    assert best.begins is not None
    assert best.begins * STEP_S in reaching
    assert best.begins < best.frame
    assert "changes reach the ego" in best.why


def test_a_contact_before_a_driver_can_react_does_not_count() -> None:
    trace, made = oncoming(), ranker()
    soon = round(made.settings.notice_s / made.settings.step_s)
    promises = made.promises(trace)
    assert all((p.rolled.gaps[p.reaching, :soon] > 0.0).all() for p in promises)
    hasty = replace(made, settings=replace(made.settings, notice_s=0.0)).promises(trace)
    assert sum(len(p.reaching) for p in hasty) > sum(len(p.reaching) for p in promises) > 0


def test_one_that_never_comes_near_is_not_proposed() -> None:
    points = ranker().rank(oncoming(beside_m=80))
    assert [p for p in points if p.operator] == []


def test_no_other_vehicle_means_no_proposal() -> None:
    assert ranker().rank(make_trace({"ego": straight("car", 0, 0, EAST, 10)})) == ()


def test_what_is_beyond_the_end_of_the_run_is_not_a_contact() -> None:
    """The run ends before they meet: the ego does not stand where it was last."""
    trace = oncoming().part(0, round(6 / STEP_S))
    assert all(len(p.reaching) == 0 for p in ranker().promises(trace))


def test_the_same_run_is_ranked_alike() -> None:
    assert str(ranker().rank(oncoming())) == str(ranker().rank(oncoming()))
    assert str(ranker().rank(oncoming(), seed=7)) == str(ranker().rank(oncoming()))


@settings(max_examples=25, deadline=None)
@given(st.floats(0.5, 14.0), st.floats(2.0, 8.0), st.sampled_from([PAPER, FOCUSED]))
def test_only_allowed_changes_are_rolled_out(mps: float, beside_m: float, preset: object) -> None:
    chosen = FOCUSED if preset is FOCUSED else PAPER
    trace = oncoming(mps=mps, beside_m=beside_m)
    gaps = np.full((2, trace.frames), 5.0)
    made = ranker(chosen.name)
    rolling = made.rolling(trace, gaps)
    for change, values in rolling.changes(0, [1]):
        assert isinstance(change, RolledChange)
        if isinstance(change.operator, Steer):
            bound = largest_share(SPECS[trace.actors[1].model], mps, chosen.steer)
            assert np.abs(values).max() <= min(bound, chosen.steer.high) + 1e-9
            assert np.abs(values).min() >= max(chosen.steer.least_share * bound, chosen.steer.step) - 1e-9
        for rolled in rolling.rolled([(change, values)]):
            assert set(rolled.values.tolist()) <= set(values.tolist())
            assert len(rolled.values) <= ReachSettings().shares


def test_values_are_what_the_operator_draws() -> None:
    """The roll-outs and the mutator take their values from the same place."""
    rolling = ranker("focused").rolling(oncoming(), np.full((2, 401), 5.0))
    moment = rolling.moment(60)
    for operator in rolling.operators:
        if not isinstance(operator, Steer):
            continue
        allowed = set(operator.values(moment, "other", FOCUSED))
        rng = np.random.default_rng(0)
        drawn = {operator.changes(moment, "other", FOCUSED, rng)[0].now.si for _ in range(50)}
        assert {round(value, 2) for value in drawn} <= {round(value, 2) for value in allowed}


def test_a_second_moment_of_one_story_comes_after_another_story() -> None:
    steer = operators()["steer"]
    assert isinstance(steer, Steer)
    front, side = Tale("vehicle", 2, 0, 0, False), Tale("vehicle", 0, 1, 0, False)

    def one(onset: int, tale: Tale, share: float) -> ReachPromise:
        nowhere = np.zeros((1, 1, 3))
        rolled = RollOut(RolledChange(onset, 1, steer), np.zeros(1), np.zeros(1), nowhere, np.zeros((1, 1)))
        return ReachPromise(rolled, np.array([0]), {tale: share}, onset + 40)

    ordered = in_order([one(100, front, 0.4), one(120, front, 0.4), one(300, side, 0.3)], ReachSettings())
    assert [p.onset for p in ordered] == [120, 300, 100]  # of equal ones the later onset


def test_a_steered_car_drives_the_bend_that_it_steers() -> None:
    """With a small constant offset it goes round a circle with the radius that its wheelbase and wheels give."""
    trace = oncoming(mps=5.0)
    rolling = ranker().rolling(trace, np.full((2, trace.frames), 5.0))
    change = next(c for c, _ in rolling.changes(0, [1]) if isinstance(c.operator, Steer))
    rolled = rolling.rolled([(change, np.array([0.5]))])[0]
    spec = SPECS[trace.actors[1].model]
    radius_m = spec.wheelbase_m / math.tan(0.5 * spec.max_steer_rad)
    turned = rolled.poses[0, -1, 2] - rolled.poses[0, 10, 2]
    assert turned == pytest.approx(4.0 * 5.0 / radius_m, rel=0.02)


def test_a_head_start_begins_at_the_place_that_it_names() -> None:
    """Also late in a run, when the actor has gone far along its path."""
    crossing = straight("pedestrian", 60, -14, math.pi / 2, 1.4)
    onset, path = 120, tuple((60.0, y) for y in (-14.0, 14.0))
    trace = make_trace({"ego": straight("car", 0, 0, EAST, 10), "walker": replace(crossing, path=path)})
    rolling = ranker("focused").rolling(trace, np.full((2, trace.frames), 5.0))
    change, values = next(c for c in rolling.changes(onset, [1]) if c[0].operator.name == "head_start")
    rolled = rolling.rolled([(change, values)])[0]
    assert rolled.values.min() > 1.4 * onset * STEP_S  # further on than the place at the onset
    assert rolled.poses[:, 0, 1] == pytest.approx(-14.0 + rolled.values, abs=0.01)
