"""Bus bays: how netconvert builds them, how buses pull in and out in SUMO, and what is a mistake."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
import shapely
import shapely.affinity

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.errors import InputError
from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y
from foresee_dsl.story import tell
from tests.support.worlds import written_case

FILE = Path(__file__).parents[1] / "derive" / "following" / "bay.foresee"
TEXT = FILE.read_text()
WITHOUT = TEXT.replace(" bay 3 m", "")
HIDDEN = (
    TEXT.replace("ego within 52 m of local", "ego within 32 m of local")
    .replace("local stops at church for 15 s", "local stops at church for 17 s")
    .replace("speed 2 m/s", "speed 2.5 m/s")
)
CAR_LANE_M, BAY_LANE_M = -1.65, -4.8
"""The middles of the lane of 3.3 m and of the bay of 3 m beside it, south of the road's line."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("bays")


@lru_cache
def compiled(folder: Path, text: str) -> SumoBundle:
    return compile_test_case(written_case(folder / "bay.foresee", text))


@lru_cache
def driven(folder: Path, text: str) -> Trace:
    return run_test_case(written_case(folder / "bay.foresee", text), "idm", 0).trace


def states(trace: Trace, actor: str) -> np.ndarray:
    return trace.states[:, trace.index(actor)]


def body(state: np.ndarray, length_m: float, width_m: float) -> shapely.Polygon:
    box = shapely.box(-length_m / 2, -width_m / 2, length_m / 2, width_m / 2)
    turned = shapely.affinity.rotate(box, state[HEADING], origin=(0, 0), use_radians=True)
    return shapely.affinity.translate(turned, state[X], state[Y])


def test_a_bay_is_a_lane_for_buses_beside_one_piece_of_its_road(folder: Path) -> None:
    network = compiled(folder, TEXT).network
    assert network.parts["west"] == ("west#1", "west#2", "west#3")
    before, beside, behind = (network.edges[piece].lanes for piece in network.parts["west"])
    kinds = [sorted(lane.kinds) for lane in beside]
    assert kinds == [["pedestrian"], ["bus"], ["bicycle", "bus", "car"]]
    assert [lane.parking for lane in before] == [False, True, False] == [lane.parking for lane in behind]
    assert beside[1].bay and beside[1].width_m == 3
    # 15 m entry taper, 20 m straight on, a stop of 20 m, its front at 140 m, 12 m exit taper
    assert network.edges["west#2"].lanes[2].shape[0][0] == pytest.approx(-250 + 85, abs=1)
    assert network.edges["west#2"].lanes[2].shape[-1][0] == pytest.approx(-250 + 152, abs=1)
    assert not any("bay" in m.from_lane or beside[1].id in m.ends for m in network.movements)
    stop = network.stops["market"]
    assert stop.lane is beside[1] and stop.lane.line.at(stop.pos_m)[:2] == pytest.approx((-110, BAY_LANE_M), abs=0.01)
    assert not network.off_road_depth(np.array([(-110.0, -6.2)])).any()


def test_places_lanes_and_junctions_stay_what_they_were(folder: Path) -> None:
    cut, whole = compiled(folder, TEXT).network, compiled(folder, WITHOUT).network
    assert whole.parts == {} and whole.bays == frozenset()
    for edge in ("west", "west_back"):
        for at_m in (5.0, 60.0, 86.0, 120.0, 151.0, 200.0, -20.0, -100.0, -160.0):
            assert cut.locate(edge, at_m) == pytest.approx(whole.locate(edge, at_m), abs=0.01), (edge, at_m)
    assert {"market_begin", "market_end", "church_begin", "church_end"} == cut.joints
    text = TEXT.replace("  end after", "  when follower in junction { liner leaves }\n  end after")
    text = text.replace("ego within 52 m", "follower in lane 1 of west and ego within 52 m")
    trace = driven(folder, text)
    left = np.flatnonzero(np.isnan(states(trace, "liner")[:, X]))[0]
    assert states(trace, "follower")[left, X] == pytest.approx(-12, abs=2), "at `middle`, not at the bay"


def test_a_bus_pulls_in_waits_pulls_out_and_a_car_passes_it(folder: Path) -> None:
    trace = driven(folder, TEXT)
    liner, follower = states(trace, "liner"), states(trace, "follower")
    stands = np.flatnonzero(liner[:, SPEED] < 0.01)
    x, y, heading = liner[stands[0], [X, Y, HEADING]]
    assert len(stands) / 20 == pytest.approx(3, abs=0.2)
    assert x + 6 == pytest.approx(-110, abs=0.3) and y == pytest.approx(BAY_LANE_M, abs=0.15) and abs(heading) < 0.03
    assert np.abs(np.diff(liner[:, Y])).max() < 0.051, "1 m/s sideways"
    assert liner[-1, Y] == pytest.approx(CAR_LANE_M, abs=0.02)
    assert np.nanmin(follower[:, SPEED]) > 10, "it drives at 11 m/s at the beginning"
    passes = np.flatnonzero(follower[:, X] > liner[:, X])[0]
    assert passes < stands[-1] and np.abs(follower[: passes + 200, Y] - CAR_LANE_M).max() < 0.05
    both = zip(follower[:400], liner[:400], strict=True)
    gaps = [body(car, 4.3, 1.8).distance(body(bus, 12.0, 2.55)) for car, bus in both]
    assert min(gaps) > 0.5


