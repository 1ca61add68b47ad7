"""What CARLA's other towns hold: roads over roads, motorways, no sidewalks, other formats of routes and triggers."""

from __future__ import annotations

import dataclasses
import json
import math
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import pytest
from foresee_exchange.carla import importer as carla_import
from foresee_exchange.carla.files import CarlaRoute, family_of, pose_of, read_routes, read_triggers, town_in
from foresee_exchange.carla.placed_route import place_route, strays
from foresee_exchange.carla.ways import lanes_at, way_between
from foresee_exchange.maps import opendrive

from foresee_dsl.compile import compile_test_case, placement_mistakes
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.exchange.bridges import Heights, bridge_notes, bridges
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.language.project.loading import bundled_models, load_test_cases
from tests.support.carla_files import write_routes, write_triggers
from tests.support.foreign_maps import Road, write_map

LOW = Road("7", -150, 0, 0, 300)
OVER = ((0, 0, 0), (50, 0, 0.08), (125, 6, 0), (175, 6, -0.08), (250, 0, 0))
HIGH = Road("3", -150 * math.cos(math.radians(30)), -75, 30, 300, heights=OVER)
"""It goes over the other one at 30 degrees, so that its direction does not tell them apart."""
LANES = {"right": ("driving", "driving", "entry", "shoulder"), "left": ("bidirectional", "driving", "parking")}
FIRST = Road("12", 0, 0, 10, 300, behind=("road", "2", "start"), speed=70, **LANES)
SECOND = dataclasses.replace(
    FIRST, id="2", x=FIRST.at(300)["x"], y=-FIRST.at(300)["y"], before=("road", "12", "end"), behind=None
)


