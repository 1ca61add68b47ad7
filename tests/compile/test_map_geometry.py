"""Lines of maps that no car can follow: found, smoothed, or closed with the place."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.foreign.geometry_faults import CheckedGeometry
from foresee_dsl.compile.foreign.geometry_repair import geometry_of, repair_geometry, rounded
from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.net_reader import read_net, read_network, topology_of
from foresee_dsl.compile.nets.safe_xml import parse_net
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.runner import run
from tests.support.foreign_maps import net

BROKEN = {
    "kink": net("100,0 103,0 103,3 106,0"),
    "gap": net("100,0 102,0", second="105,2 200,2"),
    "loop": net("100,0 104,0 104,2 102,3 101,1 103,-2 106,0"),
    "outside": net("100,0 110,1 118,6 122,6 130,1 140,0", second="140,0 200,0"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_what_is_wrong_with_a_connection_is_found_and_smoothed(kind: str) -> None:
    root = ElementTree.fromstring(BROKEN[kind])
    [fault] = CheckedGeometry.of(topology_of(root)).faults
    assert (fault.lane, fault.to) == ("in_0", "out_0")
    assert fault.kind == kind or {fault.kind, kind} <= {"kink", "loop"}
    done = repair_geometry(root)
    assert [fault.where] == list(done.repaired)
    assert done.broken == ()
    assert CheckedGeometry.of(topology_of(root)).faults == ()


def test_a_sound_net_stays_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "x.net.xml").write_text(net())
    assert foreign_net(tmp_path / "x.net.xml").read_text() == net()


def test_a_corner_in_a_lane_is_rounded_within_its_band() -> None:
    corner = ((0.0, 0.0), (50.0, 0.0), (50.0, 40.0))
    line = rounded(corner, 1.6)
    assert line is not None
    assert (line[0], line[-1]) == (corner[0], corner[-1])
    assert (50.0, 0.0) not in line
    assert rounded(((0.0, 0.0), (50.0, 0.0), (1.0, 1.0)), 1.6) is None  # back again: no car can


def test_lanes_give_way_to_a_connection_that_has_no_room(tmp_path: Path) -> None:
    """Round the corner of two streets netconvert 1.28 leaves 1.6 m."""
    file = tmp_path / "x.net.xml"
    file.write_text(net("100,0 101.1,0.5 101.6,1.6", second="101.6,1.6 101.6,95.6"))
    made = read_net(foreign_net(file))
    assert made.faults == ()
    assert made.lanes["in_0"].length_m == pytest.approx(100 - 0.75)
    assert made.lanes["out_0"].length_m == pytest.approx(94 - 0.75)
    assert made.lanes["in_0"].shape[-1] == made.lanes[":j_0_0"].shape[0] == (99.25, 0.0)


def test_a_route_over_a_broken_place_is_refused_with_the_place(tmp_path: Path) -> None:
    file = tmp_path / "x.net.xml"
    file.write_text(net(second="106,0 150,0 110,4"))
    made = foreign_net(file)
    [broken] = geometry_of(parse_net(made)).broken
    assert broken.startswith("lane out_0 turns by 174 degrees")
    assert broken.endswith("at (150.0 m, 0.0 m)")
    network = read_network(made)
    for find in (lambda: network.line(("in", "out")), lambda: network.shortest_route("in", "out")):
        with pytest.raises(RouteError, match=r"the map is broken on the way: lane out_0 turns by 174"):
            find()


class Rightwards:
    """Leaves the road to the right."""

    name, version = "rightwards", "1"

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Nothing to prepare."""

    def step(self, observation: Observation) -> Control:
        """Turn right."""
        del observation
        return Control(-0.4, 0.3, 0.0)


@pytest.mark.parametrize(("width", "verdict"), [("1.2", Verdict.INVALID), ("3.2", Verdict.F1)])
def test_who_leaves_the_road_where_the_map_is_broken_is_not_to_blame(
    tmp_path: Path, width: str, verdict: Verdict
) -> None:
    y = -1.6 - float(width) / 2
    alley = f"""<edge id="alley" from="a" to="b">
      <lane id="alley_0" index="0" speed="9" length="200" width="{width}" shape="0,{y} 200,{y}"/></edge>"""
    (tmp_path / "x.net.xml").write_text(net(more=alley))
    (tmp_path / "x.foresee").write_text(
        'foresee 1\n\nscenario a {\n  use network "x.net.xml"\n  ego: car.sedan {\n    route [in, out]\n'
        "    start at 20 m along in\n    start speed 5 m/s\n  }\n  expect never collision(ego)\n}\n"
    )
    result = run(compile_test_case(load_test_case(tmp_path / "x.foresee")), Rightwards(), seed=0)
    assert result.verdict is verdict
    assert ("where the map is broken: lane alley_0 is 1.20 m wide" in result.reason) == (verdict is Verdict.INVALID)