def test_without_a_bay_the_car_waits(folder: Path) -> None:
    follower = states(driven(folder, WITHOUT), "follower")
    assert np.nanmin(follower[:, SPEED]) < 1


def test_a_bus_stands_in_its_bay_at_the_start_and_sumo_has_it_there(folder: Path) -> None:
    trace = driven(folder, TEXT)
    local, index = states(trace, "local"), trace.index("local")
    lanes = [trace.lane_ids[lane] for lane in trace.lanes[:300, index]]
    assert set(lanes) == {"west_back#2_1"}, "SUMO would change the lane of a bus that stands"
    assert (local[:300, X] == local[0, X]).all() and local[0, [X, Y]] == pytest.approx((-144, -BAY_LANE_M), abs=0.01)
    assert local[500, X] < -190, "it pulls out after 15 s"


def test_a_bus_that_does_not_stop_there_drives_past(folder: Path) -> None:
    trace = driven(folder, TEXT.replace("    liner stops at market for 3 s\n", ""))
    assert np.abs(states(trace, "liner")[:400, Y] - CAR_LANE_M).max() < 0.01


def test_the_story_names_the_bus_that_hid_a_child(folder: Path) -> None:
    story = tell(driven(folder, HIDDEN), written_case(folder / "bay.foresee", HIDDEN))
    assert story.sentence.startswith("'kid' (pedestrian) steps onto the road from behind 'local' (bus)")
    assert any("kid" in m.text and "hidden by 'local' (bus)" in m.text for m in story.moments)
    assert not any("market_" in m.text or "church_" in m.text for m in story.moments)


def test_a_bus_on_another_lane_comes_to_the_one_beside_the_bay_in_time(folder: Path) -> None:
    text = TEXT.replace("road west from west_end to middle {", "road west from west_end to middle { bus_lane 3.5 m;")
    liner = states(driven(folder, text), "liner")
    stands = np.flatnonzero(liner[:, SPEED] < 0.01)[0]
    assert liner[0, Y] == pytest.approx(CAR_LANE_M) and liner[stands, Y] == pytest.approx(BAY_LANE_M - 3.5, abs=0.3)


@pytest.mark.parametrize(
    ("old", "new", "message", "help"),
    [
        (
            "    liner stops at market for 3 s\n",
            "    follower stops at market for 3 s\n",
            "follower cannot stop in the bay of market: only buses may use it",
            "`follower stops at 140 m along west`",
        ),
        ("start at 28 m along west", "start at market", "follower cannot start in the bay", "obstacle.parked_car"),
        ("start at church", "start at curch", "there is no bus stop called curch", "did you mean 'church'?"),
        ("start at church", "start at market", "local starts on west, off its route", "its route is west_back#1"),
        ("when ego within 52 m", "when ego in lane 2 of west and ego within 52 m", "west has no lane 2", "from 1 to 1"),
    ],
)  # fmt: skip
def test_what_a_bay_is_not_for_is_a_mistake(folder: Path, old: str, new: str, message: str, help: str) -> None:
    assert old in TEXT
    with pytest.raises(InputError) as found:
        compile_test_case(written_case(folder / "bay.foresee", TEXT.replace(old, new)))
    assert message in str(found.value) and help in str(found.value)


def test_background_traffic_cannot_stop_in_a_bay(folder: Path) -> None:
    traffic = (
        "  traffic others {\n    count 1\n    models [car.compact]\n    within 150 m of ego.route\n    seed 1\n  }\n"
    )
    text = TEXT.replace("  when time", traffic + "  when time").replace("    liner stops", "    others_01 stops")
    with pytest.raises(InputError, match="others_01 cannot stop in the bay of market"):
        compile_test_case(written_case(folder / "bay.foresee", text))


def test_a_parked_car_may_stand_in_a_bay(folder: Path) -> None:
    text = TEXT.replace("  pedestrian kid", "  obstacle car: obstacle.parked_car { start at market }\n  pedestrian kid")
    car = next(actor for actor in compiled(folder, text).scene.actors if actor.id == "car")
    assert (car.x, car.y) == pytest.approx((-110, BAY_LANE_M), abs=0.01)