@pytest.fixture(scope="module")
def overpass(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_map(tmp_path_factory.mktemp("map") / "Town04.xodr", LOW, HIGH)


@pytest.fixture(scope="module")
def motorway(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_map(tmp_path_factory.mktemp("map") / "Town06.xodr", FIRST, SECOND)


def test_the_road_of_the_right_height_is_meant(overpass: Path) -> None:
    net = foreign_net(overpass)
    network, heights = read_network(net), Heights.of(net)
    spots = bridges(network, heights)
    assert len(spots) == 4  # two lanes over two
    assert all(math.hypot(one.x, one.y) < 15 for one in spots)
    assert "(4 pairs of edges)" in bridge_notes(spots)[0]
    assert bridge_notes(()) == ()
    place = HIGH.at(150)
    for z, road in ((6.3, "-3"), (0.4, "-7"), (-0.2, "-7")):
        found = lanes_at(network, pose_of(place["x"], place["y"], -15.0, z), heights=heights)
        assert {one.lane.edge for one in found} == {road}
    both = lanes_at(network, pose_of(place["x"], place["y"], -15.0), heights=heights)
    assert {one.lane.edge for one in both} == {"-3", "-7"}  # the way to the end decides
    end = HIGH.at(260, -1.75)
    way = way_between(network, pose_of(place["x"], place["y"], -15.0), pose_of(end["x"], end["y"], end["yaw"]))
    assert way.edges == ("-3",)
    assert heights.at("-3_0", 150) == pytest.approx(6, abs=0.1)
    assert heights.at("-3_0", 75) == pytest.approx(2, abs=0.2)


def test_in_a_flat_net_roads_that_cross_without_a_junction_are_bridges(overpass: Path) -> None:
    net = foreign_net(overpass)
    flat = Heights({lane: (marks, (0.0,) * len(marks)) for lane, (marks, _) in Heights.of(net).lanes.items()})
    assert len(bridges(read_network(net), flat)) == 4
    over = foreign_net(write_map(overpass.parent / "plain.xodr", LOW))
    assert bridges(read_network(over), Heights.of(over)) == ()


def test_the_starter_keeps_off_bridges_and_says_that_there_are_some(overpass: Path, tmp_path: Path) -> None:
    apart = Road("9", -150, 300, 0, 300)
    done = opendrive.run(write_map(tmp_path / "three.xodr", LOW, HIGH, apart), out=tmp_path / "out")
    assert any("roads go over others (4 pairs of edges)" in note for note in done.notes)
    line = compile_test_case(load_test_cases([tmp_path / "out"])[0]).scene.actors[0].line
    assert line is not None
    assert line.edges[0] in ("9", "-9")


def test_where_roads_go_over_each_other_there_is_no_traffic(overpass: Path, tmp_path: Path) -> None:
    """The world is flat: vehicles on the two roads would meet."""
    ends = (HIGH.at(100, -1.75), HIGH.at(260, -1.75)), (HIGH.at(190, -1.75), HIGH.at(280, -1.75))
    routes = write_routes(tmp_path / "Town04_Scenario3.xml", *ends, town="Town04")
    done = carla_import.run(overpass, [routes], out=tmp_path / "out")
    assert done.left_out["routes over or under another road (the world is flat: they have no traffic)"] == 1
    assert [file.name for file in done.files] == ["Town04.xodr", "scenario3.foresee", "scenario3_bridge.foresee"]
    assert "traffic others {" not in (tmp_path / "out" / "scenario3_bridge.foresee").read_text()
    assert "traffic others {" in (tmp_path / "out" / "scenario3.foresee").read_text()
    assert placement_mistakes(load_test_cases([tmp_path / "out"])) == ()


def test_a_motorway_without_sidewalks_and_signals(motorway: Path, tmp_path: Path) -> None:
    files = []
    for family in "34789":
        ends = (FIRST.at(40, -1.75), SECOND.at(250, -1.75)), (FIRST.at(60, -8.75), SECOND.at(250, -5.25))
        files.append(write_routes(tmp_path / f"Town06_Scenario{family}.xml", *ends, town="Town06"))
    done = carla_import.run(motorway, files, out=tmp_path / "out")
    assert done.cases == 10
    assert done.left_out["routes that have no place for their family's behaviour"] == 6  # 7, 8, 9: no junction
    assert done.left_out["lanes of type bidirectional (one direction, 5 km/h)"] == 2
    assert done.left_out["lanes of type shoulder"] == 2
    assert "lanes of type entry" not in done.left_out
    assert any("no sidewalks" in note for note in done.notes)
    assert "traffic walkers" not in (tmp_path / "out" / "scenario3.foresee").read_text()
    cases = load_test_cases([tmp_path / "out"])
    assert placement_mistakes(cases) == ()
    line = compile_test_case(cases[0]).scene.actors[0].line
    assert line is not None
    assert set(line.limits) == {31.29}  # 70 mph, on the entry lane too


def new_format(*routes: str) -> str:
    return f"<routes>{''.join(routes)}</routes>"


def new_route(name: str, *places: dict[str, float], town: str = "Town06", scenarios: str = "") -> str:
    points = "".join(f'<position x="{p["x"]}" y="{p["y"]}" z="{p["z"]}"/>' for p in places)
    return (
        f'<route id="{name}" town="{town}"><weathers/><waypoints>{points}</waypoints>'
        f"<scenarios>{scenarios}</scenarios></route>"
    )


def scenario(kind: str, place: dict[str, float]) -> str:
    point = f'<trigger_point x="{place["x"]}" y="{place["y"]}" z="0" yaw="{place["yaw"]}"/>'
    return f'<scenario name="{kind}_1" type="{kind}">{point}</scenario>'


def test_routes_of_newer_leaderboards(motorway: Path, tmp_path: Path) -> None:
    """Many positions without directions, scenarios inside, several towns in a file."""
    dense = [FIRST.at(s, -1.75) for s in range(40, 300, 10)]
    crosses = scenario("DynamicObjectCrossing", FIRST.at(150, -1.75)) + scenario("Accident", FIRST.at(200))
    file = tmp_path / "longest6.xml"
    file.write_text(
        new_format(
            new_route("7", *dense, SECOND.at(50, -1.75), SECOND.at(200, -1.75), scenarios=crosses),
            new_route("8", *dense, town="Town05"),
            new_route("9", FIRST.at(40)),
        )
    )
    left_out: Counter[str] = Counter()
    routes = read_routes(file, left_out)
    assert [(r.id, r.town, r.family, len(r.between)) for r in routes] == [
        ("7", "Town06", "3", 26),
        ("8", "Town05", "", 24),
    ]
    assert routes[0].start.heading_rad == pytest.approx(math.radians(10))  # towards the next place
    assert math.isnan(routes[0].end.heading_rad)  # 150 m apart: not known
    done = carla_import.run(motorway, [file], out=tmp_path / "out")
    assert done.taken == {"routes of family 3": 1}
    assert done.left_out["routes in Town05"] == 1
    assert done.left_out["routes with less than two waypoints"] == 1
    assert done.left_out["scenarios of routes: Accident"] == 1
    text = (tmp_path / "out" / "scenario3.foresee").read_text()
    assert "param spot: length = 119.6" in text  # 12 m behind the trigger, from the front: 110 m + 12 m - 2.4 m


def test_places_on_the_way_are_driven_over(tmp_path: Path) -> None:
    """Two ways lead from west to east; the longer one goes over the place between."""
    net = foreign_net(block(tmp_path))
    network = read_network(net)
    start, end = pose_of(-90, 1.6, 0), pose_of(290, 1.6, 0)
    assert way_between(network, start, end).edges == ("in", "short", "out")
    over = way_between(network, start, end, [pose_of(100, -98.4, 0)])
    assert over.edges == ("in", "down", "along", "up", "out")


def block(folder: Path) -> Path:
    """A net with two ways, by netconvert."""
    from foresee_dsl.compile.nets.netconvert import run_netconvert

    nodes = {"w": (-100, 0), "a": (0, 0), "b": (200, 0), "e": (300, 0), "c": (0, 100), "d": (200, 100)}
    edges = {"in": "wa", "short": "ab", "out": "be", "down": "ac", "along": "cd", "up": "db"}
    node_text = "".join(f'<node id="{k}" x="{x}" y="{y}"/>' for k, (x, y) in nodes.items())
    edge_text = "".join(f'<edge id="{k}" from="{v[0]}" to="{v[1]}"/>' for k, v in edges.items())
    (folder / "x.nod.xml").write_text(f"<nodes>{node_text}</nodes>")
    (folder / "x.edg.xml").write_text(f"<edges>{edge_text}</edges>")
    arguments = ["-n", "x.nod.xml", "-e", "x.edg.xml", "--offset.disable-normalization", "true", "-o", "x.net.xml"]
    run_netconvert(arguments, folder)
    return folder / "x.net.xml"


def test_the_family_of_a_route_without_one_is_that_of_the_first_trigger_on_it(motorway: Path, tmp_path: Path) -> None:
    routes = write_routes(tmp_path / "routes.xml", (FIRST.at(40, -1.75), SECOND.at(250, -1.75)), town="Town06")
    near = write_triggers(tmp_path / "a.json", "3", FIRST.at(200, -1.75), town="Town06")
    far = write_triggers(tmp_path / "b.json", "4", SECOND.at(200, -1.75), FIRST.at(100, 30), town="Town06")
    done = carla_import.run(motorway, [routes], [near, far], out=tmp_path / "out")
    assert done.taken == {"routes of family 3": 1}
    assert done.left_out["triggers that no test case uses (each uses one trigger)"] == 2


def test_triggers_of_other_kinds_and_towns_are_counted(motorway: Path, tmp_path: Path) -> None:
    place = {"x": "100", "y": -17.6}  # a number as text, and no yaw
    kinds = {"Town06": ["ControlLoss", "Scenario3"], "Town05": ["Scenario3"]}
    towns = {
        town: [{"scenario_type": kind, "available_event_configurations": [{"transform": place}]} for kind in found]
        for town, found in kinds.items()
    }
    file = tmp_path / "all.json"
    file.write_text(json.dumps({"available_scenarios": [towns]}))
    left_out: Counter[str] = Counter()
    assert [(t.family, t.town) for t in read_triggers(file, left_out)] == [
        ("", "Town06"),
        ("3", "Town06"),
        ("3", "Town05"),
    ]
    assert left_out == {"triggers of the unknown kind ControlLoss": 1}
    ends = FIRST.at(40, -1.75), SECOND.at(250, -1.75)
    routes = write_routes(tmp_path / "Town06_Scenario3.xml", ends, town="Town06")
    done = carla_import.run(motorway, [routes], [file], out=tmp_path / "out")
    assert done.left_out["triggers in Town05"] == 1
    assert done.left_out["triggers that no test case uses (each uses one trigger)"] == 1  # the one of the unknown kind


@pytest.mark.parametrize(
    ("text", "town"),
    [("Town10HD_Opt", "Town10HD"), ("Carla/Maps/Town04", "Town04"), ("Mine", "Mine"), ("mine.xodr", ""), ("", "")],
)
def test_towns_are_known_by_their_number(text: str, town: str) -> None:
    assert town_in(text) == town


def test_families_by_name() -> None:
    assert [family_of(k) for k in ("Scenario7", "OppositeVehicleRunningRedLight", "Accident", "")] == ["7", "7", "", ""]


def test_a_way_that_leaves_the_road_is_found(tmp_path: Path) -> None:
    """A lane that begins 6 m beside the one before it, as in old editions of maps."""
    net = block(tmp_path)
    spec = spec_of(bundled_models()["car.sedan"])
    route = CarlaRoute("1", "", "3", pose_of(-90, 1.6, 0), pose_of(290, 1.6, 0), net, 0)
    sound = place_route(read_network(net), route, [], spec, in_order=False)
    assert strays(read_network(net), sound) == (0.0, 0.0, 0.0)
    root = ElementTree.parse(net).getroot()
    lane = root.find("edge[@id='short']/lane")
    assert lane is not None
    lane.set("shape", "20.00,-7.60 180.00,-7.60")
    ElementTree.ElementTree(root).write(tmp_path / "broken.net.xml")
    broken = read_network(tmp_path / "broken.net.xml")
    depth_m, x, _ = strays(broken, place_route(broken, route, [], spec, in_order=False))
    assert depth_m > 0.5
    assert 0 < x < 200


def test_a_route_whose_end_is_its_start(motorway: Path, tmp_path: Path) -> None:
    ends = FIRST.at(40, -1.75), FIRST.at(40.5, -1.75)
    routes = write_routes(tmp_path / "Town06_Scenario3.xml", ends, town="Town06")
    with pytest.raises(ExchangeError, match="its end is at its start"):
        carla_import.run(motorway, [routes], out=tmp_path / "out")
