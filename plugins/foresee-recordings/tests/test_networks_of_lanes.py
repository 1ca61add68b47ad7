"""Networks that are built of lanes: junctions, conflicts, signals, and maps with mistakes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from defusedxml.ElementTree import fromstring
from foresee_recordings.maps.conflicts import Stream, add_conflicts
from foresee_recordings.maps.junctions import LaneLink
from foresee_recordings.maps.lanes import Lane, LaneMap
from foresee_recordings.maps.network import network_of
from foresee_recordings.maps.signals import SignalCycle
from foresee_recordings.reading import Request, read
from foresee_recordings.recording import RecordedMap, RecordingError

from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.roads.network import RoadNetwork

FILES = Path(__file__).parent / "files"


def lane(id_: str, *centre: tuple[float, float], width_m: float = 3.5, **more: object) -> Lane:
    """Return a lane around a straight centre line."""
    points = np.array(centre, dtype=np.float64)
    along = (points[-1] - points[0]) / np.hypot(*(points[-1] - points[0]))
    aside = np.array([-along[1], along[0]]) * width_m / 2
    return Lane(id_, points + aside, points - aside, **more)  # type: ignore[arg-type]


def lane_map(*lanes: Lane) -> LaneMap:
    return LaneMap({own.id: own for own in lanes})


def network(roads: RecordedMap, folder: Path) -> RoadNetwork:
    """Return the network as a scenario gets it, which includes that SUMO loads it."""
    file = folder / "lanes.net.xml"
    file.write_text(roads.text, encoding="utf-8")
    return read_network(foreign_net(file))


def test_a_long_lane_is_a_road_except_near_its_crossing(tmp_path: Path) -> None:
    east = lane("east", (-200, 0), (200, 0))
    north = lane("north", (10, -150), (10, 60))
    roads = network(network_of(lane_map(east, north)), tmp_path)
    assert set(roads.edges) == {"eeast_0", "eeast_2", "enorth_0", "enorth_2"}
    (way,) = roads.movements_from("eeast_0")
    inner = roads.lanes[way.via[0]].line
    assert (inner.xy[0][0], inner.xy[-1][0]) == pytest.approx((1.9, 18.1), abs=0.2)  # 8 m before and behind x = 10
    other = roads.movements_from("enorth_0")[0]
    assert roads.junctions[way.junction].conflicts(way.index, other.index)


def test_lanes_that_join_and_separate_meet_at_a_junction_without_length(tmp_path: Path) -> None:
    lanes = lane_map(
        lane("a", (0, 0), (100, 0), successors=("c",)),
        lane("b", (0, -40), (100, 0), successors=("c",)),
        lane("c", (100, 0), (150, 0), successors=("d", "e")),
        lane("d", (150, 0), (250, 0)),
        lane("e", (150, 0), (250, -40)),
    )
    roads = network(network_of(lanes), tmp_path)
    ways = {(way.from_edge, way.to_edge): way for way in roads.movements}
    assert set(ways) == {("ea", "ec"), ("eb", "ec"), ("ec", "ed"), ("ec", "ee")}
    assert all(roads.lanes[way.via[0]].line.length_m < 0.5 for way in ways.values())
    first, other = ways["ea", "ec"], ways["eb", "ec"]
    assert roads.junctions[first.junction].conflicts(first.index, other.index)


def test_lanes_lie_where_the_map_has_them(tmp_path: Path) -> None:
    angles = np.linspace(0, np.pi / 2, 30)
    arcs = [Lane("arc", *(np.column_stack((np.sin(angles), 1 - np.cos(angles))) * r + (0, 30 - r) for r in (28, 32)))]
    arcs += [lane("on", (30, 30), (30, 90), predecessors=("arc",)), lane("to", (-60, 0), (0, 0), successors=("arc",))]
    recorded = network_of(lane_map(*arcs))
    roads = network(recorded, tmp_path)
    lines = shapely.union_all([own.centreline for own in roads.lanes.values()])
    points = np.concatenate([own.centre for own in arcs]) + recorded.offset
    off = np.sort(shapely.distance(lines, shapely.points(points)))
    assert off[:-2].max() < 0.01
    assert off.max() < 0.11  # 0.1 m at both ends of the map is left out


def test_a_kink_between_lanes_is_smoothed_so_that_vehicles_can_follow(tmp_path: Path) -> None:
    lanes = lane_map(
        lane("a", (-50, 0), (0, 0), successors=("b",)),
        lane("b", (0, 0), (0.5, 1.0), successors=("c",)),  # shorter than a vehicle: a part of the junction
        lane("c", (0.5, 1.0), (0.5, 50)),
    )
    roads = network(network_of(lanes), tmp_path)
    assert set(roads.edges) == {"ea", "ec"}
    assert not roads.faults
    (way,) = roads.movements
    line = np.array(roads.lanes[way.via[0]].shape)
    assert roads.edges["ea"].lanes[0].shape[-1] == pytest.approx((-3.0, 0.0), abs=0.01)  # smoothed from here on
    assert shapely.LineString(line).distance(shapely.Point(0, 0)) < 1.75  # within the lane
    headings = np.unwrap(np.arctan2(*np.diff(line, axis=0).T[::-1]))
    assert (np.diff(headings) > -0.01).all()  # it turns to the left only
    assert (headings[0], headings[-1]) == pytest.approx((0.0, np.pi / 2), abs=0.2)


def test_mistakes_of_a_map_are_counted(tmp_path: Path) -> None:
    lanes = lane_map(
        lane("a", (0, 0), (50, 0), successors=("b", "nowhere")),
        lane("b", (100, 0), (150, 0)),  # begins 50 m behind the end of the lane before
        lane("c", (0, 10), (50, 10), width_m=0.8),
        lane("d", (0, 20), (50, 20), width_m=1.2),
    )
    roads = network_of(lanes)
    assert roads.notes == (
        "left out of the map: 1 relations of lanes to lanes that begin elsewhere",
        "2 lanes are narrower than 1.5 m: they are for bicycles only, or closed if they are narrower than 0.9 m",
        "4 of 4 lanes have no speed limit: 50 km/h is assumed for them",
    )
    net = network(roads, tmp_path)
    assert not net.movements
    assert net.edges["ec"].lanes[0].strip
    assert not net.edges["ec"].lanes[0].kinds
    assert net.edges["ed"].lanes[0].kinds == {"bicycle"}


def test_a_map_of_crossing_lanes_only_still_has_roads() -> None:
    roads = network_of(lane_map(lane("a", (-5, 0), (5, 0)), lane("b", (0, -5), (0, 5))))
    assert roads.text.count('<edge id="e') == 4  # a stub before and behind the crossing of each lane


def test_edges_have_different_names() -> None:
    roads = network_of(lane_map(*(lane(id_, (0, 10 * k), (50, 10 * k)) for k, id_ in enumerate(("1-2", "1_2", "1.2")))))
    assert all(f'<edge id="{name}"' in roads.text for name in ("e1_2", "e1_2_2", "e1_2_3"))


def test_lanes_without_a_length_are_left_out() -> None:
    roads = network_of(lane_map(lane("a", (0, 0), (50, 0), successors=("b",)), lane("b", (50, 0), (50.01, 0))))
    assert roads.notes[0] == "left out of the map: 1 lanes without a length"


def test_a_lattice_of_lanes_is_refused() -> None:
    across = (lane(f"a{k}", (0, 5 * k), (2000, 5 * k)) for k in range(330))
    along = (lane(f"b{k}", (5 * k + 1, -50), (5 * k + 1, 2000)) for k in range(330))
    with pytest.raises(RecordingError, match="more than 100,000 pairs of lanes that cross"):
        network_of(lane_map(*across, *along))


def test_a_map_far_from_the_origin_is_moved() -> None:
    roads = network_of(lane_map(lane("a", (691_000, 5_334_000), (691_100, 5_334_000))))
    assert roads.offset == (-691_000.0, -5_334_000.0)
    assert 'shape="0.1,0 99.9,0"' in roads.text


def test_conflicts_that_netconvert_does_not_see_are_added() -> None:
    roads = read(Request(FILES / "crossing.xml")).roads
    assert roads is not None
    root = fromstring(roads.text)
    requests = list(root.iter("request"))
    for request in requests:
        request.set("foes", "00")
        request.set("response", "00")
    east = Stream(LaneLink(("e10", 0), ("e12", 0), None, None, ()), np.array([[-10.0, 0], [10, 0]]), "", "")
    north = Stream(LaneLink(("e20", 0), ("e22", 0), None, None, ()), np.array([[0.0, -10], [0, 10]]), "", "")
    via = {element.get("from"): element.get("via") for element in root.iter("connection") if element.get("via")}
    east, north = replace(east, lane=via["e10"]), replace(north, lane=via["e20"])
    assert add_conflicts(root, [east, north]) == 1
    assert add_conflicts(root, [east, north]) == 0  # now it is there
    junction = next(junction for junction in root.iter("junction") if via["e10"] in junction.get("intLanes", ""))
    first = junction.get("intLanes", "").split().index(via["e10"])
    assert [request.get("foes") for request in requests] == (["10", "01"])
    # the one that goes north comes from the right of the one that goes east
    assert [request.get("response") for request in requests] == (["10", "00"] if first == 0 else ["00", "01"])


def test_signals_repeat_the_recorded_cycle(tmp_path: Path) -> None:
    roads = read(Request(FILES / "crossing.xml")).roads
    assert roads is not None
    assert roads.notes[0] == "1 signals repeat the recorded cycles; second 0 of a run is second 0 of the recording"
    (program,) = fromstring(roads.text).iter("tlLogic")
    phases = [(float(phase.get("duration")), phase.get("state")) for phase in program]
    assert sum(duration for duration, _ in phases) == pytest.approx(3.5)
    way = network(roads, tmp_path).movements_from("e10")[0]
    shown = [(duration, state[way.link].lower()) for duration, state in phases]
    # 20 time steps of green begin 1.2 s after 0.5 s; those of the cycle before end at 0.2 s
    assert shown == [(0.2, "g"), (0.3, "y"), (1.2, "r"), (1.8, "g")]


def test_a_cycle_repeats_before_its_offset_too() -> None:
    cycle = SignalCycle(((2.0, "red"), (3.0, "green")), offset_s=1.0)
    assert cycle.changes(-1.0, 4.0) == [(-1.0, "green"), (1.0, "red"), (3.0, "green")]
    assert [cycle.colour_at(time) for time in (-4.0, 0.9, 1.0, 2.9, 3.0, 6.0)] == [
        "red", "green", "red", "red", "green", "red",
    ]  # fmt: skip


def test_the_limit_of_netconvert_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORESEE_LIMITS", "netconvert-time=0.001")
    with pytest.raises(RecordingError, match="the map of lanes cannot be converted"):
        network_of(lane_map(lane("a", (0, 0), (50, 0))))
