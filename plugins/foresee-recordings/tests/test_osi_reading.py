"""ASAM OSI: ground truths and sensor views in binary traces and MCAP, omega-prime's map, and damaged files."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from pathlib import Path

import pytest

pytest.importorskip("osi3", reason="the extra `osi` is not installed")
pytest.importorskip("osi_utilities", reason="the extra `osi` is not installed")

from foresee_recordings.reading import Request, read
from foresee_recordings.recording import RecordingError, SignalTrack
from google.protobuf import descriptor_pb2
from mcap.writer import CompressionType, Writer
from osi3.osi_groundtruth_pb2 import GroundTruth
from osi3.osi_object_pb2 import MovingObject, StationaryObject
from osi3.osi_sensorview_pb2 import SensorView
from osi3.osi_trafficlight_pb2 import TrafficLight

MAP = "<?xml version='1.0'?><OpenDRIVE/>"


def ground_truth(time_s: float) -> GroundTruth:
    """Return a message: a car that turns, a walker, a cone and a house, and a signal of two bulbs."""
    message = GroundTruth()
    message.timestamp.seconds, message.timestamp.nanos = divmod(round(time_s * 1e9), 10**9)
    message.host_vehicle_id.value = 7
    car = message.moving_object.add(type=MovingObject.TYPE_VEHICLE)
    car.vehicle_classification.type = MovingObject.VehicleClassification.TYPE_DELIVERY_VAN
    fill(car, 7, (10 * time_s, 2.0), (5.5, 2.0), yaw=0.1)
    car.base.velocity.x, car.base.velocity.y = 10.0, 1.0
    walker = message.moving_object.add(type=MovingObject.TYPE_PEDESTRIAN)
    fill(walker, 8, (5.0, -3.0 + time_s), (0.0, 0.0))
    fill(message.moving_object.add(type=MovingObject.TYPE_ANIMAL), 9, (0, 0), (1, 1))
    for id_, kind in ((20, "PYLON"), (21, "BUILDING")):
        thing = message.stationary_object.add()
        thing.classification.type = getattr(StationaryObject.Classification, f"TYPE_{kind}")
        fill(thing, id_, (30.0, 0.0), (0.4, 0.4), yaw=0.0)
    lane = message.lane.add()
    lane.id.value = 50
    lane.classification.centerline_is_driving_direction = True
    for x in (0.0, 40.0):
        lane.classification.centerline.add(x=x, y=2.0)
    for id_, colour, lit in ((30, "RED", time_s < 0.2), (31, "GREEN", time_s >= 0.2)):
        bulb = message.traffic_light.add()
        fill(bulb, id_, (45.0, 6.0), (0.2, 0.2))
        bulb.classification.color = getattr(TrafficLight.Classification, f"COLOR_{colour}")
        bulb.classification.mode = getattr(TrafficLight.Classification, "MODE_CONSTANT" if lit else "MODE_OFF")
        bulb.classification.assigned_lane_id.add().value = 50
    return message


def fill(thing, id_: int, place: tuple[float, float], size: tuple[float, float], yaw: float | None = None) -> None:
    thing.id.value = id_
    thing.base.position.x, thing.base.position.y = place
    thing.base.dimension.length, thing.base.dimension.width = size
    if yaw is not None:
        thing.base.orientation.yaw = yaw


def binary(messages: Sequence) -> bytes:
    data = [message.SerializeToString() for message in messages]
    return b"".join(struct.pack("<I", len(part)) + part for part in data)


TIMES = [k / 10 for k in range(5)]
MESSAGES = [ground_truth(time_s) for time_s in TIMES]


def views() -> list[SensorView]:
    return [SensorView(global_ground_truth=message) for message in MESSAGES]


def mcap(
    file: Path, messages: Sequence, *, opendrive: str = "", compression: CompressionType = CompressionType.ZSTD
) -> Path:
    with file.open("wb") as out:
        writer = Writer(out, compression=compression)
        writer.start()
        kind = type(messages[0]).DESCRIPTOR
        schema = writer.register_schema(kind.full_name, "protobuf", b"")
        channel = writer.register_channel("/ground_truth", "protobuf", schema)
        for k, message in enumerate(messages):
            writer.add_message(channel, k * 10**8, message.SerializeToString(), k * 10**8)
        if opendrive:
            roads = writer.register_schema("osi3.MapAsamOpenDrive", "protobuf", b"")
            channel = writer.register_channel("/ground_truth_map", "protobuf", roads)
            # fields 1 and 2 of any message with two texts have these bytes
            both = descriptor_pb2.FileDescriptorProto(name="a.xodr", package=opendrive).SerializeToString()
            writer.add_message(channel, 0, both, 0)
        other = writer.register_schema("other.Thing", "protobuf", b"")
        writer.add_message(writer.register_channel("/other", "protobuf", other), 0, b"x", 0)
        writer.finish()
    return file


@pytest.fixture
def trace(tmp_path: Path) -> Path:
    file = tmp_path / "run.osi"
    file.write_bytes(binary(MESSAGES))
    return file


def test_objects_and_signals_of_a_ground_truth(trace: Path) -> None:
    recording = read(Request(trace))
    van, walker, cone = recording.tracks
    assert (van.id, van.kind, van.length_m, van.width_m, van.sized) == ("7", "van", 5.5, 2.0, True)
    assert van.time_s == pytest.approx(TIMES)
    assert van.states[2] == pytest.approx([2.0, 2.0, 0.1, math.hypot(10, 1)])
    assert (walker.kind, walker.sized, walker.states[1, 2]) == ("pedestrian", False, pytest.approx(math.pi / 2))
    assert (cone.kind, cone.length_m) == ("obstacle", pytest.approx(0.4))
    assert recording.signals == (SignalTrack("30", (0.0, 0.2), ("red", "green"), (40.0, 2.0)),)
    assert recording.left_out == {
        "samples of moving objects that are not road traffic": 5,
        "samples of stationary objects beside the road": 5,
    }
    assert recording.notes == (
        "The host vehicle is 7.",
        "1 object has no possible size: that which is usual for the class is used.",
        "1 actor has no headings: those of their motion are used.",
        "1 actor has no speeds: those of their positions are used.",
    )


@pytest.mark.parametrize("compression", list(CompressionType))
def test_mcap_with_a_map_is_read_as_the_binary_trace(trace: Path, tmp_path: Path, compression: CompressionType) -> None:
    packed = read(Request(mcap(tmp_path / "run.mcap", MESSAGES, opendrive=MAP, compression=compression)))
    plain = read(Request(trace))
    for track, other in zip(packed.tracks, plain.tracks, strict=True):
        assert track.id == other.id and (track.states == other.states).all()
    assert plain.roads is None and packed.roads is not None
    assert (packed.roads.text, packed.roads.suffix) == (MAP, ".xodr")
    assert packed.left_out["messages of other channels"] == 1


def test_sensor_views_are_told_from_ground_truths_by_their_content(trace: Path, tmp_path: Path) -> None:
    expected = read(Request(trace)).tracks
    file = tmp_path / "views.osi"
    file.write_bytes(binary(views()))
    for path in (file, mcap(tmp_path / "views.mcap", views())):
        tracks = read(Request(path)).tracks
        assert [(track.id, track.kind) for track in tracks] == [(track.id, track.kind) for track in expected]


def test_a_map_beside_the_trace_is_the_one_that_its_messages_name(trace: Path) -> None:
    for message in (named := [GroundTruth.FromString(message.SerializeToString()) for message in MESSAGES]):
        message.map_reference = "C:\\maps\\town.xodr"
    trace.write_bytes(binary(named))
    assert read(Request(trace)).roads is None
    trace.with_name("town.xodr").write_text(MAP)
    roads = read(Request(trace)).roads
    assert roads is not None and roads.text == MAP
    trace.with_name("other.xodr").write_text("<OpenDRIVE>2</OpenDRIVE>")
    roads = read(Request(trace, map_file=trace.with_name("other.xodr"))).roads
    assert roads is not None and "2" in roads.text


def test_a_window_and_actors(trace: Path) -> None:
    recording = read(Request(trace, begins_s=0.1, ends_s=0.3, actors=frozenset({"7"})))
    (van,) = recording.tracks
    assert van.time_s == pytest.approx([0.1, 0.2, 0.3]) and recording.signals[0].time_s == (0.1, 0.2)


def test_a_message_that_is_cut_off_is_counted_and_damage_is_an_error(trace: Path) -> None:
    data = trace.read_bytes()
    trace.write_bytes(data[:-3])
    recording = read(Request(trace))
    assert recording.left_out["messages that are cut off at the end of the file"] == 1
    assert len(recording.tracks[0].time_s) == 4
    for damaged, message in (
        (b"\xff\xff\xff\xff" + data, r"message 1 claims to have 4,295 MB.*--limit file="),
        (struct.pack("<I", 5) + b"\xff" * 5, "message 1 is not a message of OSI"),
        (b"", "it has no message GroundTruth or SensorView"),
        (binary([GroundTruth()]), "it has no samples"),
    ):
        trace.write_bytes(damaged)
        with pytest.raises(RecordingError, match=message):
            read(Request(trace))


def test_damaged_and_hostile_mcap_files_are_errors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = mcap(tmp_path / "run.mcap", MESSAGES).read_bytes()
    file = tmp_path / "damaged.mcap"
    for data in (whole[:60], whole[:8] + b"\x06" + struct.pack("<Q", 2**60) + whole[8:], whole[:8] + b"\x01" * 40):
        file.write_bytes(data)
        with pytest.raises(RecordingError, match=r"is not an MCAP file, or a damaged one|it has no message"):
            read(Request(file))
    monkeypatch.setenv("FORESEE_LIMITS", "file=0.5")
    for compression in (CompressionType.LZ4, CompressionType.ZSTD):
        large = [*MESSAGES, GroundTruth(map_reference="x" * 10**6)]
        bomb = mcap(tmp_path / "bomb.mcap", large, compression=compression)
        assert bomb.stat().st_size < 100_000
        with pytest.raises(RecordingError, match=r"a chunk has more than 0.5 MB when it is unpacked"):
            read(Request(bomb))


def test_signals_and_lanes_count_for_the_limit(trace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for message in (large := [GroundTruth.FromString(message.SerializeToString()) for message in MESSAGES]):
        for k in range(300):
            lane = message.lane.add()
            lane.id.value = 1000 + k
            lane.classification.centerline.add(x=k, y=0)
    trace.write_bytes(binary(large))
    monkeypatch.setenv("FORESEE_LIMITS", "recording=2000")
    with pytest.raises(RecordingError, match=r"more than 2,000 samples"):
        read(Request(trace))
    monkeypatch.setenv("FORESEE_LIMITS", "recording=4000")
    assert len(read(Request(trace)).signals) == 1
