"""Agents of CARLA's leaderboard as drivers: axes, sensors, route, and what needs CARLA's world."""

from __future__ import annotations

import importlib
import itertools
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from foresee_bridges.carla import agent_base, carla_types
from foresee_bridges.carla.coordinates import GeoReference, compass_rad, wheel_angle_rad, yaw_deg
from foresee_bridges.carla.driver import AgentDriver, control_of, plan_of
from foresee_bridges.carla.opendrive import for_carla
from foresee_bridges.carla.sensors import COLOURS_BGR, HEIGHTS_M, Scene, picture, readers
from foresee_bridges.carla.world import NeedsWorldError

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers import consent
from foresee_dsl.drivers.protocol import EgoState, Observation, SeenActor
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.errors import DriverError
from foresee_dsl.files import data_folder
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.episode import Episode

CASE = f"{data_folder('scenarios') / 'scenario3.foresee'}::r01"
TURN = f"{data_folder('scenarios') / 'scenario9.foresee'}::r01"
SENSORS = """
    def sensors(self):
        level = {"x": 0.0, "y": 0.0, "z": 0.0, "roll": 0.0, "pitch": 0.0, "yaw": 0.0}
        return [
            {"type": "sensor.other.gnss", "id": "GPS", **level},
            {"type": "sensor.other.imu", "id": "IMU", **level},
            {"type": "sensor.speedometer", "id": "SPEED", "reading_frequency": 20},
            {"type": "sensor.opendrive_map", "id": "MAP", "reading_frequency": 1},
            {"type": "sensor.lidar.ray_cast", "id": "LIDAR", **level, "z": 1.8},
        ]
"""
FOLLOWER = f"""
import math
import carla
import xml.etree.ElementTree as ET
from agents.navigation.local_planner import RoadOption
from leaderboard.autoagents.autonomous_agent import AutonomousAgent, Track

def get_entry_point():
    return "Follower"

class Follower(AutonomousAgent):
    def setup(self, path_to_conf_file):
        self.track, self.at, self.speed_mps = Track.MAP, 0, float(path_to_conf_file or 8)
        assert all(isinstance(option, RoadOption) for _, option in self._global_plan)
{SENSORS}
    def run_step(self, input_data, timestamp):
        if not timestamp:
            assert len(ET.fromstring(input_data["MAP"][1]["opendrive"]).findall("road")) > 10
        latitude, longitude, _ = input_data["GPS"][1]
        here = carla.Location(x=111319.49 * longitude, y=-111319.49 * latitude)
        yaw, speed = input_data["IMU"][1][6] - math.pi / 2, input_data["SPEED"][1]["speed"]
        plan = [transform.location for transform, _ in self._global_plan_world_coord]
        while self.at < len(plan) - 2 and here.distance(plan[self.at + 1]) < 8:
            self.at += 1
        step = plan[self.at + 1] - plan[self.at]
        along = step / step.length()
        ahead = plan[self.at] + along * ((here - plan[self.at]).dot(along) + 8)
        error = math.remainder(math.atan2(ahead.y - here.y, ahead.x - here.x) - yaw, 2 * math.pi)
        points = input_data["LIDAR"][1]
        blocked = bool(((points[:, 0] > 0) & (points[:, 0] < 4 + speed) & (abs(points[:, 1]) < 1.3)).any())
        throttle = 0.0 if blocked else min(max(self.speed_mps - speed, 0.0), 1.0)
        return carla.VehicleControl(steer=min(max(1.5 * error, -1.0), 1.0), throttle=throttle, brake=float(blocked))
"""


@pytest.fixture(autouse=True)
def own_search_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Folders of agents stay on the module search path as in the leaderboard; later tests must not import from them."""
    monkeypatch.setattr(sys, "path", [*sys.path])


def written(folder: Path, text: str, name: str) -> Path:
    """Write an agent's module; each test needs a name of its own, because modules stay imported."""
    file = folder / f"{name}.py"
    file.write_text(text)
    return file


def scene(ego: EgoState, *actors: SeenActor) -> Scene:
    return Scene(Observation(1.0, ego, actors, {}), GeoReference(), None)


def read(spec: dict[str, object], at: Scene) -> np.ndarray:
    ((_, same, reader),) = readers([spec])
    return np.asarray(reader(at, same))


