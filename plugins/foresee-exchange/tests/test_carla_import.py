"""`foresee import carla` on a small town: real netconvert, real placement, real runs."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path

import pytest
from foresee_exchange.carla import importer as carla_import
from foresee_exchange.carla.importer import prepare_net
from foresee_exchange.carla.ways import lanes_at, through_of, way_between

from foresee_dsl.compile import compile_test_case, placement_mistakes
from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import ForeseeError
from foresee_dsl.exchange.outcome import Imported
from foresee_dsl.language.parser import load
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.loading import load_test_case, load_test_cases
from foresee_dsl.simulate.runner import run
from tests.support.carla_files import carla_place, write_routes, write_triggers
from tests.support.command import foresee
from tests.support.worlds import four_arms, net_of, shifted_net

WAYS = {"3": ("south", "north_back"), "4": ("south", "east_back"), "7": ("south", "north_back")}
WAYS |= {"8": ("south", "west_back"), "9": ("south", "east_back")}


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, RoadNetwork]:
    """A net whose coordinates were normalised, and the network where CARLA's coordinates have it."""
    file = tmp_path_factory.mktemp("town") / "Town77.net.xml"
    shutil.copy(shifted_net(four_arms(), 150.0, 70.0), file)
    return file, read_network(net_of(four_arms()))


def sources(folder: Path, network: RoadNetwork, families: str = "34789") -> tuple[list[Path], list[Path]]:
    """Two routes a family, with their triggers."""
    routes, triggers = [], []
    for family in families:
        first, last = WAYS[family]
        ends = [(carla_place(network, first, at), carla_place(network, last, 60)) for at in (30, 50)]
        routes.append(write_routes(folder / f"Town77_Scenario{family}.xml", *ends))
        places = [carla_place(network, first, 52 if family == "3" else 70) for _ in ends]
        triggers.append(write_triggers(folder / f"Town77_Scenario{family}.json", family, *places))
    return routes, triggers


@pytest.fixture(scope="module")
def imported(town: tuple[Path, RoadNetwork], tmp_path_factory: pytest.TempPathFactory) -> tuple[Imported, Path]:
    folder = tmp_path_factory.mktemp("import")
    net, network = town
    routes, triggers = sources(folder, network)
    return carla_import.run(net, routes, triggers, out=folder / "out"), folder / "out"


def test_a_file_a_family_and_a_case_a_route(imported: tuple[Imported, Path]) -> None:
    done, out = imported
    names = [f"scenario{family}.foresee" for family in "34789"]
    assert [file.name for file in done.files] == ["Town77.net.xml", *names]
    assert done.cases == 10
    assert done.taken == {f"routes of family {family}": 2 for family in "34789"}
    assert not done.left_out
    for name in names:
        assert {case.id.rpartition("::")[2] for case in load_test_cases([out / name])} == {"route_10", "route_20"}


def test_everything_has_its_place_and_the_one_layout(imported: tuple[Imported, Path]) -> None:
    _, out = imported
    cases = load_test_cases([out])
    assert placement_mistakes(cases) == ()
    assert [case.scenario.family for case in cases] == [family for family in "34789" for _ in range(2)]
    for file in out.glob("*.foresee"):
        document = load(file)
        assert print_model(document.model, document.comments) == file.read_text(encoding="utf-8")


def test_the_ego_starts_at_carlas_waypoint(imported: tuple[Imported, Path], town: tuple[Path, RoadNetwork]) -> None:
    _, out = imported
    _, network = town
    scene = compile_test_case(load_test_case(f"{out}/scenario7.foresee::route_20")).scene
    place = carla_place(network, "south", 50)
    ego = scene.actors[0]
    front = ego.model.length_m / 2  # CARLA says where its middle is
    assert ego.x == pytest.approx(place["x"] + front * math.cos(ego.heading_rad), abs=0.02)
    assert ego.y == pytest.approx(-place["y"] + front * math.sin(ego.heading_rad), abs=0.02)
    end = carla_place(network, "north_back", 60)
    line = scene.actors[0].line
    assert line is not None
    assert line.at(scene.goal_s)[:2] == pytest.approx((end["x"], -end["y"]), abs=0.02)


def test_the_families_do_what_they_are_about(imported: tuple[Imported, Path]) -> None:
    _, out = imported
    text = {family: (out / f"scenario{family}.foresee").read_text() for family in "34789"}
    assert "signal junction stage shown" not in text["3"]
    for family in "4789":
        assert "signal junction stage shown elapsed since" in text[family]
    assert "ignores signals at junction" in text["7"]
    assert 'oncoming_first: arm = "north"' in text["8"].replace("arm = north", 'arm = "north"')
    crossing = compile_test_case(load_test_case(f"{out}/scenario9.foresee::route_10")).scene.actors
    assert next(actor for actor in crossing if actor.id == "crossing").route[-1] == "east_back"


@pytest.mark.parametrize("family", ["3", "7", "8"])
def test_a_case_runs(imported: tuple[Imported, Path], family: str) -> None:
    _, out = imported
    result = run(compile_test_case(load_test_case(f"{out}/scenario{family}.foresee::route_10")), load_driver("idm"))
    assert result.verdict not in ("crash", "invalid")
    assert result.trace.frames > 40


def test_the_net_is_moved_back_and_gets_programs(town: tuple[Path, RoadNetwork], tmp_path: Path) -> None:
    net, network = town
    prepare_net(net, tmp_path / "Town77.net.xml")
    moved = read_network(tmp_path / "Town77.net.xml")
    assert moved.junctions["j4"].x == pytest.approx(network.junctions["j4"].x, abs=0.01)
    assert 'name="ns_go"' in (tmp_path / "Town77.net.xml").read_text()


