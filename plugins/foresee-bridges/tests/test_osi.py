"""Runs as ASAM OSI traces, read back by the readers of osi-python and asam-osi-utilities."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("osi3", reason="the extra `osi` is not installed")
pytest.importorskip("osi_utilities", reason="the extra `osi` is not installed")

from foresee_bridges.osi import exporter
from foresee_bridges.osi.formats import OsiOptions
from osi3.osi_object_pb2 import MovingObject, StationaryObject
from osi3.osi_trafficlight_pb2 import TrafficLight
from osi3trace.osi_trace import OSITrace
from osi_utilities import MultiTraceReader, parse_osi_trace_filename

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.registry import load_driver
from foresee_dsl.exchange.network_parts import shifted
from foresee_dsl.files import data_folder
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.episode import Episode
from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y

SCENARIOS = data_folder("scenarios")
CASE = f"{SCENARIOS / 'scenario7.foresee'}::r01"


@pytest.fixture(scope="module")
def trace() -> Trace:
    return run_test_case(load_test_case(CASE), driver="pdm", seed=0).trace


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("osi")


@pytest.fixture(scope="module")
def ground_truths(folder: Path) -> list:
    report = exporter.run([CASE], out=folder)
    assert report.left_out["expectations"] == 2
    return read(report.files[0], "GroundTruth")


def read(file: Path, message: str) -> list:
    """Read a trace with osi-python's reader."""
    trace = OSITrace(str(file), message)
    try:
        return list(trace)
    finally:
        trace.close()


def named(message) -> tuple[str, ...]:
    """Return our name of a thing in a message."""
    return tuple(message.source_reference[0].identifier)


def test_states_are_those_of_the_trace(ground_truths: list, trace: Trace) -> None:
    assert len(ground_truths) == trace.frames
    specs = {actor.id: actor.model for actor in compile_test_case(load_test_case(CASE)).scene.actors}
    for frame, message in enumerate(ground_truths):
        assert message.timestamp.seconds + message.timestamp.nanos / 1e9 == pytest.approx(trace.time_s[frame])
        assert (message.version.version_major, message.host_vehicle_id.value) == (3, 1)
        objects = {named(thing)[1]: thing for thing in message.moving_object}
        present = [k for k in range(len(trace.actors)) if not math.isnan(trace.states[frame, k, X])]
        assert set(objects) == {trace.actors[k].id for k in present}
        for k in present:
            info, row = trace.actors[k], trace.states[frame, k]
            base, spec = objects[info.id].base, specs[info.id]
            assert math.hypot(base.position.x - row[X], base.position.y - row[Y]) < 1e-3
            assert abs(math.remainder(base.orientation.yaw - row[HEADING], math.tau)) < 1e-6
            assert (base.dimension.length, base.dimension.width) == (info.length_m, info.width_m)
            assert (base.dimension.height, base.position.z) == (spec.height_m, spec.height_m / 2)
    ego = next(thing for thing in ground_truths[0].moving_object if thing.id.value == 1)
    assert named(ego) == ("actor", "ego") and ego.type == MovingObject.TYPE_VEHICLE
    kinds = MovingObject.VehicleClassification
    assert ego.vehicle_classification.type == kinds.TYPE_CAR and ego.vehicle_attributes.number_wheels == 4
    types = {thing.type for thing in ground_truths[0].moving_object if "walker" in named(thing)[1]}
    assert types == {MovingObject.TYPE_PEDESTRIAN}


def test_velocities_are_those_of_the_centres(trace: Trace, folder: Path) -> None:
    """The way from frame to frame is the mean velocity; the ego turns left in this case."""
    case = f"{SCENARIOS / 'scenario7' / 'while_turning.foresee'}::parcel_van_on_king_street"
    report = exporter.run([case], out=folder, what="traffic-update")
    messages = read(report.files[0], "TrafficUpdate")
    updates = [message.update[0] for message in messages]
    assert {named(update) for update in updates} == {("actor", "ego")}
    places = np.array([(u.base.position.x, u.base.position.y) for u in updates])
    velocities = np.array([(u.base.velocity.x, u.base.velocity.y) for u in updates])
    rates = np.array([u.base.orientation_rate.yaw for u in updates])
    accelerations = np.array([(u.base.acceleration.x, u.base.acceleration.y) for u in updates])
    assert rates.max() > 0.2
    between = (velocities[1:] + velocities[:-1]) / 2
    assert np.abs(np.diff(places, axis=0) / 0.05 - between).max() < 0.1
    means = (accelerations[1:] + accelerations[:-1]) / 2
    assert np.median(np.linalg.norm(np.diff(velocities, axis=0) / 0.05 - means, axis=1)) < 0.3
    state = messages[0].internal_state[0]
    assert state.host_vehicle_id.value == 1 and state.vehicle_motion.velocity.x > 0


