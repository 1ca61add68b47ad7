"""CARLA's files: what is read, what is counted as left out, what is refused."""

from __future__ import annotations

import json
import math
from collections import Counter
from pathlib import Path

import pytest
from foresee_exchange.carla.files import pose_of, read_routes, read_triggers, read_vtypes, town_of
from foresee_exchange.carla.scenario_files import catalogue_of, ego_of, mix_of, vehicles_of

from foresee_dsl.errors import ForeseeError

ROUTE = '<route id="{id}" town="Town77">{points}</route>'
POINT = '<waypoint x="{x}" y="{y}" z="0.0" pitch="0.0" roll="0.0" yaw="{yaw}"/>'
BOMB = '<!DOCTYPE routes [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]><routes>&b;</routes>'
TYPES = """<routes>
  <vType id="vehicle.tesla.model3" length="4.81" width="2.17" height="1.52" vClass="evehicle"/>
  <vType id="vehicle.carlamotors.carlacola" length="5.2" width="2.6" height="2.5" vClass="truck"/>
  <vType id="vehicle.gazelle.omafiets" length="1.84" width="0.47" height="1.6" vClass="bicycle"/>
  <vType id="vehicle.odd.boat" length="9" width="3" vClass="ship"/>
</routes>"""


def routes_text(*bodies: str) -> str:
    return f"<routes>{''.join(bodies)}</routes>"


def two_points(**extra: str) -> str:
    return POINT.format(x=10, y=-20, yaw=90) + POINT.format(x=30.5, y=-20, yaw=extra.get("yaw", 0))


def test_coordinates_are_turned_round() -> None:
    pose = pose_of(10.0, -20.0, 90.0)
    assert (pose.x, pose.y) == (10.0, 20.0)
    assert pose.heading_rad == pytest.approx(-math.pi / 2)  # SUMO's angle 90 + yaw: 180, south
    assert pose_of(0, 0, 450).heading_rad == pytest.approx(pose_of(0, 0, 90).heading_rad)


def test_routes_are_read_with_their_family(tmp_path: Path) -> None:
    file = tmp_path / "Town77_Scenario7.xml"
    file.write_text(routes_text(ROUTE.format(id="4", points=two_points()), ROUTE.format(id="9", points=two_points())))
    left_out: Counter[str] = Counter()
    routes = read_routes(file, left_out)
    assert [(r.id, r.town, r.family, r.order) for r in routes] == [("4", "Town77", "7", 0), ("9", "Town77", "7", 1)]
    assert (routes[0].end.x, routes[0].end.y) == (30.5, 20.0)
    assert not left_out
    folder = tmp_path / "Scenario10"
    folder.mkdir()
    (folder / "x.xml").write_text(file.read_text())
    assert read_routes(folder / "x.xml", left_out)[0].family == "10"
    assert town_of(Path("Town10HD.xodr")) == "Town10HD"
    assert town_of(Path("Town03_2019.xodr")) == "Town03"
    assert town_of(Path("mine.xodr")) == ""


