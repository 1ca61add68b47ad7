"""The folder that SUMO's own programs open."""

import json
import math
import subprocess
import sys

import numpy as np
import pytest

from foresee_dsl.compile.bundle import PlacedActor, Scene, SumoBundle
from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.sumo_files import types_of, write_sumo_folder
from foresee_dsl.language.model import VehicleModel
from tests.support.worlds import four_arms, net_of, q, read_signals

FIRST_STEP = """
import json, sys, libsumo
libsumo.start(["sumo", "-c", sys.argv[1], "--no-step-log"])
libsumo.simulationStep()
v = libsumo.vehicle
seen = {k: [*v.getPosition(k), v.getAngle(k), v.getSpeed(k), v.getTypeID(k), v.getRoute(k)] for k in v.getIDList()}
tls = libsumo.trafficlight
print(json.dumps([seen, tls.getRedYellowGreenState("j4"), tls.getNextSwitch("j4"), libsumo.polygon.getIDList()]))
"""


def spec(name, length, width):
    return spec_of(VehicleModel(name=name, length=q(length), width=q(width)))


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bundle")
    net, types = net_of(four_arms()), folder / "types.add.xml"
    car, walker, crate = spec("car.plain", 4.5, 1.8), spec("pedestrian.adult", 0.4, 0.5), spec("obstacle.crate", 1, 1)
    bicycle = spec("bicycle.city", 1.8, 0.6)
    types.write_text(types_of([car, walker, bicycle]))
    up = math.pi / 2
    on_way = {"model": car, "heading_rad": up, "cruise_mps": 13.0, "lane": "south_1", "route": ("south", "north_back")}
    down = {**on_way, "heading_rad": -up, "cruise_mps": 4.0, "lane": "north_1", "route": ("north", "south_back")}
    path = np.array([[-6.0, -30.0], [6.0, -30.0]])
    actors = (
        PlacedActor("ego", control="ego", x=1.65, y=-80.0, speed_mps=9.0, **on_way),
        PlacedActor("lead", control="sumo", x=1.65, y=-50.0, speed_mps=7.0, **on_way),
        PlacedActor("speeder", control="sumo", x=-1.65, y=90.0, speed_mps=20.0, **{**down, "cruise_mps": 22.0}),
        PlacedActor("cyclist", control="sumo", x=-1.65, y=50.0, speed_mps=4.0, **{**down, "model": bicycle}),
        PlacedActor("walker", walker, "path", -6.0, -30.0, 0.0, 0.0, path=path),
        PlacedActor("box", crate, "static", 3.0, -20.0, 0.0, 0.0),
    )
    scene = Scene(actors, start_s=0.0, goal_s=100.0, end_s=20.0, signals=(("j4", "ew_go", 21.5),))
    return SumoBundle("n", net, types, "key", read_network(net), read_signals(net, four_arms()), scene)


def test_sumo_opens_the_folder_with_everything_in_its_place(tmp_path, bundle):
    config, *others = write_sumo_folder(bundle, tmp_path / "out")
    assert config.name == "scenario.sumocfg"
    assert {p.parent for p in others} == {tmp_path / "out"}
    done = subprocess.run([sys.executable, "-c", FIRST_STEP, config], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "Warning" not in done.stderr + done.stdout
    seen, light, switch_s, shapes = json.loads(done.stdout.splitlines()[-1])
    assert set(seen) == {"ego", "lead", "speeder", "cyclist"}
    for actor in bundle.scene.actors[:4]:
        x, y, angle, speed, kind, route = seen[actor.id]
        assert (x, y) == pytest.approx((actor.x, actor.y), abs=0.02)
        assert (kind, tuple(route)) == (actor.model.name, actor.route)
        assert angle == pytest.approx(90 - math.degrees(actor.heading_rad))
        assert speed == pytest.approx(actor.speed_mps)
    # 21.5 s into the stage people have stopped (after 20 s), and cars go for another 3.5 s.
    assert light == bundle.signals["j4"].phases[5].state
    assert switch_s == pytest.approx(3.5)
    assert set(shapes) == {"walker", "walker.path", "box"}


def test_the_same_bundle_gives_the_same_files(tmp_path, bundle):
    first, second = (write_sumo_folder(bundle, tmp_path / name) for name in "ab")
    assert [p.read_bytes() for p in first] == [p.read_bytes() for p in second]
