"""The strip of a run as panels and as SVG."""

from __future__ import annotations

import math
import re
import unicodedata
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.kernels.boxes import box_distance
from foresee_dsl.language.document import TestCase
from foresee_dsl.report.drawing.ground import ground_of
from foresee_dsl.report.drawing.shapes import as_data, ground_shapes
from foresee_dsl.report.page.html import PAINTS as PAINTS_OF_PAGE
from foresee_dsl.report.page.playback import Marks, playback
from foresee_dsl.report.show.panels import Footprint, Role, Strip, panel_parts
from foresee_dsl.report.show.strip import make_strip, strip_svg, svg_of
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import Trace
from foresee_dsl.story import tell
from tests.support.hidden_walker import hidden_walker
from tests.support.scenes import LaneKeeper


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> TestCase:
    return hidden_walker(tmp_path_factory.mktemp("project"))


@pytest.fixture(scope="module")
def trace(case: TestCase) -> Trace:
    """A driver that sees nobody hits the walker."""
    result = run(compile_test_case(case), LaneKeeper(10.0))
    assert result.verdict == "F2"
    return result.trace


@pytest.fixture(scope="module")
def strip(trace: Trace, case: TestCase) -> Strip:
    return make_strip(trace, case, tell(trace, case))


def test_first_and_last_panel_are_start_and_contact(strip: Strip, trace: Trace) -> None:
    first, *_, last = strip.panels
    assert 4 <= len(strip.panels) <= 6
    assert (first.snapshot.time_s, first.snapshot.text) == (0.0, "start")
    assert (last.snapshot.time_s, last.snapshot.text) == (trace.duration_s, "contact")
    assert last.gap_m == 0.0
    assert strip.opponent == "walker"


def test_panels_show_footprints_where_they_were(strip: Strip, trace: Trace) -> None:
    for panel in strip.panels:
        by_role = {one.role: one for one in panel.footprints}
        ego, walker = by_role[Role.EGO], by_role[Role.OPPONENT]
        apart = float(np.hypot(*(ego.corners.mean(axis=0) - walker.corners.mean(axis=0))))
        there = trace.states[panel.snapshot.frame, [0, trace.index("walker")], :2]
        assert apart == pytest.approx(float(np.hypot(*(there[0] - there[1]))))
        assert np.abs(ego.corners).max() < panel.side_m / 2


def heading_rad(footprint: Footprint) -> float:
    front_left, rear_left, *_ = footprint.corners
    along = front_left - rear_left
    return math.atan2(along[1], along[0])


def test_the_ego_drives_upwards_or_north_is_up(strip: Strip, trace: Trace, case: TestCase) -> None:
    ego = next(one for one in strip.panels[-1].footprints if one.role is Role.EGO)
    assert np.sin(heading_rad(ego)) > 0.9
    north = make_strip(trace, case, up="north")
    assert all(panel.north_rad == pytest.approx(np.pi / 2) for panel in north.panels)


def test_at_the_contact_the_boxes_touch(strip: Strip) -> None:
    def box(role: Role) -> np.ndarray:
        one = next(f for f in strip.panels[-1].footprints if f.role is role)
        length, width = np.hypot(*(one.corners[0] - one.corners[1])), np.hypot(*(one.corners[0] - one.corners[3]))
        return np.array([*one.corners.mean(axis=0), heading_rad(one), length, width])

    assert box_distance(box(Role.EGO), box(Role.OPPONENT)) == 0.0


def test_svg_is_whole_xml_and_names_who_is_who(trace: Trace, case: TestCase) -> None:
    story = tell(trace, case)
    root = ElementTree.fromstring(strip_svg(trace, case, story))
    text = " ".join(root.itertext())
    assert story.sentence in text
    assert "walker (pedestrian)" in text
    classes = {node.get("class") for node in root.iter()}
    assert {"p-ego", "p-opponent", "p-road", "p-building"} <= classes


def test_a_ghost_is_drawn_where_the_parent_s_ego_was(trace: Trace, case: TestCase) -> None:
    ghosts = [
        f for panel in make_strip(trace, case, ghost=trace).panels for f in panel.footprints if f.role is Role.GHOST
    ]
    assert {ghost.actor for ghost in ghosts} == {"ego", "walker"}


def test_the_page_draws_the_same_shapes_with_the_same_paints(strip: Strip, trace: Trace, case: TestCase) -> None:
    bundle = compile_test_case(case)
    drawn = as_data(ground_shapes(ground_of(bundle.network, lambda _points, _wide_m: True)))
    on_strip = {shape.paint for panel in strip.panels for part in panel_parts(panel) for shape in part.shapes}
    bodies = {actor["paint"] for actor in playback(trace, bundle, Marks(opponent="walker"))["actors"]}
    assert on_strip - {"plate"} <= {shape["paint"] for shape in drawn} | bodies
    assert bodies == {"ego", "opponent", "parked"} and on_strip <= set(PAINTS_OF_PAGE)


def test_no_picture_has_colours_of_its_own(root: Path) -> None:
    files = [*(root / "templates" / "report").glob("*.js"), *(root / "foresee_dsl" / "report").rglob("*.py")]
    own = {file.name for file in files if re.search(r"#[0-9a-fA-F]{6}\b", file.read_text(encoding="utf-8"))}
    assert own == {"palette.py"}


@pytest.mark.parametrize("name", ["<script>alert(1)</script>", '"><b>', "\x1b[31mred", "\u202eturned", "w" * 10_000])
def test_hostile_names_are_text_in_the_svg(trace: Trace, case: TestCase, name: str) -> None:
    strip = make_strip(trace, case, tell(trace, case), title=name)
    panels = tuple(replace(p, footprints=tuple(replace(f, actor=name) for f in p.footprints)) for p in strip.panels)
    text = svg_of([replace(strip, opponent=name, panels=panels)], name)
    root = ElementTree.fromstring(text)
    drawn = {"svg", "title", "style", "rect", "text", "g", "path"}
    assert {node.tag.rpartition("}")[2] for node in root.iter()} <= drawn
    assert not [sign for sign in text if unicodedata.category(sign) in ("Cc", "Cf") and sign != "\n"]
    assert len(text) < 200_000