def test_what_is_left_out_is_counted(tmp_path: Path) -> None:
    file = tmp_path / "r.xml"
    hill = '<waypoint x="1" y="2" z="3.5" pitch="4" roll="0" yaw="0"/>'
    level = '<waypoint x="1" y="2" z="0" pitch="360" roll="-0.1" yaw="0"/>'
    file.write_text(routes_text(ROUTE.format(id="1", points=hill + level + hill + '<weather sun="3"/>')))
    left_out: Counter[str] = Counter()
    (route,) = read_routes(file, left_out)
    assert [(place.x, place.z) for place in route.between] == [(1.0, 0.0)]
    assert left_out == {
        "heights of waypoints (the world is flat)": 2,
        "pitch and roll of waypoints (the world is flat)": 2,
        "<weather> of routes": 1,
    }


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (BOMB, "declares entities"),
        (routes_text(ROUTE.format(id="1", points=two_points()))[:-20], "not a CARLA route file"),
        ("<net/>", "its root is <net>"),
        (routes_text(), "contains no routes"),
        (routes_text(ROUTE.format(id="1", points=POINT.format(x=1, y=2, yaw=3))), "has 1 waypoints"),
        (routes_text(ROUTE.format(id="1", points=POINT.format(x="a", y=2, yaw=3) * 2)), "is not a number"),
        (routes_text(ROUTE.format(id="1", points=POINT.format(x="inf", y=2, yaw=3) * 2)), "not finite"),
        (routes_text(ROUTE.format(id="1", points='<waypoint x="1"/>' * 2)), "has no 'y'"),
        (routes_text(*[ROUTE.format(id="1", points=two_points())] * 2), "two routes with the id 1"),
        (routes_text("<a>" * 100 + "</a>" * 100), "nests more than 100"),
    ],
)
def test_broken_route_files_are_refused(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "r.xml"
    file.write_text(text)
    with pytest.raises(ForeseeError, match=words) as raised:
        read_routes(file, Counter())
    assert str(file) in str(raised.value)


def test_a_huge_file_is_refused_before_it_is_read(tmp_path: Path) -> None:
    file = tmp_path / "r.xml"
    with file.open("wb") as out:
        out.truncate(200_000_000)
    for read in (read_routes, read_triggers):
        with pytest.raises(ForeseeError, match=r"200 MB, more than the 100 MB"):
            read(file, Counter())


def trigger_file(path: Path, *transforms: dict[str, object], **event: object) -> Path:
    events = [{"transform": transform, **event} for transform in transforms]
    scenario = {"available_event_configurations": events, "scenario_type": "Scenario4"}
    path.write_text(json.dumps({"available_scenarios": [{"Town77": [scenario]}]}))
    return path


def test_triggers_are_read(tmp_path: Path) -> None:
    left_out: Counter[str] = Counter()
    place = {"x": 1.0, "y": 2.0, "z": 0.0, "pitch": 360.0, "yaw": -90.0}
    found = read_triggers(trigger_file(tmp_path / "t.json", place, place, other_actors=None), left_out)
    assert [(t.family, t.town, t.order) for t in found] == [("4", "Town77", 0), ("4", "Town77", 1)]
    assert (found[0].pose.x, found[0].pose.y) == (1.0, -2.0)
    assert found[0].pose.heading_rad == pytest.approx(math.pi / 2)
    assert not left_out
    read_triggers(trigger_file(tmp_path / "t.json", place, other_actors={"left": []}), left_out)
    assert sum(left_out.values()) == 1


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"available_scenarios": 3}', "[" * 100_000, '{"available_scenarios": [{"T": [{}]}]}']
)
def test_broken_trigger_files_are_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "t.json"
    file.write_text(text)
    with pytest.raises(ForeseeError, match="not a CARLA trigger file"):
        read_triggers(file, Counter())
    with pytest.raises(ForeseeError, match="cannot be read"):
        read_triggers(tmp_path / "absent.json", Counter())


def test_blueprints_become_a_catalogue(tmp_path: Path) -> None:
    file = tmp_path / "types.rou.xml"
    file.write_text(TYPES)
    left_out: Counter[str] = Counter()
    catalogue = catalogue_of(read_vtypes(file), left_out)
    names = vehicles_of(catalogue)
    assert names == ("car.tesla_model3", "truck.carlamotors_carlacola", "bicycle.gazelle_omafiets")
    assert sum(left_out.values()) == 1
    assert ego_of(names) == "car.tesla_model3"
    assert ego_of(()) == "car.sedan"
    assert {name.partition(".")[0] for name in mix_of(catalogue)} >= {"car", "truck", "bicycle", "van", "motorcycle"}
    assert "car.compact" not in mix_of(catalogue)
    file.write_text("<routes/>")
    with pytest.raises(ForeseeError, match="no vType"):
        read_vtypes(file)