def centre(lane) -> np.ndarray:
    return np.array([(point.x, point.y) for point in lane.classification.centerline])


def test_lanes_join_and_have_boundaries_at_half_their_width(ground_truths: list) -> None:
    network = compile_test_case(load_test_case(CASE)).network
    first = ground_truths[0]
    lanes = {lane.id.value: lane for lane in first.lane}
    boundaries = {boundary.id.value: boundary for boundary in first.lane_boundary}
    assert {named(lane)[1] for lane in first.lane} == set(network.lanes) and not ground_truths[1].lane
    joined = 0
    for lane in first.lane:
        line, width = centre(lane), network.lanes[named(lane)[1]].width_m
        for pair in lane.classification.lane_pairing:
            for field, mine, theirs in (("antecessor_lane_id", 0, -1), ("successor_lane_id", -1, 0)):
                if pair.HasField(field):
                    other = centre(lanes[getattr(pair, field).value])
                    assert np.linalg.norm(other[theirs] - line[mine]) < 0.05
                    joined += 1
        for ids, side in (
            (lane.classification.left_lane_boundary_id, 1),
            (lane.classification.right_lane_boundary_id, -1),
        ):
            (number,) = ids
            points = boundaries[number.value].boundary_line
            offset = np.array([points[0].position.x, points[0].position.y]) - line[0]
            ahead = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
            assert ahead[0] * offset[1] - ahead[1] * offset[0] == pytest.approx(side * width / 2, abs=0.06)
        for left in lane.classification.left_adjacent_lane_id:
            rights = [number.value for number in lanes[left.value].classification.right_adjacent_lane_id]
            assert rights == [lane.id.value]
    assert joined > 300 and len(first.stationary_object) == len(network.buildings)
    assert not first.proj_string


def test_the_egos_lane_is_where_it_is(ground_truths: list, trace: Trace) -> None:
    lanes = {lane.id.value: lane for lane in ground_truths[0].lane}
    for frame in range(0, trace.frames, 20):
        ego = next(thing for thing in ground_truths[frame].moving_object if thing.id.value == 1)
        (number,) = ego.moving_object_classification.assigned_lane_id
        line = centre(lanes[number.value])
        front = np.array([ego.base.position.x, ego.base.position.y])
        steps = np.linspace(0, 1, 200)[:, None]
        dense = np.concatenate([a + steps * (b - a) for a, b in pairwise(line)])
        assert np.linalg.norm(dense - front, axis=1).min() < 2.5


def test_traffic_lights_show_what_the_driver_sees(tmp_path: Path) -> None:
    bundle = compile_test_case(load_test_case(CASE))
    driver, episode = load_driver("pdm"), Episode(bundle, seed=0)
    driver.reset(episode.mission, episode.vehicle, 0)
    seen: list[dict[str, str]] = []
    while episode.result is None:
        seen.append(dict(episode.observation.signals))
        episode.step(driver.step(episode.observation))
    frames = exporter.Frames(bundle, episode.result.trace)
    compared = 0
    kinds = TrafficLight.Classification
    bulbs = {kinds.COLOR_RED: "red", kinds.COLOR_YELLOW: "amber", kinds.COLOR_GREEN: "green"}
    for frame, signals in enumerate(seen):
        message = frames.ground_truth(frame)
        for key, colour in signals.items():
            tls, link = key.rsplit(":", 1)
            lane = next(m.from_lane for m in bundle.network.movements if (m.tls, m.link) == (tls, int(link)))
            number = frames.numbers.of("lane", lane)
            lights = [
                light.classification
                for light in message.traffic_light
                if any(lane_id.value == number for lane_id in light.classification.assigned_lane_id)
            ]
            on = {bulbs[light.color] for light in lights if light.mode == kinds.MODE_CONSTANT}
            assert colour in on, (frame, key, colour, on)
            compared += 1
    assert compared > 50


