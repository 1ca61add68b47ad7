"""Test cases, runs and risky points to derive from, without a simulation."""

from __future__ import annotations

import math
from decimal import Decimal
from pathlib import Path

from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.model import Actor, Ego, Network, Quantity, Scenario, VehicleModel
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.simulate.trace import Trace
from tests.support.handmade_traces import EAST, NORTH, WEST, Track, make_trace, straight


def q(text: str) -> Quantity:
    """`12.4 s` as a quantity."""
    number, _, unit = text.partition(" ")
    return Quantity(value=Decimal(number), unit=unit)


def model(name: str, length: str, width: str, max_speed: str = "50 m/s") -> VehicleModel:
    return VehicleModel(name=name, length=q(f"{length} m"), width=q(f"{width} m"), max_speed=q(max_speed))


MODELS = {
    m.name: m
    for m in (
        model("car.compact", "4", "1.8"),
        model("car.long", "5.5", "1.9"),
        model("car.slow", "4", "1.8", "3 m/s"),
        model("van.delivery", "6", "2"),
        model("bicycle.city", "1.8", "0.6", "8 m/s"),
        model("bicycle.racing", "1.7", "0.5", "14 m/s"),
        model("pedestrian.adult", "0.5", "0.5", "3 m/s"),
        model("pedestrian.child", "0.3", "0.4", "3 m/s"),
        model("obstacle.barrier", "2", "0.5"),
    )
}


def case_of(*items: object, case: str = "r02") -> TestCase:
    """Return a concrete scenario with these items; an ego is added if there is none."""
    body = items if any(isinstance(i, Ego) for i in items) else (Ego(model="car.compact"), *items)
    return TestCase(
        id=f"runs.foresee::{case}" if case else "runs.foresee",
        scenario=Scenario(name="runs", body=body),
        network=Network(name="here", body=()),
        models=MODELS,
        meaning="sha256:0123456789ab",
        source=Path("runs.foresee"),
    )


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


__all__ = ["EAST", "MODELS", "NORTH", "WEST", "Actor", "case_of", "crossing", "make_trace", "q", "risky", "walker"]
