"""Signal programs for nets that have none of their own."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from foresee_dsl.compile.foreign.networks import close_parking, write_net
from foresee_dsl.compile.foreign.signal_programs import give_programs, stages_of
from foresee_dsl.compile.nets.net_reader import read_net, topology_of
from foresee_dsl.compile.nets.safe_xml import parse_net
from foresee_dsl.compile.nets.signals import links_of
from foresee_dsl.language.model import Network
from tests.support.worlds import four_arms, net_of, read_signals, t_junction

EAST, NORTH, WEST, SOUTH = 0.0, math.pi / 2, math.pi, -math.pi / 2


def test_opposite_approaches_share_a_stage() -> None:
    assert stages_of({"a": EAST, "b": NORTH, "c": WEST, "d": SOUTH}) == [("ew_go", ("a", "c")), ("ns_go", ("b", "d"))]
    assert stages_of({"a": EAST + 0.4, "c": WEST, "stem": NORTH}) == [("ew_go", ("a", "c")), ("s_go", ("stem",))]


def test_an_approach_without_an_opposite_has_a_stage_of_its_own() -> None:
    assert stages_of({"a": EAST, "b": NORTH}) == [("s_go", ("b",)), ("w_go", ("a",))]
    slanting = stages_of({"a": math.radians(45), "b": math.radians(225)})
    assert slanting == [("ne_sw_go", ("a", "b"))]


def test_two_stages_of_one_name_are_told_apart() -> None:
    names = [name for name, _ in stages_of({"a": EAST, "b": EAST + 0.1, "c": NORTH})]
    assert names == ["s_go", "w_go", "w_2_go"]


@pytest.mark.parametrize("network", [four_arms(), t_junction("signals")], ids=["crossroads", "t"])
def test_no_two_greens_meet_unless_one_yields(network: Network, tmp_path: Path) -> None:
    file = tmp_path / "nameless.net.xml"
    # as netconvert would leave it: nameless phases that mean nothing
    file.write_text(re.sub(r' name="\w+_go"', "", net_of(network).read_text()))
    root = parse_net(file)
    assert give_programs(root) == 1
    write_net(root, tmp_path / "new.net.xml")
    ((junction, signal),) = read_signals(tmp_path / "new.net.xml", None).items()
    assert len(signal.stages) == 2
    assert all(stage.endswith("_go") for stage in signal.stages)
    links = links_of(topology_of(root), junction)
    for phase in signal.phases:
        free = {link.index for link in links if phase.state[link.index] == "G"}
        for link in links:
            assert not link.foes & free if link.index in free and not link.is_crossing else True
    assert all(any(phase.state[link.index] in "Gg" for phase in signal.phases) for link in links)


def test_a_net_with_programs_of_its_own_has_a_stage_for_each_phase() -> None:
    assert next(iter(read_signals(net_of(four_arms()), None).values())).stages[:2] == ("phase_0", "phase_1")


def test_parking_lanes_of_a_map_are_closed(tmp_path: Path) -> None:
    root = parse_net(net_of(four_arms()))
    west = next(edge for edge in root.iterfind("edge") if edge.get("id") == "west")
    west.set("type", "parking|driving")  # behind the sidewalk, which was added later
    assert close_parking(root) == 1
    write_net(root, tmp_path / "new.net.xml")
    lanes = read_net(tmp_path / "new.net.xml").edges["west"].lanes
    assert [lane.parking for lane in lanes] == [False, True, False]
    assert ["car" in lane.kinds for lane in lanes] == [False, False, True]
