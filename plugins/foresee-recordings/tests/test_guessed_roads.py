"""Roads that are guessed from the tracks of vehicles, for recordings without a map."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foresee_recordings.maps.from_tracks import guessed_roads, roads_of
from foresee_recordings.maps.matching import route_of
from foresee_recordings.reading import Request, read
from foresee_recordings.recording import Track

from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.net_reader import read_network

FILES = Path(__file__).parent / "files"


def vehicle(id_: str, xs: np.ndarray, ys: np.ndarray, kind: str = "car", width_m: float = 1.8) -> Track:
    """Return a track with a sample each 0.1 s."""
    heading = np.unwrap(np.arctan2(np.gradient(ys), np.gradient(xs)))
    speed = np.hypot(np.gradient(xs), np.gradient(ys)) * 10
    return Track(id_, kind, 4.5, width_m, np.arange(len(xs)) / 10, np.column_stack((xs, ys, heading, speed)))


def test_a_road_runs_along_each_way_that_vehicles_take(tmp_path: Path) -> None:
    xs = np.linspace(0, 60, 61)
    arc = np.linspace(0, np.pi / 2, 61)
    tracks = (
        vehicle("1", xs, 0.02 * np.sin(40 * xs)),
        vehicle("2", xs[5:50], np.full(45, 0.3)),  # along the first road
        vehicle("3", xs[::-1], np.zeros(61)),  # against it
        vehicle("4", 60 * np.sin(arc), 60 * (1 - np.cos(arc)), width_m=3.0),
        vehicle("5", np.full(30, 5.0), np.full(30, 9.0)),  # parked
        vehicle("6", xs, np.full(61, 20.0), kind="pedestrian"),
    )
    roads = guessed_roads(tracks)
    assert roads is not None
    assert roads.notes[0] == "the recording has no map: 3 roads are guessed from the tracks of 4 vehicles"
    file = tmp_path / "guessed.net.xml"
    file.write_text(roads.text, encoding="utf-8")
    network = read_network(foreign_net(file))
    assert sorted(lane.width_m for lane in network.lanes.values()) == [3.5, 3.5, 4.0]
    assert not network.faults
    assert route_of(tracks[0], network) == route_of(tracks[1], network)
    assert len({route_of(track, network) for track in tracks[:5]}) == 4  # the parked car has none
    for track in (tracks[0], tracks[3]):
        off = [abs(network.nearest_lane(x, y, heading).lateral_m) for x, y, heading, _ in track.states]  # type: ignore[union-attr]
        assert max(off) < 0.3


@pytest.mark.parametrize(("east_m", "north_m"), [(0.0, 0.0), (0.37, 0.0), (-10_000.5, 20_000.25)])
def test_vehicles_that_follow_each_other_are_on_one_road(tmp_path: Path, east_m: float, north_m: float) -> None:
    """They were on two roads, one upon the other, and rounding decided which vehicle was on which."""

    def ways(*ways: tuple[np.ndarray, np.ndarray]) -> tuple[Track, ...]:
        return tuple(vehicle(str(k), xs + east_m, ys + north_m) for k, (xs, ys) in enumerate(ways))

    straight = np.zeros(121)
    ahead, middle, behind = (np.linspace(begin, begin + 120, 121) for begin in (150, 60, 0))
    turns = np.linspace(0, 80, 81), np.concatenate((np.zeros(50), np.linspace(0, 40, 31)))
    # The last one joins the two before it, which have nothing in common.
    tracks = ways(
        (ahead, straight), (np.linspace(-10, 90, 121), straight), (middle, straight), (behind, straight), turns
    )
    roads = guessed_roads(tracks)
    assert roads is not None
    assert roads.notes[0] == "the recording has no map: 2 roads are guessed from the tracks of 5 vehicles"
    file = tmp_path / "guessed.net.xml"
    file.write_text(roads.text, encoding="utf-8")
    network = read_network(foreign_net(file))
    assert len({route_of(track, network) for track in tracks[:4]}) == 1
    assert route_of(tracks[4], network) != route_of(tracks[0], network)


def test_only_recordings_without_a_map_get_guessed_roads() -> None:
    recording = read(Request(FILES / "road.xml"))
    assert roads_of(recording) is recording.roads
    guessed = roads_of(replace(recording, roads=None))
    assert guessed is not None
    assert guessed != recording.roads
    still = tuple(track for track in recording.tracks if track.id == "50")
    assert roads_of(replace(recording, roads=None, tracks=still)) is None
