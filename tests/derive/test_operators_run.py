"""Mutants in real SUMO: a child differs from its clip in what its change says, and in nothing before that."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.derive.clipping.clip import clip
from foresee_dsl.derive.mutate import mutate
from foresee_dsl.derive.presets import FOCUSED
from foresee_dsl.drivers.idm import IdmDriver
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.model import Actor, Change, Clip, IgnoresRule, Mutant
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.expand import expand_clip, expand_mutant
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import HEADING, SPEED, STEP_S, Trace, X, Y

NETWORK = """foresee 1

network cross {
  junction middle at (0 m, 0 m)
  junction west_end at (-150 m, 0 m)
  junction east_end at (150 m, 0 m)
  junction north_end at (0 m, 150 m)
  road west from west_end to middle { lanes 1; speed 50 km/h; sidewalk 2 m }
  road east from middle to east_end { lanes 1; speed 50 km/h; sidewalk 2 m }
  road north from north_end to middle { lanes 1; speed 50 km/h; sidewalk 2 m }
}
"""
PARENT = """foresee 1

scenario parent {
  use network "cross.foresee"
  use models "models.foresee"
  ego: car.sedan {
    route from west straight over middle
    start at 20 m along ego.route
    speed 20 km/h
  }
  expect never collision(ego)
  end after 12 s
}
"""
CLIP = """foresee 1

