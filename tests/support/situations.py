"""Test cases, runs and risky points to derive from, without a simulation."""

from __future__ import annotations

import math

from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Actor, Ego, Network, Scenario
from foresee_dsl.simulate.trace import Trace
from tests.support.handmade_traces import EAST, NORTH, WEST, Track, make_trace, straight
from tests.support.worlds import case_from, model, q

MODELS = {
    m.name: m
    for m in (
        model(name, q(length_m), q(width_m), max_speed=q(fastest_mps, "m/s"))
        for name, length_m, width_m, fastest_mps in (
            ("car.compact", 4, 1.8, 50),
            ("car.long", 5.5, 1.9, 50),
            ("car.slow", 4, 1.8, 3),
            ("van.delivery", 6, 2, 50),
            ("bicycle.city", 1.8, 0.6, 8),
            ("bicycle.racing", 1.7, 0.5, 14),
            ("pedestrian.adult", 0.5, 0.5, 3),
            ("pedestrian.child", 0.3, 0.4, 3),
            ("obstacle.barrier", 2, 0.5, 50),
        )
    )
}


def case_with(*items: object, case: str = "r02") -> TestCase:
    """Return a concrete scenario with these items; an ego is added if there is none."""
    body = items if any(isinstance(i, Ego) for i in items) else (Ego(model="car.compact"), *items)
    scenario, network = Scenario(name="runs", body=body), Network(name="here", body=())
    return case_from(scenario, network, MODELS, case=case, meaning="sha256:0123456789ab")


def risky(trace: Trace, actor: str, time_s: float) -> RiskyPoint:
    frame = trace.frame_at(time_s)
    return RiskyPoint(1, frame, time_s, actor, "critical crossing", 2.0, 0.0, 3.5, f"{actor} is near")


def crossing(**more: Track) -> dict[str, Track]:
    """The ego drives east at 5 m/s; `runner` crosses its way north at x = 50, two seconds behind it."""
    ego = straight("car", 0, 0, EAST, 5)
    runner = straight("car", 50, -48, NORTH, 4)
    return {
        "ego": Track(ego.kind, ego.states, route=("west", "east_back"), lanes=("west_0",)),
        "runner": Track(runner.kind, runner.states, route=("south", "north_back"), lanes=("south_0",), cruise_mps=4.0),
        **more,
    }


def walker(
    x: float, y: float, heading: float, speed: float, *, start_s: float = 0.0, kind: str = "pedestrian"
) -> Track:
    """Return a path-follower that moves off at `start_s`; its path is 40 m long and begins at its position."""
    track = straight(kind, x, y, heading, speed, start_s=start_s)
    end = (x + 40 * math.cos(heading), y + 40 * math.sin(heading))
    return Track(kind, track.states, path=((x, y), end), cruise_mps=speed)


__all__ = ["EAST", "MODELS", "NORTH", "WEST", "Actor", "case_with", "crossing", "make_trace", "risky", "walker"]