EGO = EgoState(30.0, 40.0, math.radians(90), 10.0, 1.5, 0.2, 0.05)
"""An ego that drives north and turns left."""


def test_headings_become_left_handed() -> None:
    east, north, south_west = 0.0, math.pi / 2, -3 * math.pi / 4
    assert (yaw_deg(east), yaw_deg(north)) == pytest.approx((0, -90))
    assert (compass_rad(east), compass_rad(north)) == pytest.approx((math.pi / 2, 0), abs=1e-9)
    for heading in (east, north, south_west):  # how agents read the compass
        ahead = carla_types.Rotation(yaw=yaw_deg(heading)).get_forward_vector()
        yaw = compass_rad(heading) - math.pi / 2
        assert (ahead.x, ahead.y) == pytest.approx((math.cos(yaw), math.sin(yaw)))
        assert (ahead.x, ahead.y) == pytest.approx((math.cos(heading), -math.sin(heading)))


def test_places_become_latitude_and_longitude() -> None:
    latitude, longitude = GeoReference().gps(1000.0, 500.0)
    # the scale that agents divide by: the length of a degree on CARLA's sphere
    assert (latitude * 111319.490793, longitude * 111319.490793) == pytest.approx((500, 1000), abs=1e-4)
    north, east = GeoReference(49.0, 8.0).gps(1000.0, 500.0)
    # the same place 500 m north and 1000 m east, where a degree of longitude is shorter
    assert (north - 49) * 111319.490793 == pytest.approx(500, abs=0.5)
    assert (east - 8) * 111319.490793 * math.cos(math.radians(49)) == pytest.approx(1000, abs=0.5)


def test_steering_to_the_right_is_positive_in_carla() -> None:
    assert wheel_angle_rad(0.3, 2.83) < 0 < wheel_angle_rad(-0.3, 2.83)
    bundle = compile_test_case(load_test_case(CASE))
    vehicle = Episode(bundle).vehicle
    right = control_of(carla_types.VehicleControl(throttle=0.5, steer=0.2), vehicle)
    assert right.steer < 0 and (right.throttle, right.brake) == (0.5, 0.0)
    assert control_of(carla_types.VehicleControl(hand_brake=True), vehicle).brake == 1.0
    for answer, message in (
        (None, "returns a carla.VehicleControl"),
        (carla_types.VehicleControl(steer=math.nan), "must be finite"),
        (carla_types.VehicleControl(throttle=0.1, reverse=True), "reverse gear"),
    ):
        with pytest.raises(DriverError, match=message):
            control_of(answer, vehicle)


def test_types_behave_as_those_of_carla() -> None:
    wheel = pytest.importorskip("carla", reason="the package carla is not installed")
    rng = np.random.default_rng(0)
    for _ in range(20):
        place, angles, point = rng.uniform(-50, 50, 3), rng.uniform(-80, 80, 3), rng.uniform(-9, 9, 3)
        theirs, ours = (
            types.Transform(
                types.Location(*place.tolist()),
                types.Rotation(**dict(zip(("pitch", "yaw", "roll"), angles.tolist(), strict=True))),
            )
            for types in (wheel, carla_types)
        )
        np.testing.assert_allclose(ours.get_matrix(), theirs.get_matrix(), atol=1e-4)
        np.testing.assert_allclose(ours.get_inverse_matrix(), theirs.get_inverse_matrix(), atol=1e-4)
        pairs = [
            (ours.transform(carla_types.Location(*point)), theirs.transform(wheel.Location(*point.tolist()))),
            *((getattr(ours, n)(), getattr(theirs, n)()) for n in ("get_forward_vector", "get_right_vector")),
            (
                ours.location + carla_types.Location(*point) * 2.0,
                theirs.location + wheel.Location(*point.tolist()) * 2.0,
            ),
        ]
        for mine, other in pairs:
            assert (mine.x, mine.y, mine.z) == pytest.approx((other.x, other.y, other.z), abs=1e-3)