def test_places_and_ways(town: tuple[Path, RoadNetwork]) -> None:
    _, network = town
    inside = next(m for m in network.movements if (m.from_edge, m.to_edge) == ("south", "west_back"))
    x, y, heading = network.lanes[inside.via[0]].line.at(4.0)
    end = Pose(*network.edges["west_back"].for_kind("car")[0].line.at(50))
    way = way_between(network, Pose(x, y, heading), end)
    assert way.edges == ("south", "west_back")  # extended to the edge before the junction
    assert way.start.lane.internal
    assert way.start.off_m < 0.01
    assert through_of(network, ("south", "west_back")) == ("south", "west_back")
    assert lanes_at(network, Pose(500.0, 500.0, 0.0)) == []
    assert {one.lane.edge for one in lanes_at(network, Pose(*network.edges["south"].drivable[0].line.at(40)))} == {
        "south"
    }


def other_town(folder: Path, net: Path, network: RoadNetwork) -> tuple[Path, list[Path]]:
    ends = carla_place(network, "south", 30), carla_place(network, "north_back", 60)
    return net, [write_routes(folder / "Town05_Scenario7.xml", ends, town="Town05")]


def far_away(folder: Path, net: Path, network: RoadNetwork) -> tuple[Path, list[Path]]:
    ends = carla_place(network, "south", 30) | {"x": 900.0}, carla_place(network, "north_back", 60)
    return net, [write_routes(folder / "r_Scenario7.xml", ends, town="")]


def cut_map(folder: Path, net: Path, network: RoadNetwork) -> tuple[Path, list[Path]]:
    del net
    file = folder / "Town77.xodr"
    file.write_text("<OpenDRIVE><road id='1'><planView><geometry s='0' x='0'")
    ends = carla_place(network, "south", 30), carla_place(network, "north_back", 60)
    return file, [write_routes(folder / "r_Scenario7.xml", ends)]


def no_cars(folder: Path, net: Path, network: RoadNetwork) -> tuple[Path, list[Path]]:
    file = folder / "Town77.net.xml"
    text = (
        net.read_text().replace('disallow="pedestrian"', 'allow="rail"').replace('allow="pedestrian"', 'allow="rail"')
    )
    file.write_text(text)
    ends = carla_place(network, "south", 30), carla_place(network, "north_back", 60)
    return file, [write_routes(folder / "r_Scenario7.xml", ends)]


def of_no_kind(folder: Path, net: Path, network: RoadNetwork) -> tuple[Path, list[Path]]:
    _, routes = other_town(folder, net, network)
    file = folder / "map.osm"
    file.write_text("<osm/>")
    return file, routes


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (other_town, "route 10 is in Town05, but the map Town77.net.xml is Town77"),
        (far_away, "1 of 1 routes are not on this map, which may be that of another town"),
        (cut_map, "not an OpenDRIVE map"),
        (no_cars, "no lanes for cars"),
        (of_no_kind, r"must end in \.xodr or \.net\.xml"),
    ],
)
def test_bad_input_is_refused_and_nothing_written(
    town: tuple[Path, RoadNetwork], tmp_path: Path, make: object, words: str
) -> None:
    assert callable(make)
    map_file, routes = make(tmp_path, *town)
    with pytest.raises(ForeseeError, match=words):
        carla_import.run(map_file, routes, out=tmp_path / "new" / "out")
    assert not (tmp_path / "new").exists()


def test_an_unknown_family_is_driven_through_traffic_and_said(town: tuple[Path, RoadNetwork], tmp_path: Path) -> None:
    net, network = town
    ends = carla_place(network, "south", 30), carla_place(network, "north_back", 60)
    routes = [write_routes(tmp_path / "Town77_Scenario10.xml", ends)]
    done = carla_import.run(net, routes, out=tmp_path / "out")
    assert done.left_out == {"behaviour of Scenario10, which this tool does not know": 1}
    assert [file.name for file in done.files] == ["Town77.net.xml", "scenario10.foresee"]
    assert placement_mistakes(load_test_cases([tmp_path / "out"])) == ()


def test_the_command(town: tuple[Path, RoadNetwork], tmp_path: Path) -> None:
    net, network = town
    routes, triggers = sources(tmp_path, network, "7")
    out = tmp_path / "out"
    command = ["import", "carla", "--map", net, "--routes", *routes, *triggers, "--out", out]
    done = foresee(*command, "--json")
    data = json.loads(done.stdout)
    assert (data["schema"], data["cases"], data["taken"]) == (1, 2, {"routes of family 7": 2})
    again = foresee(*command)
    assert f"wrote {out / 'scenario7.foresee'}" in again.stdout
    assert "2 test cases" in again.stdout
    wrong = foresee(*command[:3], tmp_path / "no.xodr", *command[4:], expect=1)
    assert wrong.stderr.startswith("error: ")


def test_blueprints_are_driven(town: tuple[Path, RoadNetwork], tmp_path: Path) -> None:
    net, network = town
    routes, triggers = sources(tmp_path, network, "3")
    types = tmp_path / "types.rou.xml"
    types.write_text('<routes><vType id="vehicle.tesla.model3" length="4.81" width="2.17" height="1.5"/></routes>')
    done = carla_import.run(net, routes, triggers, out=tmp_path / "out", vtypes=types)
    assert done.taken["blueprints"] == 1
    cases = load_test_cases([tmp_path / "out"])
    assert placement_mistakes(cases) == ()
    assert cases[0].scenario.actors[0].model == "car.tesla_model3"
