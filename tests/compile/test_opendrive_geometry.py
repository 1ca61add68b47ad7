"""Places on OpenDRIVE roads: every kind of reference line, lanes of both sides, widths that change."""

from __future__ import annotations

import math
from xml.etree.ElementTree import fromstring

import pytest

from foresee_dsl.compile.foreign.opendrive_geometry import OpenDriveRoads
from foresee_dsl.errors import CompileError


def road(shape: str, *, length: float = 100, heading: float = 0, lanes: str = "") -> OpenDriveRoads:
    """Return a map of one road with one piece."""
    return OpenDriveRoads(
        fromstring(f"""<OpenDRIVE><road id="7" length="{length}">
          <planView><geometry s="0" x="10" y="20" hdg="{heading}" length="{length}">{shape}</geometry></planView>
          <lanes><laneOffset s="0" a="0.5" b="0" c="0" d="0"/>{lanes}</lanes></road></OpenDRIVE>""")
    )


def test_an_arc_is_a_circle() -> None:
    pose = road('<arc curvature="0.02"/>').at("7", 50 * math.pi / 2, 0)
    assert (pose.x, pose.y, pose.heading_rad) == pytest.approx((60, 70, math.pi / 2))


def test_a_spiral_without_change_is_an_arc_and_a_growing_one_turns_by_half() -> None:
    arc, spiral = road('<arc curvature="0.02"/>'), road('<spiral curvStart="0.02" curvEnd="0.02"/>')
    for s in (0.0, 13.7, 100.0):
        a, b = arc.at("7", s, 2), spiral.at("7", s, 2)
        assert (a.x, a.y, a.heading_rad) == pytest.approx((b.x, b.y, b.heading_rad), abs=1e-7)
    end = road('<spiral curvStart="0" curvEnd="0.02"/>').at("7", 100, 0)
    assert end.heading_rad == pytest.approx(1.0)
    # Fresnel's series, x = L (1 - phi^2/10 + phi^4/216 - ...), with phi the angle turned
    assert end.x - 10 == pytest.approx(100 * (1 - 1 / 10 + 1 / 216 - 1 / 9360 + 1 / 685440), abs=1e-4)


def test_cubics_by_length_and_by_parameter() -> None:
    plain = road('<poly3 a="0" b="0" c="0.002" d="0"/>', length=50).at("7", 50, 0)
    u = plain.x - 10
    assert plain.y - 20 == pytest.approx(0.002 * u * u)
    slope = 0.004 * u
    length = (slope * math.hypot(1, slope) + math.asinh(slope)) / 2 / 0.004  # of a parabola
    assert length == pytest.approx(50, abs=1e-6)
    ends = '<paramPoly3 pRange="{}" aU="0" bU="{}" cU="0" dU="0" aV="0" bV="0" cV="{}" dV="0"/>'
    one = road(ends.format("normalized", 100, 10), heading=math.pi / 2).at("7", 50, 0)
    other = road(ends.format("arcLength", 1, 0.001), heading=math.pi / 2).at("7", 50, 0)
    assert (one.x, one.y) == pytest.approx((10 - 2.5, 70))
    assert (other.x, other.y, other.heading_rad) == pytest.approx((one.x, one.y, one.heading_rad))


def test_lanes_count_from_the_middle_to_either_side() -> None:
    lanes = """<laneSection s="0">
      <left><lane id="1"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane></left>
      <right>
        <lane id="-1"><width sOffset="0" a="3" b="0.02" c="0" d="0"/></lane>
        <lane id="-2"><width sOffset="0" a="4" b="0" c="0" d="0"/><width sOffset="60" a="2" b="0" c="0" d="0"/></lane>
      </right></laneSection>"""
    found = road("<line/>", lanes=lanes)
    assert found.lane("7", 1, 50).y == pytest.approx(20 + 0.5 + 1.5)
    assert found.lane("7", -1, 50).y == pytest.approx(20 + 0.5 - 2)  # 3 m + 0.02 * 50 m wide there
    assert found.lane("7", -2, 50, offset=1).y == pytest.approx(20 + 0.5 - 4 - 2 + 1)
    assert found.lane("7", -2, 80).y == pytest.approx(20 + 0.5 - 4.6 - 1)


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda m: m.at("8", 1, 0), "no road 8"),
        (lambda m: m.at("7", 101, 0), "100.0 m long"),
        (lambda m: m.lane("7", -1, 1), "no lanes"),
    ],
)
def test_what_is_not_there(ask: object, said: str) -> None:
    with pytest.raises(CompileError, match=said):
        ask(road("<line/>"))  # type: ignore[operator]  # a function of the table
