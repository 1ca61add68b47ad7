"""The INTERACTION data set with its lanelet2 maps, and maps without a recording."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from foresee_recordings.maps.lanelet2 import read_lanelet2
from foresee_recordings.maps.matching import route_of
from foresee_recordings.maps.roads_file import roads_of_file
from foresee_recordings.maps.utm import utm, zone_of
from foresee_recordings.reading import Request, read
from foresee_recordings.recording import RecordedMap, RecordingError

from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.roads.network import RoadNetwork

DATA = Path(__file__).parent / "files" / "interaction"
TRACKS = DATA / "recorded_trackfiles" / "place" / "vehicle_tracks_000.csv"
MAP = DATA / "maps" / "place.osm"
HEADER = "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,psi_rad,length,width\n"


def network(roads: RecordedMap, folder: Path) -> RoadNetwork:
    """Return the network as a scenario gets it, which includes that SUMO loads it."""
    file = folder / f"net{roads.suffix}"
    file.write_text(roads.text, encoding="utf-8")
    return read_network(foreign_net(file))


def test_vehicles_and_pedestrians_are_read_with_the_map_of_their_place() -> None:
    recording = read(Request(TRACKS))
    assert [(t.id, t.kind, t.length_m, t.width_m, t.sized) for t in recording.tracks] == [
        ("1", "car", 4.5, 1.8, True),
        ("2", "truck", 8.0, 2.5, True),
        ("P1", "pedestrian", 0.4, 0.55, False),
    ]
    state = recording.track("1").at(1.55)
    assert state is not None
    np.testing.assert_allclose(state, [1019.5, 1001.75, 0.0, 10.0], atol=1e-9)
    assert recording.notes == (
        "The data set does not tell pedestrians and cyclists apart: they are pedestrians.",
        "1 actor has no headings: those of their motion are used.",
    )
    assert recording.left_out == {}
    assert recording.roads is not None
    assert recording.roads.notes == (
        "left out of the map: 1 lanelets of the subtype walkway",
        "3 of 9 lanes have no speed limit: 50 km/h is assumed for them",
    )


def test_a_request_narrows_seconds_and_actors() -> None:
    recording = read(Request(TRACKS, begins_s=1.2, ends_s=2.0, actors=frozenset({"2"})))
    assert [track.id for track in recording.tracks] == ["2"]
    assert recording.track("2").time_s[[0, -1]].tolist() == [1.2, 2.0]


def test_a_folder_has_one_recording_or_the_number_of_one(tmp_path: Path) -> None:
    assert read(Request(TRACKS.parent)).source == TRACKS
    for name in ("vehicle_tracks_000.csv", "vehicle_tracks_007.csv"):
        shutil.copy(TRACKS, tmp_path / name)
    assert read(Request(tmp_path, numbers={"recording": 7})).source.name == "vehicle_tracks_007.csv"
    with pytest.raises(RecordingError, match=r"name one of its tables .*vehicle_tracks_000.csv, vehicle_tracks_007"):
        read(Request(tmp_path), "interaction")


def test_a_table_of_cases_needs_the_number_of_one(tmp_path: Path) -> None:
    file = tmp_path / "cases.csv"
    rows = [f"{case}.0,1.0,{k},{k}00,car,{k + 10 * case},0,10,0,0,4,2" for case in (1, 2) for k in range(1, 6)]
    file.write_text("case_id," + HEADER + "\n".join(rows) + "\n", encoding="utf-8")
    assert read(Request(file, numbers={"case": 2})).track("1").states[0, 0] == 21.0
    with pytest.raises(RecordingError, match=r"name one with --number case=1"):
        read(Request(file))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEADER, "it has no samples"),
        (HEADER.replace("agent_type,", ""), "has no column 'agent_type'"),
        (HEADER + "1,1,100,car,here,0,0,0,0,4,2\n", r":2: a value is not a number \(.*'here'"),
        (HEADER + "1,1,100,car,0,0,0\n", "the row has 7 values, but there are 11 columns"),
        ("", "does not have the names of columns"),
        ("\0" * 5000, "zero byte"),
    ],
)
def test_a_damaged_table_is_an_error_that_names_the_place(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "vehicle_tracks_000.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match=message):
        read(Request(file), "interaction")


def test_lanelets_have_their_borders_limits_and_right_of_way() -> None:
    lanes = read_lanelet2(MAP).lanes
    assert set(lanes) == {f"2{row}{k}" for row in (1, 2, 3) for k in range(3)}
    # positions are metres from the place at latitude and longitude 0, as in the tables
    np.testing.assert_allclose(lanes["220"].left, [[1000, 1007], [1040, 1007]], atol=1e-5)
    np.testing.assert_allclose(lanes["220"].centre, [[1000, 1005.25], [1040, 1005.25]], atol=1e-5)
    assert lanes["210"].left_neighbour == "220"
    assert lanes["220"].right_neighbour == "210"
    assert lanes["210"].successors == ("211",)
    assert lanes["210"].speed_mps == pytest.approx(25 * 0.44704)
    assert [lanes[id_].way for id_ in ("210", "230")] == ["priority", "stop"]


def test_a_lanelet2_map_becomes_a_network_that_knows_who_yields(tmp_path: Path) -> None:
    recording = read(Request(TRACKS))
    assert recording.roads is not None
    roads = network(recording.roads, tmp_path)
    assert set(roads.edges) == {"e210", "e212", "e230", "e232"}
    assert len(roads.edges["e210"].lanes) == 2
    east, north = (roads.movements_from(edge)[0] for edge in ("e210", "e230"))
    junction = roads.junctions[east.junction]
    assert junction.type == "priority_stop"
    assert junction.yields(north.index, east.index)
    assert not junction.yields(east.index, north.index)
    assert route_of(recording.track("1"), roads, recording.roads.offset) == ("e210",)
    assert route_of(recording.track("2"), roads, recording.roads.offset) == ("e230",)


def test_local_coordinates_are_preferred_to_degrees(tmp_path: Path) -> None:
    text = MAP.read_text(encoding="utf-8")
    local = (f'><tag k="local_x" v="{k}"/><tag k="local_y" v="{k % 7}"/></node>' for k in range(1000))
    parts = text.split('"/>\n  <node')
    ways = parts[-1].index('"/>\n')
    parts[-1] = parts[-1][:ways] + '"' + next(local) + parts[-1][ways + 3 :]
    file = tmp_path / "local.osm"
    file.write_text("".join(f'{part}"{next(local)}\n  <node' for part in parts[:-1]) + parts[-1], encoding="utf-8")
    assert read_lanelet2(file).lanes["210"].left.max() < 100


def test_a_map_in_utm_is_moved_and_the_offset_says_how_far(tmp_path: Path) -> None:
    text = MAP.read_text(encoding="utf-8").replace('lat="0.', 'lat="50.').replace('lon="0.', 'lon="6.')
    file = tmp_path / "far.osm"
    file.write_text(text, encoding="utf-8")
    far = roads_of_file(file)
    x, y = utm(50.0, 6.0, zone_of(6.0))
    assert far.offset == pytest.approx((-x - 1000, -y - 1000), abs=2000)
    moved = roads_of_file(file, origin_m=(x, y))
    assert moved.text == far.text
    assert moved.offset == pytest.approx((far.offset[0] + x, far.offset[1] + y))


def test_positions_of_level_x_are_moved_to_a_map_in_utm(tmp_path: Path) -> None:
    text = MAP.read_text(encoding="utf-8").replace('lat="0.', 'lat="50.').replace('lon="0.', 'lon="6.')
    (tmp_path / "place.osm").write_text(text, encoding="utf-8")
    (begin_x, begin_y), *_ = read_lanelet2(tmp_path / "place.osm").lanes["210"].centre
    tables = {
        "recordingMeta": f"recordingId,frameRate,xUtmOrigin,yUtmOrigin\n1,10,{begin_x - 50:.2f},{begin_y - 20:.2f}\n",
        "tracksMeta": "recordingId,trackId,width,length,class\n1,1,1.8,4.5,car\n",
        "tracks": "recordingId,trackId,frame,xCenter,yCenter,heading,xVelocity,yVelocity\n"
        + "".join(f"1,1,{k},{52 + k},20,0,10,0\n" for k in range(25)),
    }
    for name, table in tables.items():
        (tmp_path / f"01_{name}.csv").write_text(table, encoding="utf-8")
    recording = read(Request(tmp_path / "01_tracks.csv", map_file=tmp_path / "place.osm"))
    assert recording.roads is not None
    roads = network(recording.roads, tmp_path)
    place = recording.track("1").states[0, :2] + recording.roads.offset
    near = roads.nearest_lane(*place)
    assert near is not None
    assert (near.lane.edge, near.pos_m) == ("e210", pytest.approx(1.9, abs=0.1))  # 2 m behind the lane's beginning
    assert abs(near.lateral_m) < 0.3  # UTM's north is turned at this place


def test_a_map_without_lanes_for_vehicles_is_an_error(tmp_path: Path) -> None:
    text = MAP.read_text(encoding="utf-8").replace('v="road"', 'v="walkway"')
    file = tmp_path / "walkways.osm"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match="the map has no road for vehicles"):
        roads_of_file(file)


def test_hostile_maps_are_errors(tmp_path: Path) -> None:
    bomb, empty, folder = tmp_path / "bomb.osm", tmp_path / "empty.osm", tmp_path / "folder.osm"
    bomb.write_text('<!DOCTYPE osm [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]><osm>&b;</osm>', encoding="utf-8")
    empty.touch()
    folder.mkdir()
    for file, message in ((bomb, "declares entities"), (empty, "cut off at line 1"), (folder, "directory")):
        with pytest.raises(RecordingError, match=message):
            roads_of_file(file)


@pytest.mark.parametrize(
    ("latitude", "longitude", "place"),
    [  # computed with PROJ 9
        (48.15956787429, 11.58550091153, (692264.122824, 5337268.659752)),
        (50.78, 6.07, (293450.314552, 5629453.669165)),
        (-33.8568, 151.2153, (334900.569652, 6252288.752888)),
    ],
)
def test_utm_agrees_with_proj(latitude: float, longitude: float, place: tuple[float, float]) -> None:
    result = utm(latitude, longitude, zone_of(longitude), southern=latitude < 0)
    assert math.dist(result, place) < 1e-5


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('role="left"', 'role="middle"', "no error"),
        ('lat="0.', 'lat="nan" elevation="', "has no latitude and longitude"),
        ('v="lanelet"', 'v="area"', "has no relation of the type lanelet"),
        ("<osm", "<html", "its root is <html>"),
        ('lat="0.', 'lat="x', "could not convert"),
    ],
)
def test_a_damaged_map_is_an_error_that_names_the_place(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = MAP.read_text(encoding="utf-8")
    count = -1 if "lanelet" in old else 1
    file = tmp_path / "damaged.osm"
    closing = text.replace(old, new, count).replace("</osm", "</" + new[1:] if old == "<osm" else "</osm")
    file.write_text(closing, encoding="utf-8")
    if message == "no error":
        assert read_lanelet2(file).left_out["lanelets without two borders"] == 1
        return
    with pytest.raises(RecordingError, match=message):
        roads_of_file(file)


def test_other_maps_are_used_as_they_are(tmp_path: Path) -> None:
    for name in ("town.xodr", "town.net.xml"):
        (tmp_path / name).write_text("<text/>", encoding="utf-8")
        roads = read(Request(TRACKS, map_file=tmp_path / name)).roads
        assert roads == RecordedMap("<text/>", name.removeprefix("town"))
    (tmp_path / "town.png").touch()
    with pytest.raises(RecordingError, match=r"its name must end in .*\.osm"):
        read(Request(TRACKS, map_file=tmp_path / "town.png"))
    with pytest.raises(RecordingError, match="cannot be read"):
        read(Request(TRACKS, map_file=tmp_path / "none.xodr"))
