"""What a perturbed vehicle brakes for: beside the formulas, in runs with SUMO."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from foresee_dsl.compile.bundle import ModelSpec, PlacedActor, TimedValue
from foresee_dsl.compile.roads.polyline import Polyline
from foresee_dsl.drivers.protocol import VehicleLimits
from foresee_dsl.kernels.boxes import Mover, box_distance
from foresee_dsl.simulate.actors.dynamics import BicycleState
from foresee_dsl.simulate.actors.target_selection import Target, TargetSelection
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y
from tests.support.scenes import Cruise, Town
from tests.support.worlds import ADULT

CAR = VehicleLimits("car.compact", 4.0, 1.8, 2.6, 0.85, 45.0, 2.6, 4.5, 8.0, math.radians(35), math.radians(400), 0.9)
STRAIGHT = Polyline.of([(0.0, 0.0), (600.0, 0.0)])


def seen(*others: Mover, yields: bool = True, strays: bool = False, steer: float = 0.0) -> list[Target]:
    """What a car at x = 50 m that drives east with 10 m/s has in its way."""
    state = BicycleState(50.0, 0.0, 0.0, 10.0, steer=steer)
    return list(TargetSelection(CAR, STRAIGHT).targets(state, 50.0, others, strays=strays, yields=yields))


def test_who_will_cross_its_way_is_a_wall_where_they_meet() -> None:
    # In 1.5 s the car's front comes to 67 m; a walker there walks north with 1.5 m/s and is 2.25 m south of the lane.
    (found,) = seen(Mover(67.0, -2.25, math.pi / 2, 1.5, 0.5, 0.5))
    assert found.speed_mps == 0.0
    # It is first in the way once its front (50 + 2 + 10 t) is at its side (66.75): t = 1.475 s, the next look 1.5 s.
    assert found.room_m == pytest.approx(15.0)


@pytest.mark.parametrize(
    "other",
    [
        Mover(67.0, -9.0, math.pi / 2, 1.5, 0.5, 0.5),  # comes 4 s too late
        Mover(67.0, -2.25, -math.pi / 2, 1.5, 0.5, 0.5),  # goes away
        Mover(67.0, -2.25, math.pi / 2, 0.0, 0.5, 0.5),  # waits at the kerb
        Mover(50.0, -8.0, math.pi / 2, 8.0, 4.0, 1.8),  # comes against its side
        Mover(90.0, 3.3, math.pi + 0.1, 12.0, 4.0, 1.8),  # oncoming in its own lane, in a bend
        Mover(math.nan, math.nan, math.nan, math.nan, 4.0, 1.8),
    ],
)
def test_who_does_not_come_in_front_of_it_is_none(other: Mover) -> None:
    assert seen(other) == []


def test_who_runs_a_light_minds_what_is_in_its_lane_only() -> None:
    crossing, standing = Mover(67.0, -9.0, math.pi / 2, 6.0, 4.0, 1.8), Mover(80.0, 0.4, 0.0, 0.0, 4.0, 1.8)
    assert len(seen(crossing, standing)) == 2
    assert seen(crossing, standing, yields=False) == [Target(pytest.approx(26.0), 0.0)]


def test_on_a_swerve_it_looks_along_the_arc_of_its_wheels() -> None:
    # On a radius of 60 m it is 15^2 / 120 = 1.9 m to the left 15 m further on: there they meet, not on the lane.
    steer = math.atan(CAR.wheelbase_m / 60)
    comes = Mover(65.0, 7.0, -math.pi / 2, 3.0, 0.6, 0.6)
    assert seen(comes, strays=True, steer=steer)
    assert not seen(comes, strays=True, steer=-steer)


# --- in runs ---------------------------------------------------------------------------------------------------------

WEST_TO_EAST = ("n01_n11", "n11_n21")
BIKE = ModelSpec("bicycle.city", "bicycle", 1.8, 0.6, 1.1, 0.35, 95.0, 8.0, 1.0, 3.0, 5.0, 0.6, 3.0)


def beside(town: Town, at_m: float, left_m: float) -> tuple[float, float]:
    """A point beside the lane of the swerving car."""
    x, y, heading = town.network.edges["n01_n11"].lanes[1].line.at(at_m)
    return x - left_m * math.sin(heading), y + left_m * math.cos(heading)


def swerves(town: Town, other: PlacedActor, *, onset_s: float = 0.5, value: float = 0.02, **more: object) -> Trace:
    steering = TimedValue(value, onset_s, onset_s + 1.0)
    car = town.vehicle("car", WEST_TO_EAST, 20.0, speed=10.0, cruise=10.0, steering=steering, **more)
    ego = town.ego(("n30_n20", "n20_n10"), 10.0, speed=0.0)
    return run(town.bundle([ego, car, other], end_s=5.0), Cruise(0.0)).trace


def nearest(trace: Trace) -> float:
    """How near the car and the other come to each other, m."""
    boxes = []
    for name in ("car", "other"):
        k = trace.index(name)
        info, rows = trace.actors[k], trace.states[:, k]
        size = np.tile([info.length_m, info.width_m], (trace.frames, 1))
        boxes.append(np.hstack([rows[:, [X, Y, HEADING]], size]))
    return float(np.nanmin(box_distance(*boxes)))


def crosses(town: Town, model: ModelSpec, speed: float, left_m: float, at_m: float) -> PlacedActor:
    """Somebody who starts beside the lane and goes straight over it."""
    side = -1 if left_m > 0 else 1
    path = [beside(town, at_m, left_m), beside(town, at_m, left_m + side * 30)]
    return replace(town.walker("other", path, speed=speed), model=model)


@pytest.mark.parametrize("onset_s", [0.05, 1.5])
@pytest.mark.parametrize(
    ("model", "speed", "left_m", "at_m"),
    [(ADULT, 1.5, 3.6, 46.0), (ADULT, 1.5, -3.6, 46.0), (BIKE, 4.0, -9.6, 46.0), (BIKE, 4.0, 9.6, 46.0)],
)
def test_it_brakes_for_who_crosses_while_steered_and_afterwards(
    town: Town, onset_s: float, model: ModelSpec, speed: float, left_m: float, at_m: float
) -> None:
    trace = swerves(town, crosses(town, model, speed, left_m, at_m), onset_s=onset_s)
    car = trace.states[:, trace.index("car"), SPEED]
    assert car.min() < 7.0
    assert nearest(trace) > 0.05


def test_who_refuses_to_yield_sees_the_same_rider_too_late(town: Town) -> None:
    rider = crosses(town, BIKE, 4.0, 9.6, 46.0)
    late = nearest(swerves(town, rider, onset_s=0.05, ignores=(("priority", None),)))
    assert late < 0.5 < 0.5 * nearest(swerves(town, rider, onset_s=0.05))


def test_it_stops_for_something_that_stands_where_it_is_steered_to(town: Town) -> None:
    x, y = beside(town, 50.0, 1.5)
    trace = swerves(town, town.crate("other", x, y), onset_s=0.5, value=0.03)
    assert nearest(trace) > 0.0
    assert trace.states[:, trace.index("car"), SPEED].min() < 5.0


def test_it_brakes_for_the_ego_that_crosses(town: Town) -> None:
    # Both come to the middle of the same junction after 4.5 s; the ego takes notice of nobody.
    steering = TimedValue(0.01, 0.2, 0.7)
    car = town.vehicle("car", ("n11_n21", "n21_n31"), 60.0, speed=10.0, cruise=10.0, steering=steering)
    ego = town.ego(("n22_n21", "n21_n20"), 65.0, speed=10.0)

    def slowest(*ignores: tuple[str, None]) -> float:
        trace = run(town.bundle([ego, replace(car, ignores=ignores)], end_s=6.0), Cruise(10.0)).trace
        return float(np.nanmin(trace.states[:, 1, SPEED]))

    assert slowest() < 5.0
    assert slowest(("signals", None)) > 8.0, "who runs red lights does not suddenly yield"
