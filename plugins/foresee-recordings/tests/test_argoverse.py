"""Argoverse 2 scenarios with their maps, and Parquet files of omega-prime."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

pytest.importorskip("pyarrow", reason="the extra `parquet` is not installed")
import pyarrow as pa
from foresee_recordings.maps.argoverse import lanes_of
from foresee_recordings.reading import Request, read
from foresee_recordings.recording import RecordingError
from pyarrow import parquet

from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.net_reader import read_network


def scenario(folder: Path, **changes: list) -> Path:
    """Write a scenario: a vehicle to the east, a walker, a thing of unknown size; return its file."""
    steps = [*range(10)] * 3
    columns = {
        "track_id": ["AV"] * 10 + ["17"] * 10 + ["18"] * 10,
        "object_type": ["vehicle"] * 10 + ["pedestrian"] * 10 + ["background"] * 10,
        "timestep": steps,
        "position_x": [1000.0 + k for k in steps],
        "position_y": [5.0] * 30,
        "heading": [0.0] * 10 + [math.pi] * 20,
        "velocity_x": [10.0] * 30,
        "velocity_y": [0.0] * 30,
    }
    columns.update(changes)
    file = folder / "scenario_ab-1.parquet"
    parquet.write_table(pa.table(columns), file)
    return file


def points(x0: float, x1: float, y: float) -> list[dict[str, float]]:
    return [{"x": x, "y": y, "z": 0.0} for x in (x0, x1)]


def segment(id_: int, x: tuple[float, float], y: float, **more: object) -> dict[str, object]:
    """Return a lane of 3.5 m whose right border is at y, to the east if x rises."""
    left = y + math.copysign(3.5, x[1] - x[0])
    return {
        "id": id_, "lane_type": "VEHICLE", "left_lane_boundary": points(*x, left), "right_lane_boundary": points(*x, y),
        "predecessors": [], "successors": [], "left_neighbor_id": None, "right_neighbor_id": None, **more,
    }  # fmt: skip


def write_map(folder: Path) -> Path:
    segments = [
        segment(1, (900, 1000), 0, successors=[2, 99], left_neighbor_id=4),
        segment(2, (1000, 1100), 0, predecessors=[1], left_neighbor_id=3),
        segment(3, (1000, 1100), 3.5, right_neighbor_id=2),
        segment(4, (1000, 900), 7, left_neighbor_id=1, lane_type="BUS"),
    ]
    file = folder / "log_map_archive_ab-1.json"
    crossing = {"7": {"id": 7}}
    file.write_text(json.dumps({"lane_segments": {s["id"]: s for s in segments}, "pedestrian_crossings": crossing}))
    return file


def test_a_scenario_with_its_map(tmp_path: Path) -> None:
    scenario(tmp_path)
    write_map(tmp_path)
    recording = read(Request(tmp_path))
    av, walker = recording.tracks
    assert (av.id, av.kind, av.sized, walker.kind) == ("AV", "car", False, "pedestrian")
    assert av.time_s == pytest.approx([k / 10 for k in range(10)])
    assert av.states[3] == pytest.approx([1003.0, 5.0, 0.0, 10.0])
    assert recording.left_out == {
        "samples of objects of the type background, whose size is not known": 10,
        "pedestrian crossings": 1,
    }
    assert recording.roads is not None and recording.roads.suffix == ".net.xml"
    file = tmp_path / "roads.net.xml"
    file.write_text(recording.roads.text)
    network = read_network(foreign_net(file))
    assert sum("car" in lane.kinds and not lane.internal for lane in network.lanes.values()) >= 3


def test_lanes_have_neighbours_of_their_direction_only(tmp_path: Path) -> None:
    lanes = lanes_of(write_map(tmp_path)).lanes
    assert {id_: (lane.left_neighbour, lane.right_neighbour, lane.type) for id_, lane in lanes.items()} == {
        "1": ("", "", "road"), "2": ("3", "", "road"), "3": ("", "2", "road"), "4": ("", "", "bus"),
    }  # fmt: skip
    assert lanes["1"].successors == ("2",) and lanes["1"].width_m == pytest.approx(3.5)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "is not a map of Argoverse 2"),
        ("[]", "is not a map of Argoverse 2"),
        ('{"lane_segments": {"1": {"id": 1}}}', "left_lane_boundary"),
        ("[" * 100_000, "is not a map of Argoverse 2"),
    ],
)
def test_a_damaged_map_is_an_error(tmp_path: Path, text: str, message: str) -> None:
    file = scenario(tmp_path)
    write_map(tmp_path).write_text(text)
    with pytest.raises(RecordingError, match=message):
        read(Request(file))


def test_damaged_scenarios_are_errors(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="the values of column position_x are string, not numbers"):
        read(Request(scenario(tmp_path, position_x=["1"] * 30)))
    file = scenario(tmp_path, heading=[None] * 30)
    assert "2 actors have no headings: those of their motion are used." in read(Request(file)).notes
    data = file.read_bytes()
    for damaged in (data[:40], data[:-50] + b"\x00" * 50):
        file.write_bytes(damaged)
        with pytest.raises(RecordingError, match="is not a Parquet file, or a damaged one"):
            read(Request(file), "argoverse")
    parquet.write_table(pa.table({"a": [1]}), file)
    with pytest.raises(RecordingError, match=r"has no column track_id, .*; its columns are a"):
        read(Request(file))
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match=r"has 0 files scenario_ID\.parquet"):
        read(Request(tmp_path / "empty"), "argoverse")


def test_parquet_files_of_omega_prime(tmp_path: Path) -> None:
    pytest.importorskip("osi3", reason="the extra `osi` is not installed")
    steps = [*range(5)] * 2
    numbers = {"y": 1.0, "yaw": 0.0, "vel_x": 10.0, "vel_y": 0.0, "length": 12.0, "width": 2.5}
    table = pa.table(
        {
            "total_nanos": [k * 100_000_000 for k in steps],
            "idx": [4] * 5 + [5] * 5,
            "type": [2] * 5 + [3] * 5,
            "subtype": [11] * 5 + [-1] * 5,
            "x": [float(k) for k in steps],
            **{name: [value] * 10 for name, value in numbers.items()},
        }
    )
    file = tmp_path / "recording.parquet"
    parquet.write_table(table.replace_schema_metadata({b"xodr": b"<OpenDRIVE/>", b"xodr_name": b"a"}), file)
    recording = read(Request(file))
    first, second = recording.tracks
    assert recording.format == "osi" and recording.roads is not None and recording.roads.text == "<OpenDRIVE/>"
    assert (first.id, first.kind, first.length_m, second.kind) == ("4", "bicycle", 12.0, "pedestrian")
    assert first.time_s == pytest.approx([0, 0.1, 0.2, 0.3, 0.4]) and first.states[2] == pytest.approx([2, 1, 0, 10])
