"""Clips of vehicles at stop signs, on roundabouts and on lanes that overlap in junctions go on as their parent did."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.derive.clipping.clip import clip
from foresee_dsl.derive.clipping.fidelity import ClipDeviation, deviation
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.project.expand import expand_clip
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import Trace

SCENE = Path(__file__).parent / "following" / "junctions.foresee"


class Stands:
    """Does nothing, so that only the others move."""

    name, version = "stands", "1"

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        pass

    def step(self, observation: Observation) -> Control:
        return Control(0.0, 0.0, 1.0)


@lru_cache
def parent() -> tuple[TestCase, Trace]:
    case = load_test_case(str(SCENE))
    return case, run(compile_test_case(case), Stands()).trace


def restored(frame: int) -> ClipDeviation:
    case, trace = parent()
    point = RiskyPoint(1, frame, frame * 0.05, "", "none", math.nan, math.nan, 0.0, "a test")
    made = clip(case, trace, point, before_s=0.0, after_s=4.0, name="again", parent="junctions.foresee")
    child = run(compile_test_case(expand_clip(made, case, source=SCENE)), Stands()).trace
    return deviation(trace, frame, child)


def frames_on(actor: str, lanes: Sequence[str], every: int) -> list[int]:
    """Return frames at which an actor is on the lanes that begin so."""
    _, trace = parent()
    k = trace.index(actor)
    on = [f for f in range(trace.frames - 80) if trace.lane_ids[trace.lanes[f, k]].startswith(tuple(lanes))]
    assert on
    return on[::every]


def brakes_at(actor: str, lane: str) -> list[int]:
    _, trace = parent()
    k = trace.index(actor)
    return [f for f in frames_on(actor, [lane], 1) if trace.states[f, k, 4] < -1.0]


@pytest.mark.parametrize("share", [0.2, 0.5, 0.7, 0.9, 1.0])
def test_who_brakes_for_a_stop_sign_has_not_stopped_yet(share: float) -> None:
    frames = brakes_at("stopper", "dock_mid_")
    assert restored(frames[round(share * (len(frames) - 1))]).actors["stopper"] < 0.01


def test_who_has_stopped_at_a_stop_sign_goes_on() -> None:
    last = brakes_at("stopper", "dock_mid_")[-1]
    for frame in range(last + 2, last + 20, 6):
        assert restored(frame).actors["stopper"] < 0.03  # at most a step later


@pytest.mark.parametrize("actor", ["around", "across"])
def test_lanes_of_a_roundabout_are_told_apart(actor: str) -> None:
    for frame in frames_on(actor, [":ring_"], 7):
        assert restored(frame).actors[actor] < 0.05, frame


def test_a_route_that_comes_to_a_junction_twice_is_gone_on_with_the_first_time() -> None:
    for frame in frames_on("twice", [":park_oak_"], 6):
        assert restored(frame).actors["twice"] < 0.05, frame


def test_who_has_just_come_onto_a_junction_goes_on() -> None:
    first = frames_on("stopper", [":dock_elm_"], 1)[0]
    for frame in (first - 1, first, first + 1, first + 2):
        assert restored(frame).actors["stopper"] < 0.01, frame
