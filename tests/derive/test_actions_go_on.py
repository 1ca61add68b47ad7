"""Clips cut in the middle of actions: stops with a dwell, limits, signals that were turned, and the like."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.steps.clip import measure_clip
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Clip
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.trace import Trace

FOLDER = Path(__file__).parent / "following"


@lru_cache
def parent_of(name: str) -> tuple[TestCase, Trace]:
    case = load_test_case(str(FOLDER / f"{name}.foresee"))
    return case, run_test_case(case, "idm", 0).trace


def cut(name: str, at_s: float, after_s: float = 6.0) -> Clip:
    case, trace = parent_of(name)
    point = RiskyPoint(1, trace.frame_at(at_s), at_s, "", "none", float("nan"), float("nan"), 0.0, "a test")
    made = clip_around(case, trace, point, FOLDER / "clip.foresee", before_s=0.0, after_s=after_s)
    clip = parse(print_model(made), str(FOLDER / "clip.foresee")).model
    assert clip == made
    return made


@pytest.mark.parametrize(
    ("name", "at_s"),
    [
        ("road", 0.75),  # a lane half changed towards a stop; limits not changed yet
        ("road", 2.0),  # they are; who drove faster brakes
        ("road", 6.5),  # braking for the stop; the signal shows what it was turned to
        ("road", 10.0),  # standing at the stop; another one on the way to a place; amber
        ("pairs", 2.0),  # half-way to another line; an open door; a gap and a place for two
        ("pairs", 5.0),  # beside another; the door is shut again
        ("pairs", 8.5),  # another gap, for a time; the door is open again
        ("joining", 4.5),  # on paths, from the beginning and by a trigger
        ("joining", 7.15),  # one has just joined the traffic
        ("joining", 12.5),  # the other has, too; one brakes to reverse
        ("joining", 15.5),  # and goes backwards
        ("ring", 2.5),  # one brakes for a time; a cyclist on a line beside a route, in a roundabout
        ("ring", 3.75),  # two brake; one stands for the rest of its time
        ("ring", 5.0),  # one stands for good, as far as it was told
        ("bay", 2.8),  # a bus on the way to its bay, one in another
        ("bay", 4.5),  # half-way into it
        ("bay", 9.5),  # standing there
        ("bay", 13.0),  # pulling out
        ("bay", 15.5),  # the other one, too
    ],
)
def test_a_clip_goes_on_as_its_parent_did(name: str, at_s: float) -> None:
    case, trace = parent_of(name)
    found = measure_clip(cut(name, at_s), case, trace, FOLDER / "clip.foresee", DriverSetup("idm"))[3]
    assert {actor: far for actor, far in found.actors.items() if far > 0.01 and actor != "ego"} == {}
    assert found.frames > 60


def test_a_stop_goes_on_with_what_is_left_of_it() -> None:
    text = " ".join(print_model(cut("road", 10.0)).split())
    assert "liner stops at market for 2.00 s" in text
    assert "limit on east is 30 km/h limit on east_back lane 1 is 20 km/h" in text
    assert "signal middle stage main_go elapsed 22.50 s" in text


def test_orders_go_on_with_what_is_left_of_them() -> None:
    text = " ".join(print_model(cut("pairs", 2.0)).split())
    assert "beside changes line to 0.6 m over 1.00 s" in text
    assert "door of parked opens" in text
    assert "obstacle.door" not in text
    text = " ".join(print_model(cut("pairs", 5.0)).split())
    assert "beside keeps 1.1 m left of lead for 2.00 s" in text
    assert "oncoming synchronises at (-28.3000 m, 4.9500 m) with lead at 20 m along east_back speed 9 m/s" in text
    assert "tail follows lead gap 25 m for 2.50 s" in " ".join(print_model(cut("pairs", 8.5)).split())


def test_a_path_and_the_way_from_its_end_on_are_restated() -> None:
    text = " ".join(print_model(cut("joining", 4.5)).split())
    assert "then joins [west, east_back] moving " in text
    assert "then joins [east, west_back] moving " in text
    text = " ".join(print_model(cut("joining", 12.5)).split())
    assert "joins" not in text
    assert "{ route [east, west_back] speed 8 m/s }" in text


def test_who_leaves_a_lane_where_nobody_was_on_a_path_is_recorded_step_by_step(tmp_path: Path) -> None:
    text = (FOLDER / "joining.foresee").read_text()
    for name in ("vehicle yard", "pedestrian walker", "when time >= 4 s", "when time >= 10 s"):
        text = re.sub(rf"(?ms)^  {name}.*?^  \}}\n", "", text)
    (file := tmp_path / "joining.foresee").write_text(text)
    trace = run_test_case(load_test_case(str(file)), "idm", 0).trace
    along = trace.along[:, trace.index("rounds")]
    on_path = along[~np.isnan(along)]
    assert np.isnan(along[0]) and np.isnan(along[-1])
    assert (np.diff(on_path) > 0).all() and on_path[-1] > 30


def test_braking_goes_on_with_what_is_left_of_its_time() -> None:
    text = " ".join(print_model(cut("ring", 2.5)).split())
    assert "first brakes 6 m/s^2 for 1.50 s then { first changes speed to 20 km/h }" in text
    text = " ".join(print_model(cut("ring", 3.75)).split())
    assert "cyclist brakes 5 m/s^2 for 0.75 s" in text
    assert "second brakes 4 m/s^2 }" in text
    assert "second brakes 4 m/s^2 }" in " ".join(print_model(cut("ring", 5.0)).split())
