"""Clips as CARLA's routes: left-handed, by the middle of the vehicle, in the map's own coordinates."""

from __future__ import annotations

import math
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from foresee_exchange.carla import exporter as carla_route
from foresee_exchange.carla import importer as carla_import
from typer.testing import CliRunner

from foresee_dsl.cli import app
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.language.project.loading import load_test_cases
from tests.support.openscenario_files import XODR

SCENARIO = """foresee 1

scenario along {
  use network "Town77.xodr"

  ego: car.sedan at (100 m, -1.75 m) heading -2 deg speed 10 m/s {
    route [%s]
    goal (180 m, -1.75 m)
  }

  end after 5 s
}
"""


def written(folder: Path, edge: str = '"-1"') -> Path:
    """Write the map and the scenario."""
    (folder / "Town77.xodr").write_text(XODR)
    (folder / "along.foresee").write_text(SCENARIO % edge)
    return folder / "along.foresee"


def test_a_route_begins_where_the_ego_is_and_ends_at_its_goal(tmp_path: Path) -> None:
    file = written(tmp_path)
    done = carla_route.run([str(file), str(file)], out=tmp_path / "out" / "routes.xml")
    assert done.cases == 2
    root = ElementTree.parse(tmp_path / "out" / "routes.xml").getroot()
    assert [(r.get("id"), r.get("town")) for r in root] == [("0", "Town77"), ("1", "Town77")]
    start, end = root[0]
    assert list(start.attrib) == ["x", "y", "z", "pitch", "roll", "yaw"]
    half = 4.75 / 2
    turned = math.radians(-2)
    assert float(start.get("x")) == pytest.approx(100 - half * math.cos(turned), abs=1e-6)
    assert float(start.get("y")) == pytest.approx(-(-1.75 - half * math.sin(turned)), abs=1e-6)
    assert float(start.get("yaw")) == pytest.approx(2)
    assert [float(end.get(key)) for key in ("x", "y", "yaw")] == pytest.approx([180, 1.75, 0], abs=1e-6)
    assert done.left_out == {"speeds at the beginning": 2}


def test_a_moved_net_is_moved_back(tmp_path: Path) -> None:
    """A net's offset is what its coordinates were moved by: CARLA knows nothing of it."""
    from foresee_dsl.compile.foreign.networks import foreign_net

    plain = carla_route.run([str(written(tmp_path))], out=tmp_path / "plain.xml").files[0].read_text()
    net = foreign_net(tmp_path / "Town77.xodr").read_text()
    assert 'netOffset="0.00,0.00"' in net
    (tmp_path / "Town77.net.xml").write_text(net.replace('netOffset="0.00,0.00"', 'netOffset="30.00,-5.00"'))
    file = written(tmp_path)
    file.write_text(file.read_text().replace("Town77.xodr", "Town77.net.xml"))
    moved = ElementTree.fromstring(carla_route.run([str(file)], out=tmp_path / "moved.xml").files[0].read_text())
    for was, now in zip(ElementTree.fromstring(plain)[0], moved[0], strict=True):
        assert float(now.get("x")) == pytest.approx(float(was.get("x")) - 30)
        assert float(now.get("y")) == pytest.approx(float(was.get("y")) - 5)


def test_whoever_cannot_name_the_town_is_told(tmp_path: Path) -> None:
    file = written(tmp_path)
    inline = file.read_text().replace('use network "Town77.xodr"', "network {\n junction a at (0 m, -1.75 m)\n"
        " junction b at (300 m, -1.75 m)\n road main from a to b { back 0 }\n}").replace('"-1"', "main")  # fmt: skip
    file.write_text(inline)
    with pytest.raises(ExchangeError, match="--town"):
        carla_route.run([str(file)], out=tmp_path / "out" / "routes.xml")
    assert not (tmp_path / "out").exists()
    arguments = ["export", "carla-route", str(file), "--out", str(tmp_path / "r.xml"), "--town", "Town09"]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    assert 'town="Town09"' in (tmp_path / "r.xml").read_text()
    with pytest.raises(ExchangeError, match=r"must end in \.xml"):
        carla_route.run([str(file)], out=tmp_path / "routes.json", town="Town09")


def test_routes_of_carla_come_back(carla: Path, tmp_path: Path) -> None:
    """What was imported from CARLA goes back to it: the same starts and the same goals."""
    file = carla / "routes" / "Scenario7" / "Town10HD_Scenario7.xml"
    carla_import.run(carla / "maps" / "xodr" / "Town10HD.xodr", [file], [], out=tmp_path / "in")
    cases = {re.sub(r".*_(\d+)$", r"\1", case.id): case.id for case in load_test_cases([tmp_path / "in"])}
    routes = ElementTree.parse(file).getroot().findall("route")[:6]
    out = tmp_path / "out.xml"
    carla_route.run([cases[route.get("id")] for route in routes], out=out)
    for was, now in zip(routes, ElementTree.parse(out).getroot(), strict=True):
        assert now.get("town") == was.get("town") == "Town10HD"
        off = [
            math.hypot(*(float(a.get(key)) - float(b.get(key)) for key in "xy")) for a, b in zip(was, now, strict=True)
        ]
        assert off[0] < 0.1
        assert off[1] < 0.05
        turned = [
            abs(math.remainder(float(a.get("yaw")) - float(b.get("yaw")), 360)) for a, b in zip(was, now, strict=True)
        ]
        assert turned[0] < 12  # in a bend the ego has the lane's direction at its front
        assert turned[1] < 2


def test_the_format_of_todays_scenario_runner(tmp_path: Path) -> None:
    """What its `RouteParser.parse_routes_file` reads: `waypoints/position`, `scenarios`, `weathers/weather`."""
    file = written(tmp_path)
    file.write_text(file.read_text().replace("  ego:", "  weather rain 0.5, sun 0.4\n\n  ego:"))
    done = carla_route.run([str(file)], out=tmp_path / "routes.xml", route_format="0.9.15")
    (route,) = ElementTree.fromstring(done.files[0].read_text())
    assert [part.tag for part in route] == ["weathers", "waypoints", "scenarios"]
    assert not list(route.find("scenarios") or ())
    start, end = route.find("waypoints") or ()
    assert (list(start.attrib), end.tag) == (["x", "y", "z"], "position")
    assert [float(end.get(key, "")) for key in "xy"] == pytest.approx([180, 1.75], abs=1e-6)
    (weather,) = route.find("weathers") or ()
    figures = {name: float(value) for name, value in weather.attrib.items()}
    assert figures == {
        "route_percentage": 0, "cloudiness": 0, "precipitation": 50, "wetness": 0, "fog_density": 0,
        "sun_altitude_angle": 9,
    }  # fmt: skip
    assert "weather" in carla_route.run([str(file)], out=tmp_path / "old.xml").left_out
    with pytest.raises(ExchangeError, match=r"there is no format 0.9.11: write 0.9.10 or 0.9.15"):
        carla_route.run([str(file)], out=tmp_path / "routes.xml", route_format="0.9.11")
