"""Vehicles of OpenSCENARIO files without a controller: they keep to their lane and speed; parts that are elsewhere."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from foresee_exchange.openscenario.losses import SourceError
from foresee_exchange.openscenario.reading import importer
from foresee_exchange.openscenario.reading.roads import RoadPlace, Roads
from foresee_exchange.openscenario.reading.ways.held_up import lane_ahead

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.language import model as m
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.trace import SPEED, X, Y
from tests.support import openscenario_files as osc

_WIDTH = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
_LANES = f"""<lanes><laneSection s="0">
    <left><lane id="1" type="driving"><link><successor id="-1"/></link>{_WIDTH}</lane></left>
    <center><lane id="0" type="none"/></center>
    <right><lane id="-1" type="driving"><link><successor id="1"/></link>{_WIDTH}</lane></right>
  </laneSection></lanes>"""
BENT = f"""<OpenDRIVE><header revMajor="1" revMinor="4" name="bent" version="1"/>
<road name="straight" length="100" id="1" junction="-1">
  <link><successor elementType="road" elementId="2" contactPoint="end"/></link>
  <planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView>
  {_LANES}</road>
<road name="bend, drawn the other way" length="{50 * math.pi / 2}" id="2" junction="-1">
  <link><successor elementType="road" elementId="1" contactPoint="end"/></link>
  <planView><geometry s="0" x="150" y="50" hdg="{-math.pi / 2}" length="{50 * math.pi / 2}"><arc curvature="-0.02"/></geometry></planView>
  {_LANES}</road>
</OpenDRIVE>"""  # noqa: E501 - a map
AGAINST = '<LanePosition roadId="1" laneId="1" s="30"><Orientation type="relative" h="3.14159265"/></LanePosition>'


@pytest.fixture(scope="module")
def overtakes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A car in the lane of the other direction, which comes to a bend, and stands still from 4 s on."""
    folder = tmp_path_factory.mktemp("overtakes")
    text = osc.scenario(events=osc.group("Target-1", osc.event("stop", osc.speed_action("0"), osc.condition(_AT_4_S))))
    text = text.replace('laneId="-2" s="50"', 'laneId="-1" s="5"').replace('x="300" y="-8.5"', 'x="60" y="-4"')
    text = text.replace('<RelativeLanePosition entityRef="Ego" dLane="1" ds="${$gap * 2 - 5}" offset="0"/>', AGAINST)
    importer.run(osc.write(folder / "in", text, road=BENT), out=folder / "out")
    return folder / "out" / "cut_in.foresee"


_AT_4_S = '<ByValueCondition><SimulationTimeCondition value="4" rule="greaterThan"/></ByValueCondition>'


def test_who_drives_in_the_lane_of_the_other_direction_follows_it_over_roads(overtakes: Path) -> None:
    target = next(actor for actor in load_test_case(overtakes).scenario.actors if actor.name == "target_1")
    (path,) = [item for item in target.body if isinstance(item, m.Path)]
    places = [(p.x.si, p.y.si) for p in path.points if isinstance(p, m.Point) and isinstance(p.x, m.Quantity)]
    assert places[0] == pytest.approx((31.4, 1.75), abs=0.01) and places[-1][1] > 45
    for x, y in places:
        off = y - 1.75 if x < 100 else math.hypot(x - 100, y - 50) - 48.25
        assert abs(off) < 0.06, "along the middle of the lane, a rear axle's distance before it"


def test_a_step_of_the_speed_is_one(overtakes: Path) -> None:
    result = run_test_case(load_test_case(overtakes), "idm", 0)
    target = next(k for k, info in enumerate(result.trace.actors) if info.id == "target_1")
    states = result.trace.states[:, target]
    before, after = result.trace.frame_at(3.9), result.trace.frame_at(4.2)
    assert states[before, SPEED] == pytest.approx(14, abs=0.1) and states[after, SPEED] == 0
    assert math.dist(states[0, [X, Y]], states[before, [X, Y]]) == pytest.approx(14 * 3.9, abs=0.5)


def test_who_begins_on_top_of_another_is_lost_and_said(tmp_path: Path) -> None:
    text = osc.scenario().replace('dLane="1" ds="${$gap * 2 - 5}"', 'dLane="0" ds="1"')
    file = osc.write(tmp_path / "in", text)
    with pytest.raises(SourceError, match="target_1 starts on top of ego"):
        importer.run(file, out=tmp_path / "out")
    done = importer.run(file, out=tmp_path / "out", partial=True)
    assert done.lost == {"entities that begin on top of others": 1}
    scenario = load_test_case(tmp_path / "out" / "cut_in.foresee").scenario
    assert [actor.name for actor in scenario.actors] == ["ego", "walker"]