def test_gnss_imu_and_speedometer() -> None:
    mounted = {"type": "sensor.other.gnss", "id": "GPS", "x": 2.0, "y": 1.0, "z": 1.6}
    latitude, longitude, height = read(mounted, scene(EGO))
    # 2 m ahead is north, 1 m to the right is east
    assert (longitude * 111319.49, latitude * 111319.49, height) == pytest.approx((31, 42, 1.6), abs=1e-3)
    imu = read({"type": "sensor.other.imu", "id": "IMU"}, scene(EGO))
    assert imu == pytest.approx([1.5, -2.0, 9.81, 0, 0, -0.2, 0], abs=1e-9)
    sideways = read({"type": "sensor.other.imu", "id": "IMU", "yaw": 90.0}, scene(EGO))
    assert sideways[[0, 1, 6]] == pytest.approx([-2.0, -1.5, math.pi / 2], abs=1e-9)
    speed = read({"type": "sensor.speedometer", "id": "SPEED"}, scene(EGO)).item()
    assert speed == {"speed": 10.0}


def test_the_lidar_sees_the_near_sides_of_boxes_and_not_what_they_hide() -> None:
    ahead_left = SeenActor(1, "truck", 27.0, 60.0, math.radians(90), 0.0, 4.0, 2.0)  # 20 m ahead, 3 m to the left
    hidden = SeenActor(2, "car", 26.4, 64.0, math.radians(90), 0.0, 2.0, 1.0)
    spec = {"type": "sensor.lidar.ray_cast", "id": "LIDAR", "z": 1.8}
    points = read(spec, scene(EGO, ahead_left, hidden))
    assert points.dtype == np.float32 and points.shape[1] == 4 and len(points) > 50
    assert points[:, 0].min() == pytest.approx(18, abs=0.01) and points[:, 0].max() < 22.01
    assert points[:, 1].min() > -4.01 and points[:, 1].max() < -1.99, "left is negative"
    assert points[:, 2].min() > -1.8 and points[:, 2].max() < HEIGHTS_M["truck"] - 1.8
    assert np.array_equal(points, read(spec, scene(EGO, ahead_left))), "the car is behind the truck"
    turned = read({**spec, "yaw": -90.0}, scene(EGO, ahead_left))  # the sensor looks to the left
    assert turned[:, 1].min() > 17.9, "what is ahead is to its right"
    assert len(read(spec, scene(EGO))) == 0


def test_a_camera_has_the_colours_of_the_view_ahead() -> None:
    episode = Episode(compile_test_case(load_test_case(CASE)))
    views = episode.observation.views
    image = picture(views, 160, 64, 90.0, 0.0)
    assert image.shape == (64, 160, 4) and image.dtype == np.uint8 and (image[..., 3] == 255).all()
    below = image[60, 70:90, :3]
    assert {tuple(pixel) for pixel in below.tolist()} <= {COLOURS_BGR[0], COLOURS_BGR[1]}, "road"
    right = picture(views, 100, 80, 60.0, 15.0)[40, :, :3]
    centre = np.flatnonzero((image[32:33, :, :3] == right[50]).all(axis=-1))
    assert right.any() and len(centre), "the colours are those of the view"
    assert not picture(views, 100, 80, 60.0, 180.0)[..., :3].any(), "the view does not show what is behind"


def test_the_route_has_the_options_of_its_turns() -> None:
    episode = Episode(compile_test_case(load_test_case(TURN)))
    mission, vehicle = episode.mission, episode.vehicle
    gps, world = plan_of(mission, vehicle, carla_types, agent_base.RoadOption, GeoReference())
    options = [option for _, option in world]
    first = mission.junctions[0]
    assert first.turn == "right" and options.count(agent_base.RoadOption.RIGHT) == pytest.approx(
        first.exit_s - first.stop_s, abs=1.01
    )
    start, end = world[0][0], world[-1][0]
    ego = episode.observation.ego
    assert math.dist((start.location.x, -start.location.y), (ego.x, ego.y)) < 1
    assert math.remainder(start.rotation.yaw + math.degrees(ego.heading_rad), 360) == pytest.approx(0, abs=3)
    assert (end.location.x, -end.location.y) == pytest.approx(mission.centreline[-1], abs=1.1)
    assert all(option is place for (_, option), (_, place) in zip(gps, world, strict=True))
    assert gps[0][0]["lat"] * 111319.49 == pytest.approx(-start.location.y, abs=1e-3)
    kept = agent_base.downsample_route(world, 50.0)
    assert kept[0] == 0 and kept[-1] == len(world) - 1 and len(kept) < len(world) / 8
    assert options.index(agent_base.RoadOption.RIGHT) in kept