def test_an_mcap_of_sensor_views_has_what_osi_requires(folder: Path, trace: Trace) -> None:
    report = exporter.run([CASE], out=folder, what="sensor-view", file_format="mcap")
    again = exporter.run([CASE], out=folder / "again", what="sensor-view", file_format="mcap")
    assert report.files[0].read_bytes() == again.files[0].read_bytes()
    reader = MultiTraceReader()
    assert reader.open(report.files[0])
    facts = next(entry["data"] for entry in reader.get_file_metadata() if entry["name"] == "net.asam.osi.trace")
    assert {"version", "min_osi_version", "creation_time"} <= set(facts) and facts["version"].startswith("3.8")
    views = [result.message for result in reader]
    reader.close()
    assert len(views) == trace.frames
    row = trace.states[100, 0]
    motion = views[100].host_vehicle_data.vehicle_motion
    assert motion.velocity.x == pytest.approx(row[SPEED])
    place = views[100].host_vehicle_data.vehicle_localization.position
    assert (place.x, place.y) == pytest.approx((row[X], row[Y]), abs=1e-3)
    model = compile_test_case(load_test_case(CASE)).scene.ego.model
    back_m = model.length_m / 2 - model.rear_overhang_m
    assert math.hypot(motion.position.x - place.x, motion.position.y - place.y) == pytest.approx(back_m)
    assert len(views[0].global_ground_truth.lane) > 100 and not views[1].global_ground_truth.lane


def test_obstacles_stand_and_parked_vehicles_are_vehicles() -> None:
    """OSI counts parked vehicles as moving objects."""
    bundle = compile_test_case(load_test_case(f"{SCENARIOS / 'scenario4' / 'roadworks.foresee'}::by_the_dock_in_fog"))
    trace = run_test_case(
        load_test_case(f"{SCENARIOS / 'scenario4' / 'roadworks.foresee'}::by_the_dock_in_fog"), "pdm", 0
    ).trace
    message = exporter.Frames(bundle, trace).ground_truth(0)
    obstacles = {actor.id: actor for actor in bundle.scene.actors if actor.model.kind == "obstacle"}
    standing = {named(thing)[1]: thing for thing in message.stationary_object if thing.source_reference}
    assert standing and set(standing) == {name for name, actor in obstacles.items() if "parked" not in actor.model.name}
    kinds = StationaryObject.Classification
    for name, thing in standing.items():
        is_barrier = obstacles[name].model.name == "obstacle.barrier"
        assert thing.classification.type == (kinds.TYPE_BARRIER if is_barrier else kinds.TYPE_OTHER)
        assert (thing.base.position.x, thing.base.position.y) == pytest.approx((obstacles[name].x, obstacles[name].y))
    parked = [thing for thing in message.moving_object if thing.model_reference.startswith("obstacle.parked_")]
    assert all(thing.type == MovingObject.TYPE_VEHICLE for thing in parked)


def test_a_corner_is_mitred() -> None:
    left = shifted(((0.0, 0.0), (10.0, 0.0), (10.0, 10.0)), 1.0)
    assert np.allclose(left, [[0.0, 1.0], [9.0, 1.0], [9.0, 10.0]])


def test_wrong_options_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="--what everything does not exist; write one of ground-truth"):
        OsiOptions([CASE], tmp_path, what="everything")
    with pytest.raises(ValueError, match="--format txt does not exist"):
        OsiOptions([CASE], tmp_path, file_format="txt")


def test_names_follow_osis_convention(ground_truths: list, folder: Path) -> None:
    names = [parse_osi_trace_filename(file.name) for file in folder.glob("*.osi")]
    assert {name["number_of_frames"] for name in names} >= {len(ground_truths)}
    assert {name["custom_trace_name"] for name in names} >= {"red_light_runner_r01"}


def test_omega_prime_reads_a_recording_with_its_map(ground_truths: list, folder: Path, trace: Trace) -> None:
    omega_prime = pytest.importorskip(
        "omega_prime", reason="omega-prime brings polars, pandas and altair along; tested by hand"
    )
    recording = omega_prime.Recording.from_file(next(folder.glob("*_gt_*_red_light_runner_r01.osi")))
    assert len(ground_truths[0].lane) == len(recording.map.lanes) and recording.host_vehicle_idx == 1
    ego = recording.df.filter(recording.df["idx"] == 1).sort("total_nanos")
    places = np.stack([ego["x"].to_numpy(), ego["y"].to_numpy()], axis=1)
    assert np.abs(places - trace.states[:, 0, :2]).max() < 1e-3
    assert np.abs(np.remainder(ego["yaw"].to_numpy() - trace.states[:, 0, HEADING] + 1, math.tau) - 1).max() < 1e-6


def test_betterosi_reads_the_same(ground_truths: list, folder: Path, trace: Trace) -> None:
    betterosi = pytest.importorskip("betterosi", reason="a second implementation of OSI; tested by hand")
    file = next(folder.glob("*_gt_*_red_light_runner_r01.osi"))
    messages = list(betterosi.read(str(file), return_ground_truth=True))
    assert len(messages) == len(ground_truths)
    for frame in (0, 100, trace.frames - 1):
        ego = next(thing for thing in messages[frame].moving_object if thing.id.value == 1)
        assert (ego.base.position.x, ego.base.position.y) == pytest.approx(tuple(trace.states[frame, 0, :2]), abs=1e-3)
