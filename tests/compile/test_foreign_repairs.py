"""Nets of others: signals that react to traffic, lanes that overlap, crosswalks of the map."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from foresee_dsl.compile.foreign.geometry_repair import repair_overlaps
from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.foreign.opendrive_reading import crosswalks_of
from foresee_dsl.compile.foreign.signal_programs import fix_times
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.nets.netconvert import run_netconvert
from foresee_dsl.errors import CompileError
from tests.support.worlds import four_arms, net_of, read_signals

LANES = """<net>
  <edge id=":j_0" function="internal">
    <lane id=":j_0_0" index="0" speed="9" length="7.00" shape="50.00,0.00 43.00,0.00"/>
  </edge>
  <edge id=":k_0" function="internal"><lane id=":k_0_0" index="0" speed="9" length="2.00" shape="{turn}"/></edge>
  <edge id="a" from="i" to="j"><lane id="a_0" index="0" speed="9" length="50.00" shape="0.00,0.00 50.00,0.00"/></edge>
  <edge id="b" from="j" to="k"><lane id="b_0" index="0" speed="9" length="{length}" shape="{b}"/></edge>
  <edge id="c" from="k" to="l"><lane id="c_0" index="0" speed="9" length="38.00" shape="62.00,0.00 100.00,0.00"/></edge>
  <connection from="a" to="b" fromLane="0" toLane="0" via=":j_0_0" dir="s" state="M"/>
  <connection from="b" to="c" fromLane="0" toLane="0" via=":k_0_0" dir="s" state="M"/>