def test_an_agent_drives_and_repeats_itself_in_another_process(tmp_path: Path) -> None:
    address = f"carla:{written(tmp_path, FOLLOWER, 'carla_follower')}::8"
    consent.allow(address)
    here = run_test_case(load_test_case(CASE), driver=address, seed=0)
    assert here.verdict.value == "pass", here.reason
    command = [sys.executable, "-m", "foresee_dsl", "run", CASE, "--driver", address, "--json"]
    environment = os.environ | {"PYTHONHASHSEED": "5"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert here.trace.digest in done.stdout, done.stdout + done.stderr
    assert json.loads(done.stdout)


def test_an_agent_of_leaderboard_1_is_set_up_by_its_constructor(tmp_path: Path) -> None:
    agent = """
        from leaderboard.autoagents.autonomous_agent import AutonomousAgent
        class Old(AutonomousAgent):
            def __init__(self, path_to_conf_file):
                super().__init__(path_to_conf_file)
            def setup(self, path_to_conf_file):
                self.configuration = path_to_conf_file
    """
    file = written(tmp_path, "\n".join(line[8:] for line in agent.splitlines()), "carla_old")
    driver = AgentDriver.from_argument(f"{file}:Old:fast")
    episode = Episode(compile_test_case(load_test_case(TURN)))
    driver.reset(episode.mission, episode.vehicle, 0)
    plan = driver._agent._global_plan_world_coord
    steps = [a[0].location.distance(b[0].location) for a, b in itertools.pairwise(plan)]
    assert driver._agent.configuration == "fast" and max(steps) < 53, "leaderboard 1.0 passes a point every 50 m"


@pytest.mark.parametrize(
    ("name", "lines", "message"),
    [
        ("hero", "CarlaDataProvider.get_hero_actor()", r"CarlaDataProvider.get_hero_actor, which needs CARLA's server"),
        ("client", "carla.Client('localhost', 2000)", r"carla.Client, which needs CARLA's server"),
        ("basic", "BasicAgent(None)", r"BasicAgent, which needs CARLA's server"),
    ],
)
def test_what_needs_carlas_world_says_so(tmp_path: Path, name: str, lines: str, message: str) -> None:
    text = f"""
import carla
from agents.navigation.basic_agent import BasicAgent
from leaderboard.autoagents.autonomous_agent import AutonomousAgent
from srunner.scenariomanager.carla_data_provider import CarlaDataProvider

class Agent(AutonomousAgent):
    vehicle: carla.Vehicle | None = None
    def run_step(self, input_data, timestamp):
        {lines}
"""
    driver = AgentDriver.from_argument(f"{written(tmp_path, text, f'carla_{name}')}:Agent")
    episode = Episode(compile_test_case(load_test_case(CASE)))
    driver.reset(episode.mission, episode.vehicle, 0)
    with pytest.raises(NeedsWorldError, match=message):
        driver.step(episode.observation)
    driver.close()


def test_sensors_that_a_run_does_not_have_are_refused() -> None:
    for spec, message in (
        ({"type": "sensor.other.radar", "id": "RADAR"}, "asks for sensor.other.radar, which a run does not have"),
        ({"type": "sensor.camera.rgb", "id": "BEV", "pitch": -90.0}, "'BEV' of the agent is tilted"),
        ({"type": "sensor.camera.rgb"}, "needs a `type` and an `id`"),
    ):
        with pytest.raises(DriverError, match=message):
            readers([spec])
    with pytest.raises(DriverError, match="this run has no map"):
        read({"type": "sensor.opendrive_map", "id": "MAP"}, scene(EGO))
    no_pictures = {"type": "sensor.camera.rgb", "id": "C", "width": 8, "height": 8, "fov": 90}
    with pytest.raises(DriverError, match="cameras need the pictures of foresee-learned"):
        read(no_pictures, scene(EGO))


def test_what_is_no_agent_is_refused_with_a_reason(tmp_path: Path) -> None:
    base = "from leaderboard.autoagents.autonomous_agent import AutonomousAgent as Base\n"
    ros = f"{base}class Ros(Base):\n    @staticmethod\n    def get_ros_version():\n        return 2\n"
    for argument, message in (
        (f"{tmp_path / 'gone.py'}", "No such file"),
        ("my_agent", "names no agent; write carla:FILE.py"),
        (str(written(tmp_path, "x = 1\n", "carla_empty")), "it has no get_entry_point"),
        (f"{written(tmp_path, 'import nowhere_at_all', 'carla_broken')}:A", "nowhere_at_all"),
        (f"{written(tmp_path, 'A = 3', 'carla_number')}:A", "is not an agent"),
        (f"{written(tmp_path, ros, 'carla_ros')}:Ros", "drives through ROS"),
        (f"{written(tmp_path, 'A = 3', 'json')}:A", "a module called json is in use already"),
    ):
        with pytest.raises(DriverError, match=message):
            AgentDriver.from_argument(argument)


def test_an_agent_that_a_file_names_is_not_started_unasked(tmp_path: Path) -> None:
    with pytest.raises(DriverError, match="is a program, which starts only with your consent"):
        load_driver(f"carla:{written(tmp_path, FOLLOWER, 'carla_unasked')}")


def test_game_time_is_simulated_time(tmp_path: Path) -> None:
    text = """
from leaderboard.autoagents.autonomous_agent import AutonomousAgent
from srunner.scenariomanager.timer import GameTime
import carla

class Clock(AutonomousAgent):
    seen = []
    def run_step(self, input_data, timestamp):
        self.seen.append((GameTime.get_time(), GameTime.get_frame(), timestamp))
        return carla.VehicleControl(brake=1.0)
"""
    driver = AgentDriver.from_argument(f"{written(tmp_path, text, 'carla_clock')}:Clock")
    episode = Episode(compile_test_case(load_test_case(CASE)))
    driver.reset(episode.mission, episode.vehicle, 0)
    for _ in range(3):
        episode.step(driver.step(episode.observation))
    assert driver._agent.seen == [(0.0, 1, 0.0), (0.05, 2, 0.05), (0.1, 3, 0.1)]


def test_a_map_gets_numbers_units_and_a_reference() -> None:
    text = """<OpenDRIVE><header date="today" revMajor="1"/>
      <road id="7" junction="-1"><link><successor elementType="junction" elementId="mill_oak"/></link>
        <lanes><laneSection><right><lane id="-1"><speed sOffset="0" max="13.9"/></lane></right></laneSection></lanes>
        <signals><signal id="mill_oak_0"/></signals></road>
      <road id="8" junction="mill_oak"/><controller id="c1"><control signalId="mill_oak_0"/></controller>
      <junction id="mill_oak"><controller id="c1"/></junction></OpenDRIVE>"""
    converted, reference = for_carla(text)
    assert reference == GeoReference(0.0, 0.0) and "today" not in converted and 'unit="m/s"' in converted
    assert "+lat_0=0 +lon_0=0" in converted and "mill_oak" not in converted and '"c1"' not in converted
    root = importlib.import_module("defusedxml.ElementTree").fromstring(converted)
    junction = root.find("junction").get("id")
    assert int(junction) > 0 and root.find(".//successor").get("elementId") == junction
    assert [road.get("junction") for road in root.findall("road")] == ["-1", junction]
    assert root.find(".//control").get("signalId") == root.find(".//signal").get("id")
    placed = text.replace("/>", "><geoReference>+proj=tmerc +lat_0=49.5 +lon_0=8</geoReference></header>", 1)
    assert for_carla(placed)[1] == GeoReference(49.5, 8.0)


def test_the_namespace_of_the_agents_timestamp_needs_no_carla() -> None:
    timer = importlib.import_module("foresee_bridges.carla.api.srunner.scenariomanager.timer").GameTime
    timer.on_carla_tick(SimpleNamespace(frame=4, elapsed_seconds=0.15))
    assert (timer.get_time(), timer.get_frame()) == (0.15, 4)
    assert timer.get_wallclocktime().timestamp() == pytest.approx(0.15)
    timer.restart()
    assert timer.get_time() == 0.0
