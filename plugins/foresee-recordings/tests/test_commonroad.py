"""CommonRoad scenarios: their obstacles, traffic lights and lanelets, and files that are damaged or hostile."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from foresee_recordings.maps.matching import route_of
from foresee_recordings.reading import Request, read
from foresee_recordings.recording import Recording, RecordingError

from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.roads.network import RoadNetwork

FILES = Path(__file__).parent / "files"
ROAD, CROSSING = FILES / "road.xml", FILES / "crossing.xml"
BOMB = '<!DOCTYPE a [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>'


@pytest.fixture(scope="module")
def road() -> Recording:
    return read(Request(ROAD))


def roads_of(recording: Recording, folder: Path) -> RoadNetwork:
    """Return the network as a scenario gets it, which includes that SUMO loads it."""
    assert recording.roads is not None
    file = folder / f"net{recording.roads.suffix}"
    file.write_text(recording.roads.text, encoding="utf-8")
    return read_network(foreign_net(file))


def changed(folder: Path, old: str, new: str, count: int = 1) -> Path:
    """Return a copy of the road's file with a text replaced."""
    text = ROAD.read_text(encoding="utf-8")
    assert old in text
    file = folder / "changed.xml"
    file.write_text(text.replace(old, new, count), encoding="utf-8")
    return file


def test_actors_have_their_classes_sizes_and_times(road: Recording) -> None:
    assert [(t.id, t.kind, t.length_m, t.width_m) for t in road.tracks] == [
        ("30", "car", 4.5, 1.8),
        ("31", "truck", 6.0, 2.0),
        ("32", "pedestrian", 0.7, 0.7),
        ("50", "car", 4.0, 1.6),
    ]
    assert road.name == "road"
    assert road.format == "commonroad"
    assert (road.begins_s, road.ends_s) == (0.0, 4.0)


def test_a_position_is_the_centre_of_the_footprint(road: Recording) -> None:
    car = road.track("30").at(2.05)
    assert car is not None
    np.testing.assert_allclose(car, [51.0, 1.925, 0.0, 20.0], atol=1e-9)
    # the truck's polygon reaches from 1 m behind its position to 5 m ahead
    np.testing.assert_allclose(road.track("31").states[2], [4.0, 3.5, 0.0, 10.0])
    # the parked car's rectangle lies 1 m ahead and 0.5 m to the left of its position; it is turned to the north
    np.testing.assert_allclose(road.track("50").states[:, :2], [[59.5, -3.0]] * 2)
    assert road.track("50").time_s.tolist() == [0.0, 4.0]


def test_directions_and_speeds_that_are_missing_come_from_the_motion(road: Recording) -> None:
    states = road.track("32").states
    np.testing.assert_allclose(states[:, 2], math.pi / 2)
    np.testing.assert_allclose(states[:, 3], 1.5)
    assert "1 actor has no headings: those of their motion are used." in road.notes


def test_everything_that_is_dropped_is_counted(road: Recording) -> None:
    assert road.left_out == {
        "obstacles of the type train": 1,
        "occupancies (predicted areas in place of positions)": 1,
        "planning problems (the start and goal of a planner, not recorded traffic)": 1,
        "single samples without others of their actor beside them": 1,  # the one with occupancies
    }
    assert road.roads is not None
    assert road.roads.notes == (
        "left out of the map: 1 traffic signs 720",
        "2 of 4 lanes have no speed limit: 80 km/h is assumed for them",  # as fast as recorded,
    )


def test_a_request_narrows_seconds_and_actors() -> None:
    recording = read(Request(ROAD, begins_s=1.0, ends_s=2.0, actors=frozenset({"30", "32"})))
    assert [track.id for track in recording.tracks] == ["30", "32"]
    assert recording.track("30").time_s.tolist() == pytest.approx([1.0 + 0.1 * k for k in range(11)])
    with pytest.raises(RecordingError, match="its samples are from 0 s to 4 s"):
        read(Request(ROAD, begins_s=100.0))


def test_the_version_of_2018_is_read_too() -> None:
    recording = read(Request(FILES / "old_version.xml"))
    assert [(t.id, t.kind, len(t.time_s)) for t in recording.tracks] == [("30", "car", 41), ("50", "car", 2)]
    assert recording.roads is not None
    assert recording.roads.notes == ()  # each lanelet has its own speed limit


