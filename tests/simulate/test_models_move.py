"""A swap of the model changes how an actor moves: in SUMO's lanes, along paths, and as a driven bicycle model."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.derive.clipping.clip import clip
from foresee_dsl.drivers.protocol import Control
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Change, CruiseSpeed, Mutant
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.language.project.loading import bundled_models
from foresee_dsl.simulate.actors.dynamics import Bicycle, BicycleState, limits_of
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import SPEED, STEP_S, Trace, X
from tests.support.scenes import Cruise
from tests.support.worlds import written_case

NETWORK = """foresee 1

network straight {
  junction a at (0 m, 0 m)
  junction b at (900 m, 0 m)
  road main from a to b { lanes 2; back 1; speed 100 km/h; sidewalk 2 m }
}
"""
SCENARIO = """foresee 1

scenario moves {
  use network "straight.foresee"
  ego: car.sedan {
    route [main]
    start at 700 m along main
    start speed 0 km/h
    goal 890 m along main
  }
  %s
  end after 20 s
}
"""
SPECS = {name: spec_of(model) for name, model in bundled_models().items()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("moves")
    (made / "straight.foresee").write_text(NETWORK)
    return made


def case_with(folder: Path, actors: str) -> TestCase:
    return written_case(folder / "moves.foresee", SCENARIO % actors)


def drive(case: TestCase) -> Trace:
    return run(compile_test_case(case), Cruise(0.0)).trace


def swapped(case: TestCase, trace: Trace, actor: str, was: str, now: str, at_s: float = 2.0) -> TestCase:
    """Cut a clip of a run that begins at a time, and swap one model in it."""
    point = RiskyPoint(1, trace.frame_at(at_s), at_s, actor, "close", 1.0, math.nan, 1.0, "for the test")
    cut = clip(case, trace, point, before_s=0.0, after_s=15.0, name="p1", parent="moves.foresee")
    clip_case = expand_clip(cut, case, source=case.source.parent / "p1.foresee")
    change = Change(actor=actor, property="model", was=was, now=now)
    mutant = Mutant(name="p1_m1", parent="p1.foresee", pin="sha256:000000000000", body=(change,))
    return expand_mutant(mutant, clip_case, source=case.source.parent / "p1_m1.foresee")


def speeds(trace: Trace, actor: str) -> np.ndarray:
    return trace.states[:, trace.index(actor), SPEED]


def first_over(trace: Trace, actor: str, speed_mps: float) -> float:
    """When an actor is first as fast as this, s."""
    return float(trace.time_s[int(np.argmax(speeds(trace, actor) >= speed_mps))])


def driven_m(trace: Trace, actor: str) -> float:
    return float(np.nansum(speeds(trace, actor))) * STEP_S


STANDS = "vehicle npc: %s { route [main]; start at 100 m along main; start speed 0 km/h; speed 45 km/h }"


@pytest.mark.parametrize("name", ["car.sports", "car.sedan", "van.parcel", "truck.three_axle", "motorcycle.moped"])
def test_sumo_speeds_up_as_the_model_can(folder: Path, name: str) -> None:
    spec = SPECS[name]
    trace = drive(case_with(folder, STANDS % name))
    takes_s = first_over(trace, "npc", 30 / 3.6) - first_over(trace, "npc", 0.5)
    assert takes_s == pytest.approx((30 / 3.6 - 0.5) / spec.acceleration_mps2, abs=0.1)
    assert np.nanmax(speeds(trace, "npc")) == pytest.approx(45 / 3.6, abs=1e-3)


BRAKES = """vehicle npc: %s {
    route [main]
    start at 100 m along main
    start speed 50 km/h
    speed 50 km/h
  }
  vehicle queue: van.delivery {
    route [main]
    start at %g m along main
    start speed 0 km/h
    speed 0.1 m/s
  }"""


@pytest.mark.parametrize("name", ["car.sports", "car.sedan", "bus.coach"])
def test_sumo_brakes_as_the_model_does_in_comfort_and_in_need(folder: Path, name: str) -> None:
    spec, v = SPECS[name], 50 / 3.6
    room_m = v * v / (2 * (spec.braking_mps2 + 0.7 * (spec.emergency_braking_mps2 - spec.braking_mps2)))
    in_need_m = SPECS["van.delivery"].length_m + 2.0 + room_m  # SUMO's minGap
    found = []
    for ahead_m in (150.0, in_need_m):
        trace = drive(case_with(folder, BRAKES % (name, 100.0 + ahead_m)))
        speed = speeds(trace, "npc")
        assert np.nanmin(speed) < 0.2
        apart_m = trace.states[:, trace.index("queue"), X] - trace.states[:, trace.index("npc"), X]
        assert np.nanmin(apart_m) > (spec.length_m + SPECS["van.delivery"].length_m) / 2
        slower = int(np.argmax(speed < v - 1e-6))
        found.append((float(np.nansum(speed[slower:])) * STEP_S, -float(np.nanmin(np.diff(speed))) / STEP_S))
    comfort, need = found
    # Krauss keeps as far away as it can stop in, after a second of reaction (tau in the types).
    assert comfort[0] == pytest.approx(v * v / (2 * spec.braking_mps2) + v * 1.0, rel=0.03)
    assert comfort[1] < spec.braking_mps2
    assert spec.braking_mps2 * 1.3 < need[1] <= spec.emergency_braking_mps2 + 1e-3


def test_a_car_that_becomes_a_bus_needs_longer_by_the_ratio_of_their_accelerations(folder: Path) -> None:
    actor = "vehicle npc: car.sedan { route [main]; start at 100 m along main; delay 2 s; speed 50 km/h }"
    case = case_with(folder, actor)
    parent = drive(case)
    child = drive(swapped(case, parent, "npc", "car.sedan", "bus.city", at_s=1.0))
    took = [first_over(t, "npc", 30 / 3.6) - first_over(t, "npc", 0.5) for t in (parent, child)]
    assert took[1] / took[0] == pytest.approx(2.8 / 1.2, rel=0.05)
    assert child.actors[child.index("npc")].length_m == 12.0


def test_nobody_is_faster_than_the_model_that_it_was_swapped_for(folder: Path) -> None:
    route = "route [main]; start at 100 m along main; start speed 40 km/h; speed 60 km/h"
    case = case_with(folder, f"vehicle npc: motorcycle.street {{ {route} }}")
    child_case = swapped(case, drive(case), "npc", "motorcycle.street", "motorcycle.moped", at_s=0.1)
    child = drive(child_case)
    assert np.nanmax(speeds(child, "npc")) == pytest.approx(45 / 3.6, abs=1e-3)
    assert child.actors[child.index("npc")].cruise_mps == pytest.approx(45 / 3.6, abs=1e-3)


def test_who_is_told_to_drive_faster_than_it_can_drives_what_it_can(folder: Path) -> None:
    lines = (
        "vehicle npc: motorcycle.moped {\n route [main]\n start at 100 m along main\n speed 40 km/h\n}\n"
        "  pedestrian walker: pedestrian.elderly {\n path [(50 m, -6 m), (150 m, -6 m)]\n}\n"
        "  when time > 1 s {\n npc changes speed to 60 km/h over 2 s\n walker changes speed to 4 m/s over 1 s\n}"
    )
    trace = drive(case_with(folder, lines))
    assert np.nanmax(speeds(trace, "npc")) == pytest.approx(45 / 3.6, abs=1e-3)
    assert np.nanmax(speeds(trace, "walker")) == pytest.approx(1.8)


WALKS = "pedestrian npc: %s { path [(50 m, -6 m), (150 m, -6 m)]%s }"


@pytest.mark.parametrize(
    ("was", "said", "now", "pace_mps"),
    [
        ("pedestrian.adult", "", "pedestrian.elderly", 0.9),
        ("pedestrian.adult", "", "pedestrian.hurried", 1.8),
        ("pedestrian.child", "; speed 1.8 m/s", "pedestrian.luggage", 1.8 * 1.15 / 1.2),
        ("pedestrian.elderly", "; speed 1.35 m/s", "pedestrian.walking_frame", 0.96),
    ],
)
def test_people_walk_at_the_pace_of_who_they_have_become(
    folder: Path, was: str, said: str, now: str, pace_mps: float
) -> None:
    case = case_with(folder, WALKS % (was, said))
    parent = drive(case)
    child = drive(swapped(case, parent, "npc", was, now))
    assert speeds(child, "npc")[0] == pytest.approx(speeds(parent, "npc")[40], abs=1e-4)
    assert speeds(child, "npc")[60:] == pytest.approx(pace_mps, abs=1e-3)


@pytest.mark.parametrize("way", ["route [main]; start at 100 m along main", "path [(50 m, -2 m), (450 m, -2 m)]"])
def test_bicycles_ride_at_the_pace_of_their_model_in_lanes_and_on_paths(folder: Path, way: str) -> None:
    case = case_with(folder, f"bicycle npc: bicycle.city {{ {way} }}")
    parent = drive(case)
    assert speeds(parent, "npc")[60:] == pytest.approx(15 / 3.6, abs=1e-3)
    found = {}
    for name in ("bicycle.cargo", "bicycle.racing"):
        child = drive(swapped(case, parent, "npc", "bicycle.city", name))
        found[name] = driven_m(child, "npc")
        spec = SPECS[name]
        assert spec.cruise_mps is not None
        assert speeds(child, "npc")[-1] == pytest.approx(spec.cruise_mps, abs=1e-3)
        gaining = np.diff(speeds(child, "npc")) / STEP_S
        assert np.nanmax(gaining) <= spec.acceleration_mps2 + 1e-3
    assert found["bicycle.racing"] > found["bicycle.cargo"] + 20


def test_a_pace_that_an_author_says_in_a_scenario_stays_when_the_case_has_another_model(folder: Path) -> None:
    found = [
        drive(case_with(folder, WALKS % (name, "; speed 1.5 m/s")))
        for name in ("pedestrian.adult", "pedestrian.elderly")
    ]
    assert [speeds(t, "npc")[-1] for t in found] == pytest.approx([1.5, 1.5])


def test_a_swap_for_the_same_pace_leaves_the_speed_line_as_it_was(folder: Path) -> None:
    case = case_with(folder, STANDS % "car.sedan")
    trace = drive(case)
    before = swapped(case, trace, "npc", "car.sedan", "car.wagon").scenario.actors[1]
    (cruise,) = (item for item in before.body if isinstance(item, CruiseSpeed))
    assert cruise.speed == case.scenario.actors[1].body[-1].speed


@pytest.mark.parametrize("name", [name for name, spec in SPECS.items() if spec.wheelbase_m > 0])
def test_a_driven_model_turns_speeds_up_and_brakes_within_its_limits(name: str) -> None:
    spec = SPECS[name]
    bicycle = Bicycle(limits_of(spec, friction=1.2))  # more than any road has: the model limits, not the tyres
    state = BicycleState(0.0, 0.0, 0.0, 1.0, steer=spec.max_steer_rad)
    turned = bicycle.step(state, Control(1.0, 0.0, 0.0), 0.05)
    assert turned.speed / turned.yaw_rate == pytest.approx(spec.wheelbase_m / math.tan(spec.max_steer_rad), rel=1e-6)
    wheel = bicycle.step(replace(state, steer=0.0), Control(1.0, 0.0, 0.0), 0.05).steer
    assert wheel == pytest.approx(spec.steer_rate_rad_s * 0.05)

    v = min(50 / 3.6, 0.9 * spec.max_speed_mps)
    state, way_m = BicycleState(0.0, 0.0, 0.0, v), 0.0
    while state.speed > 0:
        state = bicycle.step(state, Control(0.0, 0.0, 1.0), 0.05)
        way_m = state.x
    lag_m = v * 0.1  # of the brakes (`dynamics.BRAKE_LAG_S`)
    assert way_m == pytest.approx(v * v / (2 * spec.emergency_braking_mps2) + lag_m, rel=0.05, abs=0.2)

    state = BicycleState(0.0, 0.0, 0.0, 0.0)
    for _ in range(round(60 / 0.05)):
        state = bicycle.step(state, Control(0.0, 1.0, 0.0), 0.05)
    assert 0.5 * spec.max_speed_mps < state.speed <= spec.max_speed_mps + 1e-9