</net>"""


def shapes(text: str) -> dict[str, tuple[str, str]]:
    root = ElementTree.fromstring(text)
    assert repair_overlaps(root) == 1
    assert repair_overlaps(root) == 0  # nothing is left to repair
    return {lane.get("id", ""): (lane.get("shape", ""), lane.get("length", "")) for lane in root.iter("lane")}


def test_a_lane_that_begins_before_the_last_one_ends_is_cut() -> None:
    found = shapes(LANES.format(b="43.00,0.00 60.00,0.00", length="17.00", turn="60.00,0.00 62.00,0.00"))
    assert found["a_0"] == ("0.00,0.00 50.00,0.00", "50.00")
    assert found[":j_0_0"] == ("50.00,0.00 50.20,0.00", "0.20")
    assert found["b_0"] == ("50.20,0.00 60.00,0.00", "9.80")
    assert found[":k_0_0"] == ("60.00,0.00 62.00,0.00", "2.00")


def test_a_stub_within_the_overlap_moves_on_and_the_junctions_lane_behind_it_gives_way() -> None:
    found = shapes(LANES.format(b="43.00,0.00 43.30,0.00", length="0.30", turn="43.30,0.00 62.00,0.00"))
    assert found["b_0"] == ("50.20,0.00 50.40,0.00", "0.20")
    assert found[":k_0_0"] == ("50.40,0.00 62.00,0.00", "11.60")
    assert found["c_0"] == ("62.00,0.00 100.00,0.00", "38.00")


def test_lanes_that_follow_each_other_stay() -> None:
    root = ElementTree.fromstring(LANES.format(b="43.00,0.00 60.00,0.00", length="17.00", turn="60.00,0.00 62.00,0.00"))
    joint = root.find("edge/lane")
    assert joint is not None
    joint.set("shape", "43.00,5.00 43.00,0.00")  # comes from the side
    assert repair_overlaps(root) == 0


@pytest.fixture(scope="module")
def built() -> Path:
    return net_of(four_arms())


@pytest.mark.parametrize("kind", ["actuated", "delay_based", "NEMA"])
def test_signals_that_react_to_traffic_get_fixed_times(built: Path, tmp_path: Path, kind: str) -> None:
    text = built.read_text().replace('type="static"', f'type="{kind}"')
    assert kind in text
    text = text.replace("<phase ", '<phase minDur="5" maxDur="50" ')
    (tmp_path / "x.net.xml").write_text(text)
    net = foreign_net(tmp_path / "x.net.xml")
    assert kind not in net.read_text()
    assert "minDur" not in net.read_text()
    plain = foreign_net(built)
    assert read_signals(net, None) == read_signals(plain, None)  # the same stages
    assert plain.read_text().count("<tlLogic") == 1


@pytest.mark.parametrize(
    ("was", "now", "words"),
    [
        ('fromLane="0"', 'fromLane="9"', "not a sound SUMO network: there is no '"),
        ('speed="', 'speed="x', "not a sound SUMO network: could not convert"),
        ('length="', 'length="nan" was="', "has no usable shape, length, speed or width"),
        ('width="', 'width="-', "of lane .* is negative"),
        ('_0" index="0"', '_0" index="7"', "are not numbered from 0 on"),
        ('request index="0"', 'request index="1"', "two requests of a junction have the same index"),
    ],
)
def test_damaged_nets_are_refused_in_words(built: Path, tmp_path: Path, was: str, now: str, words: str) -> None:
    text = built.read_text()
    assert was in text
    (tmp_path / "x.net.xml").write_text(text.replace(was, now))
    with pytest.raises(CompileError, match=words):
        foreign_net(tmp_path / "x.net.xml")


def test_a_file_that_is_cut_off_is_said_to_be(built: Path, tmp_path: Path) -> None:
    text = built.read_text()
    (tmp_path / "x.net.xml").write_text(text[: len(text) // 2].rpartition("\n")[0])
    with pytest.raises(CompileError, match=r"it is cut off at line \d+"):
        foreign_net(tmp_path / "x.net.xml")


def test_of_several_programs_the_last_stays_as_in_sumo(built: Path) -> None:
    root = ElementTree.parse(built).getroot()
    logic = root.find("tlLogic")
    assert logic is not None
    night = ElementTree.fromstring(ElementTree.tostring(logic))
    night.set("programID", "night")
    root.append(night)
    changed = fix_times(root)
    assert (changed.reacting, changed.others) == (0, 1)
    assert [one.get("programID") for one in root.iterfind("tlLogic")] == ["night"]
    assert not fix_times(root)


def test_crossings_lie_where_the_map_has_its_crosswalks(built: Path, tmp_path: Path) -> None:
    """A map with one crosswalk at one arm of its junction: that is the only crossing there."""
    run_netconvert(["-s", str(built), "--opendrive-output", "map.xodr"], tmp_path)
    root = ElementTree.parse(tmp_path / "map.xodr").getroot()
    for road in root.iterfind("road"):
        for objects in road.findall("objects"):
            road.remove(objects)  # netconvert's own crosswalks
    ElementTree.ElementTree(root).write(tmp_path / "map.xodr")
    guessed = read_network(foreign_net(tmp_path / "map.xodr"))
    (junction,) = {crossing.junction for crossing in guessed.crossings.values()}
    assert len(guessed.crossings) > 2

    road = next(r for r in root.iterfind("road") if r.find("link/successor[@elementType='junction']") is not None)
    length = float(road.get("length", ""))
    objects = ElementTree.SubElement(road, "objects")
    at = {"id": "1", "type": "crosswalk", "s": f"{length - 4:.3f}", "t": "0", "hdg": "1.5708"}
    crosswalk = ElementTree.SubElement(objects, "object", at)
    outline = ElementTree.SubElement(crosswalk, "outline")
    for u, v in ((-8, -1.5), (8, -1.5), (8, 1.5), (-8, 1.5)):
        ElementTree.SubElement(outline, "cornerLocal", {"u": str(u), "v": str(v), "z": "0"})
    ElementTree.ElementTree(root).write(tmp_path / "marked.xodr")

    (found,) = crosswalks_of(root)
    assert (found.length_m, found.width_m) == (16, 3)
    network = read_network(foreign_net(tmp_path / "marked.xodr"))
    (crossing,) = network.crossings.values()
    assert crossing.junction == junction
    assert crossing.lane.width_m == pytest.approx(3.0)
    line = crossing.lane.line
    assert abs(line.project(found.pose.x, found.pose.y)[1]) < 0.05
    nearest = min(abs(one.lane.line.project(found.pose.x, found.pose.y)[1]) for one in guessed.crossings.values())
    assert nearest > 1.0  # netconvert's guess was elsewhere