def test_a_traffic_light_shows_its_colours() -> None:
    (signal,) = read(Request(CROSSING)).signals
    # the cycle of 3.5 s begins at 0.5 s: the recording begins 3 s into the cycle before
    assert signal.time_s == pytest.approx((0.0, 0.2, 0.5, 1.7, 3.7, 4.0, 5.2, 7.2, 7.5))
    assert signal.colours == ("green", "amber", "red", "green", "amber", "red", "green", "amber", "red")
    assert signal.place == (-10.0, 0.0)


def test_adjacent_lanelets_become_one_edge(road: Recording, tmp_path: Path) -> None:
    roads = roads_of(road, tmp_path)
    assert [len(edge.lanes) for edge in roads.edges.values()] == [2, 2]
    first, second = roads.edges["e1"].lanes
    assert first.shape == ((0.1, 0.0), (99.9, 0.0))  # 0.1 m at each end lies inside the junction
    assert second.shape == ((0.1, 3.5), (99.9, 3.5))
    assert first.speed_mps == 25.0
    assert first.width_m == 3.5
    assert route_of(road.track("30"), roads) == ("e1",)
    assert route_of(road.track("31"), roads) == ("e1",)


def test_lanelets_that_cross_become_a_junction(tmp_path: Path) -> None:
    recording = read(Request(CROSSING))
    roads = roads_of(recording, tmp_path)
    assert set(roads.edges) == {"e10", "e12", "e20", "e22"}
    ways = {(m.from_edge, m.to_edge): m for m in roads.movements}
    assert set(ways) == {("e10", "e12"), ("e20", "e22")}
    east, north = ways["e10", "e12"], ways["e20", "e22"]
    assert roads.junctions[east.junction].conflicts(east.index, north.index)
    assert roads.lanes[east.via[0]].shape == ((-10.1, 0.0), (10.1, 0.0))
    assert east.tls is not None  # the signal at the approach
    assert route_of(recording.track("40"), roads) == ("e10", "e12")
    assert route_of(recording.track("41"), roads) == ("e20", "e22")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('timeStepSize="0.1"', 'timeStepSize="0"', "timeStepSize of <commonRoad> is '0', not a number of seconds"),
        ("<x>12</x>", "<x>far</x>", r"<dynamicObstacle id='30'>: <x> holds 'far', not a number"),
        ("<commonRoad", f"{BOMB}<commonRoad", "declares entities"),
        ("<x>0</x><y>1.75</y>", "<x>inf</x><y>1.75</y>", r"<lanelet id='1'>: its <leftBound> has a point that is not"),
        ("<length>4.5</length>", "<length>1e300</length>", "no usable size"),
        ("</commonRoad>", "", "cut off"),
        ('<?xml version="1.0" encoding="UTF-8"?>', "", "no error"),
    ],
)
def test_a_damaged_file_is_an_error_that_names_the_place(tmp_path: Path, old: str, new: str, message: str) -> None:
    file = changed(tmp_path, old, new)
    if message == "no error":
        assert len(read(Request(file)).tracks) == 4
        return
    with pytest.raises(RecordingError, match=message):
        read(Request(file))


def test_samples_that_are_not_numbers_or_go_back_in_time_are_sorted_out(tmp_path: Path) -> None:
    file = changed(tmp_path, "<x>12</x>", "<x>nan</x>")
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("<time><exact>3</exact></time>", "<time><exact>2</exact></time>", 1), encoding="utf-8")
    recording = read(Request(file))
    assert recording.left_out["samples with a number that is not finite"] == 1
    assert recording.left_out["samples at the time of an earlier one of their actor, at another place"] == 1
    assert (np.diff(recording.track("30").time_s) > 0).all()
    assert len(recording.track("30").time_s) == 39


def test_files_that_are_no_scenarios_are_errors(tmp_path: Path) -> None:
    empty, other, folder = tmp_path / "empty.xml", tmp_path / "other.xml", tmp_path / "folder.xml"
    empty.touch()
    other.write_text("<commonRoads timeStepSize='1'/>", encoding="utf-8")
    folder.mkdir()
    for file, message in ((empty, "no element found"), (other, "its root is"), (folder, "directory")):
        with pytest.raises(RecordingError, match=message):
            read(Request(file), "commonroad")


def test_a_huge_file_is_refused_before_it_is_parsed(tmp_path: Path) -> None:
    file = tmp_path / "huge.xml"
    with file.open("wb") as out:
        out.write(b"<commonRoad timeStepSize='0.1'>")
        out.truncate(200_000_000)
    with pytest.raises(RecordingError, match=r"200 MB.*foresee --limit file="):
        read(Request(file))