def test_of_many_on_top_of_each_other_all_are_left_out(tmp_path: Path) -> None:
    """24 cars on the ego's place have 300 overlaps, more than there are messages."""
    names = [f"car{k}" for k in range(24)]
    at = osc.teleport('<RelativeLanePosition entityRef="Ego" dLane="0" ds="1" offset="0"/>')
    text = osc.scenario(
        entities="".join(osc.car(name) for name in names),
        init="".join(f'<Private entityRef="{name}">{at}{osc.speed("10")}</Private>' for name in names),
    )
    done = importer.run(osc.write(tmp_path / "in", text), out=tmp_path / "out", partial=True)
    assert done.lost == {"entities that begin on top of others": 24}
    scenario = load_test_case(tmp_path / "out" / "cut_in.foresee").scenario
    assert [actor.name for actor in scenario.actors] == ["ego", "target_1", "walker"]


def test_maps_and_catalogues_that_are_elsewhere_are_found(tmp_path: Path) -> None:
    text = osc.scenario().replace('filepath="straight.xodr"', 'filepath="../gone/straight.xodr"')
    file = osc.write(tmp_path / "in", text.replace('path="catalogues"', 'path="../gone/catalogues"'))
    (tmp_path / "in" / "catalogues" / "cars.xosc").rename(tmp_path / "in" / "catalogues" / "Cars.xosc")
    (tmp_path / "in" / "catalogues").rename(tmp_path / "kept")
    (tmp_path / "in" / "straight.xodr").rename(tmp_path / "kept" / "straight.xodr")
    with pytest.raises(SourceError, match=r"gone/straight\.xodr', which does not exist"):
        importer.run(file, out=tmp_path / "out", allow_outside=True)
    assert not importer.run(file, out=tmp_path / "out", allow_outside=True, road=tmp_path / "kept").lost


_AHEAD = """<OpenDRIVE><header revMajor="1" revMinor="7" name="ahead" version="1"/>
{roads}
<junction id="9" name="direct" type="direct">
  <connection id="0" incomingRoad="1" linkedRoad="2" contactPoint="{contact}">
    <laneLink from="-1" to="{lane}"/>
  </connection>
</junction></OpenDRIVE>"""
_ROAD = """<road name="r{id}" length="{length}" id="{id}" junction="-1"><link>{link}</link>
  <planView><geometry s="0" x="{x}" y="0" hdg="{heading}" length="{length}"><line/></geometry></planView>
  <lanes><laneSection s="0">
    <left><lane id="1" type="driving"/></left><center><lane id="0" type="none"/></center>
    <right><lane id="-1" type="driving"/></right>
  </laneSection></lanes></road>""".replace('type="driving"/>', f'type="driving">{_WIDTH}</lane>')


def _joined(contact: str) -> str:
    """Two roads of 100 and 300 m in line, joined by a direct junction at the second one's start or end."""
    to, lane, x, heading = ("predecessor", -1, 100, 0.0) if contact == "start" else ("successor", 1, 400, math.pi)
    first = _ROAD.format(id=1, length=100, x=0, heading=0.0, link='<successor elementType="junction" elementId="9"/>')
    link = f'<{to} elementType="junction" elementId="9"/>'
    second = _ROAD.format(id=2, length=300, x=x, heading=heading, link=link)
    return _AHEAD.format(roads=first + second, contact=contact, lane=lane)


@pytest.mark.parametrize("contact", ["start", "end"])
def test_a_lane_goes_on_over_a_direct_junction_both_ways(tmp_path: Path, contact: str) -> None:
    (tmp_path / "ahead.xodr").write_text(_joined(contact))
    roads = Roads(tmp_path / "ahead.xodr")
    there = lane_ahead(roads, RoadPlace("1", 10.0, -1), 600.0, onward=True)
    assert (there[-1].x, there[-1].y) == pytest.approx((400.0, -1.75), abs=0.01)
    back = lane_ahead(roads, RoadPlace("2", 150.0, -1 if contact == "start" else 1), 600.0, onward=contact == "end")
    assert (back[-1].x, back[-1].y) == pytest.approx((0.0, -1.75), abs=0.01)


_STRAIGHT_300 = osc.XODR.replace('length="600"', 'length="300"')


def test_an_actor_that_brakes_at_the_end_of_its_lane_is_named(tmp_path: Path) -> None:
    """225 m of road lie ahead of a target with 14 m/s; nothing is said where the road is long enough."""
    short = importer.run(osc.write(tmp_path / "short", osc.scenario(), road=_STRAIGHT_300), out=tmp_path / "a")
    assert [n for n in short.notes if "brakes at the end" in n] == [
        "target_1 brakes at the end of its lane, 225 m ahead: the map has no lane from there"
    ]
    long = importer.run(osc.write(tmp_path / "long", osc.scenario()), out=tmp_path / "b")
    assert not any("brakes at the end" in note for note in long.notes)