clip moments of "parent.foresee" pin PIN {
  window 0.00 s..6.00 s
  risk "a test" at 3.00 s with walker
  ego: car.sedan at (-110 m, -1.65 m) heading 0 deg speed 5 m/s { route [west, east]; speed 20 km/h }
  goal (-60 m, -1.65 m)
  pedestrian walker: pedestrian.adult at (-40 m, -9 m) heading 90 deg speed 1.3 m/s {
    path [(-40.00 m, -12.00 m), (-40.00 m, 8.00 m)]
    moving 3.00 m
    speed 1.3 m/s
  }
  pedestrian waiter: pedestrian.adult at (-45 m, -9 m) heading 90 deg speed 0 m/s {
    path [(-45.00 m, -9.00 m), (-45.00 m, 8.00 m)]
    moving 0.00 m
    speed 1.3 m/s
    delay 1.00 s
  }
  bicycle rider: bicycle.city at (-90 m, -1.65 m) heading 0 deg speed 4 m/s { route [west, east]; speed 4 m/s }
  bicycle cutter: bicycle.city at (20 m, 9 m) heading 180 deg speed 3 m/s {
    path [(25.00 m, 9.00 m), (-60.00 m, 9.00 m)]
    moving 5.00 m
    speed 3 m/s
  }
  vehicle car: car.compact at (-20 m, 1.65 m) heading 180 deg speed 10 m/s { route [west_back]; speed 10 m/s }
}
"""


@pytest.fixture(scope="module")
def clip_case(tmp_path_factory: pytest.TempPathFactory, scenarios: Path) -> TestCase:
    folder = tmp_path_factory.mktemp("moments")
    (folder / "models.foresee").write_text((scenarios / "models.foresee").read_text(encoding="utf-8"))
    (folder / "cross.foresee").write_text(NETWORK)
    (folder / "parent.foresee").write_text(PARENT)
    pin = load_test_case(folder / "parent.foresee").meaning
    (folder / "moments.foresee").write_text(CLIP.replace("PIN", pin))
    return load_test_case(folder / "moments.foresee")


@pytest.fixture(scope="module")
def parent(clip_case: TestCase) -> Trace:
    return drive(clip_case)


def drive(case: TestCase) -> Trace:
    return run(compile_test_case(case), IdmDriver()).trace


def child_of(clip_case: TestCase, *lines: str) -> TestCase:
    """A mutant with these change lines, through its text."""
    text = f'foresee 1\n\nmutant child of "moments.foresee" pin {pin_of(clip_case)} {{\n'
    text += "".join(f"  change {line}\n" for line in lines) + "}\n"
    model = parse(text, "child.foresee").model
    assert isinstance(model, Mutant)
    assert parse(print_model(model), "child.foresee").model == model
    source = clip_case.source.parent / "child.foresee"
    source.write_text(print_model(model))
    assert load_test_case(source).scenario == expand_mutant(model, clip_case, source=source).scenario
    return load_test_case(source)


def apart(one: Trace, other: Trace, actor: str) -> np.ndarray:
    """How far an actor is in one run from where it is in the other, at each frame of both."""
    frames = min(one.frames, other.frames)
    a = one.states[:frames, one.index(actor)][:, [X, Y]]
    b = other.states[:frames, other.index(actor)][:, [X, Y]]
    return np.hypot(*(a - b).T)


def same_but(parent: Trace, child: Trace, *changed: str) -> None:
    """Nobody else does anything else, the ego included: all keep clear of each other here."""
    for info in parent.actors:
        if info.id not in changed:
            assert np.nanmax(apart(parent, child, info.id)) < 1e-6, info.id


def test_a_walker_ends_beside_its_line(clip_case: TestCase, parent: Trace) -> None:
    child = drive(child_of(clip_case, "walker.line: 0.00 m => 0.60 m"))
    x = child.states[:, child.index("walker"), X]
    away = apart(parent, child, "walker")
    assert away[0] < 1e-3
    # It walks north: its left is west. 5 m of path take it 3.9 s.
    assert x[-1] == pytest.approx(-40.6, abs=0.01)
    assert x[round(1.93 / STEP_S)] == pytest.approx(-40.3, abs=0.02)
    assert np.nanmax(np.abs(np.diff(x))) * 20 < 0.2, "it goes over, it does not jump"
    same_but(parent, child, "walker")


def test_a_line_to_the_right_is_negative(clip_case: TestCase) -> None:
    child = drive(child_of(clip_case, "walker.line: 0.00 m => -0.45 m"))
    assert child.states[-1, child.index("walker"), X] == pytest.approx(-39.55, abs=0.01)


def test_a_bicycle_keeps_beside_the_middle_of_its_lane(clip_case: TestCase, parent: Trace) -> None:
    child = drive(child_of(clip_case, "rider.line: 0.00 m => -0.60 m"))
    y, was = (t.states[:, t.index("rider"), Y] for t in (child, parent))
    assert was == pytest.approx(-1.65, abs=1e-3)
    assert y[0] == pytest.approx(-1.65, abs=1e-3)
    assert y[-1] == pytest.approx(-2.25, abs=0.01)
    assert np.abs(np.diff(y)).max() <= 1.0 * STEP_S + 1e-9
    assert child.states[:, child.index("rider"), X] == pytest.approx(
        parent.states[:, parent.index("rider"), X], abs=0.2
    )
    same_but(parent, child, "rider", "ego")  # which drives behind it


def test_a_head_start_moves_it_along_its_path(clip_case: TestCase, parent: Trace) -> None:
    child = drive(child_of(clip_case, "walker.moving: 3.00 m => 3.65 m"))
    ahead = (child.states - parent.states)[:, parent.index("walker"), Y]
    assert ahead == pytest.approx(0.65, abs=1e-3)
    same_but(parent, child, "walker")


def test_who_was_to_stand_can_start_earlier_and_later(clip_case: TestCase, parent: Trace) -> None:
    def moves_off(trace: Trace) -> float:
        return float(trace.time_s[np.argmax(trace.states[:, trace.index("waiter"), SPEED] > 0)])

    assert moves_off(parent) == pytest.approx(1.05)
    for now, expected in (("0.40 s", 0.45), ("1.75 s", 1.80)):
        child = drive(child_of(clip_case, f"waiter.delay: 1.00 s => {now}"))
        assert moves_off(child) == pytest.approx(expected)
        until = round(min(expected, 1.05) / STEP_S) - 1
        assert apart(parent, child, "waiter")[:until].max() == 0.0
        same_but(parent, child, "waiter")


@pytest.mark.parametrize(("actor", "mps"), [("rider", 4.0), ("cutter", 3.0), ("walker", 1.3)])
def test_pace_of_bicycles_on_lanes_and_of_path_followers(
    clip_case: TestCase, parent: Trace, actor: str, mps: float
) -> None:
    child = drive(child_of(clip_case, f"{actor}.timing: 1.00 => 0.80"))
    assert child.states[:100, child.index(actor), SPEED] == pytest.approx(0.8 * mps, abs=1e-3)
    assert apart(parent, child, actor)[100] == pytest.approx(0.2 * mps * 5.0, abs=0.05)
    same_but(parent, child, actor, *(["ego"] if actor == "rider" else []))  # it drives behind the rider


def test_a_steered_bicycle_leans_within_its_balance_and_comes_back(clip_case: TestCase, parent: Trace) -> None:
    child = drive(child_of(clip_case, "rider.steer: 0.00 => 1.00 from 1.00 s for 1.00 s"))
    states = child.states[:, child.index("rider")]
    before = round(1.0 / STEP_S) + 1
    assert apart(parent, child, "rider")[:before].max() < 1e-6
    lateral = np.abs(states[:, SPEED] * states[:, 5])
    assert 0.8 * 0.4 * 9.81 < np.nanmax(lateral) <= 0.4 * 9.81 + 1e-6
    assert np.nanmax(np.abs(states[:, Y] + 1.65)) > 0.5
    assert math.degrees(abs(states[-1, HEADING])) < 20


@pytest.mark.parametrize("ranked", ["walker", "rider", "cutter"])
def test_what_is_drawn_runs_and_says_what_differs(clip_case: TestCase, parent: Trace, ranked: str) -> None:
    found = clip_case.clip
    assert isinstance(found, Clip)
    risk = found.risk
    assert risk is not None
    preset = replace(FOCUSED, reach_m=None, farthest_m=None)  # whoever is ranked
    body = tuple(i.model_copy(update={"actor": ranked}) if i is risk else i for i in found.body)
    made = mutate(clip_case, found.model_copy(update={"body": body}), parent, preset=preset, count=8, seed=3)
    kinds = {c.property for m in made for c in m.changes if isinstance(c, Change)}
    assert {c.actor for m in made for c in m.changes} == {ranked}
    expected = {
        "walker": {"timing", "line", "delay", "moving", "model"},
        "rider": {"steer", "timing", "line", "model"},
        "cutter": {"timing", "line", "moving", "model"},
    }
    assert kinds == expected[ranked]
    for mutant in made[:4]:
        child = drive(expand_mutant(mutant, clip_case, source=clip_case.source.parent / "drawn.foresee"))
        assert np.nanmax(apart(parent, child, ranked)) > 0.05, print_model(mutant)


@pytest.mark.parametrize("at_s", [0.3, 2.0])
def test_a_clip_of_somebody_beside_its_line_goes_on_there(clip_case: TestCase, at_s: float) -> None:
    child = child_of(clip_case, "walker.line: 0.00 m => 0.60 m", "rider.line: 0.00 m => -0.60 m")
    whole = drive(child)
    frame = whole.frame_at(at_s)
    point = RiskyPoint(1, frame, at_s, "walker", "close", 1.0, 0.0, 1.0, "a test")
    again = clip(child, whole, point, before_s=0, after_s=3, name="again", parent="child.foresee")
    said = {item.name: {part.kind for part in item.body} for item in again.body if isinstance(item, Actor)}
    assert "line" in said["rider"]
    assert "line" not in said["walker"], "it is in the points of its path"
    part = drive(expand_clip(again, child, source=clip_case.source.parent / "again.foresee"))
    for name in ("walker", "rider"):
        there = whole.states[frame : frame + part.frames, whole.index(name)][:, [X, Y]]
        here = part.states[: len(there), part.index(name)][:, [X, Y]]
        assert np.hypot(*(there - here).T).max() < 0.02, name


def test_braking_for_a_time_and_another_line_for_a_time(clip_case: TestCase, parent: Trace) -> None:
    """One run: a walker that hesitates, and a car that brakes harder than in comfort and then drifts."""
    child = drive(
        child_of(
            clip_case,
            "walker.brakes: 0.00 m/s^2 => 2.00 m/s^2 from 1.00 s for 1.50 s",
            "car.brakes: 0.00 m/s^2 => 6.50 m/s^2 from 0.50 s for 1.00 s",
            "car.line: 0.00 m => -0.80 m from 2.50 s for 1.50 s",
        )
    )
    walker, car = child.index("walker"), child.index("car")
    speed = child.states[:, :, SPEED]
    assert np.nanmax(apart(parent, child, "walker")[: round(1.0 / STEP_S) + 1]) < 1e-6
    assert speed[round(1.8 / STEP_S) : round(2.5 / STEP_S), walker].max() < 0.05
    assert speed[round(4.0 / STEP_S), walker] == pytest.approx(1.3, abs=0.05)
    assert speed[round(1.5 / STEP_S), car] == pytest.approx(3.5, abs=0.4), "6.5 m/s^2 from 10 m/s for a second"
    assert speed[round(3.0 / STEP_S), car] > 5
    y = child.states[:, car, Y]
    assert np.abs(y[: round(2.5 / STEP_S)] - 1.65).max() < 0.02
    # It drives west: its right is north.
    assert y[round(4.0 / STEP_S)] == pytest.approx(1.65 + 0.8, abs=0.05)
    assert y[-1] == pytest.approx(1.65, abs=0.05)
    same_but(parent, child, "walker", "car")


def test_a_clip_from_the_middle_of_it_goes_on(clip_case: TestCase) -> None:
    changes = (
        "walker.brakes: 0.00 m/s^2 => 1.00 m/s^2 from 1.00 s for 2.50 s",
        "car.line: 0.00 m => -0.80 m from 1.00 s for 3.00 s",
    )
    case = child_of(clip_case, *changes)
    trace = drive(case)
    point = RiskyPoint(1, 80, 4.0, "", "none", math.nan, math.nan, 1.0, "anything")
    made = clip(case, trace, point, before_s=2, after_s=4, name="c", parent="child.foresee")
    again = drive(expand_clip(made, case, source=case.source))
    for actor in ("walker", "car"):
        assert np.nanmax(apart(trace.part(40), again, actor)) < 0.05


def test_somebody_who_ignores_priority_drives_on(clip_case: TestCase) -> None:
    case = child_of(clip_case, "car.ignores: nothing => priority")
    car = next(item for item in case.scenario.body if isinstance(item, Actor) and item.name == "car")
    assert any(isinstance(item, IgnoresRule) and item.what == "priority" for item in car.body)
    assert "ignores" in {event.what for event in drive(case).events if event.actor == "car"}
