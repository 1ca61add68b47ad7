"""Clips cut while triggers are half-way: a `for` that has begun, steps that wait, an `every` that has fired."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import pytest

from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.steps.clip import measure_clip
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Clip, Point, Starts, Wait, When, Within
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.language.traversal import parts
from foresee_dsl.simulate.trace import Trace

FOLDER = Path(__file__).parent / "following"


@lru_cache
def parent_of(name: str) -> tuple[TestCase, Trace]:
    case = load_test_case(str(FOLDER / f"{name}.foresee"))
    return case, run_test_case(case, "pdm", 0).trace


def cut(name: str, at_s: float) -> Clip:
    case, trace = parent_of(name)
    frame = trace.frame_at(at_s)
    point = RiskyPoint(1, frame, at_s, "", "none", float("nan"), float("nan"), 0.0, "a test")
    file = FOLDER / "clip.foresee"
    made = clip_around(case, trace, point, file, before_s=0.0, after_s=5.0)
    clip = parse(print_model(made), str(file)).model
    assert isinstance(clip, Clip)
    assert clip == made
    return clip


def whens(clip: Clip) -> list[When]:
    return [item for item in clip.body if isinstance(item, When)]


@pytest.mark.parametrize(
    ("name", "at_s"),
    [
        # before anything; a `for` half-way; a lane half changed; `wait` and a change of speed half-way; a stop half-way
        ("sequences", 0.0),
        ("sequences", 0.7),
        ("sequences", 3.0),
        ("sequences", 4.9),
        ("sequences", 8.1),
        # a meeting near the junction; a `then when` whose `for` is half-way
        ("sequences", 13.9),
        # an `every` that has fired; a sequence that will start anew; somebody has left
        ("conditions", 0.4),
        ("conditions", 1.2),
        ("conditions", 2.25),
        ("conditions", 2.6),
        ("conditions", 4.5),
        ("conditions", 8.75),
    ],
)
def test_a_clip_goes_on_as_its_parent_did(name: str, at_s: float) -> None:
    case, trace = parent_of(name)
    found = measure_clip(cut(name, at_s), case, trace, FOLDER / "clip.foresee", DriverSetup("pdm"))[3]
    ego = found.actors["ego"]  # its driver begins without what it had seen before
    assert {actor: far for actor, far in found.actors.items() if far > 0.01} in ({}, {"ego": ego})
    assert ego < 0.15
    assert found.frames > 40


def test_a_for_goes_on_with_what_is_left_of_it() -> None:
    text = print_model(cut("sequences", 0.7))
    assert "when lead.speed > 5 m/s for 1.2 s since -0.70 s {" in text


def test_a_for_beside_something_else_needs_no_more_words() -> None:
    text = print_model(cut("conditions", 3.5))
    assert "when next late: c1.speed > 3 m/s for 2 s since -3.50 s and c1.speed < 6 m/s {" in text
    assert "when (c3.speed < 5 m/s for 1 s since -1.60 s) for 1.5 s since -0.60 s {" in text
    assert "when every c2 within 25 m of (-1.9000 m, 157.3500 m) for 0.6 s {" in text  # not begun


def test_a_running_sequence_is_taken_up_where_it_is() -> None:
    text = " ".join(print_model(cut("sequences", 8.1)).split())
    assert (
        "when time >= 0.00 s { cutter stops for 0.70 s then when time < 4.60 s { cutter changes speed to 9 m/s "
        "then when time < 4.60 s { cutter changes lane right } } }"
    ) in text  # at 12.70 s the sequence starts anew
    lane = whens(cut("sequences", 3.0))
    assert any(isinstance(w.actions[0], Wait) for w in lane)  # it changes lane by itself now


def test_an_every_that_has_fired_is_a_next() -> None:
    assert [w.repeat for w in whens(cut("conditions", 2.6)) if w.name == "late"] == ["next"]
    assert [w.repeat for w in whens(cut("conditions", 0.0)) if w.name == "late"] == ["every"]


def test_places_on_routes_become_points() -> None:
    (within,) = [p for w in whens(cut("conditions", 2.6)) for p in parts(w.condition) if isinstance(p, Within)]
    assert isinstance(within.of, Point)


def test_who_nobody_will_start_any_more_still_waits() -> None:
    """The trigger that would start the walker asks about an actor that is gone."""
    (never,) = [w for w in whens(cut("conditions", 4.5)) if any(isinstance(a, Starts) for a in w.actions)]
    assert never.actions == (Starts(actor="walker"),)
    assert "when time < 0.00 s { walker starts }" in " ".join(print_model(cut("conditions", 4.5)).split())
