"""Defects that were found in files of others: positions, and the side on which their coordinates turn."""

from __future__ import annotations

import math
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from foresee_exchange.openscenario.losses import Coordinates, NotExpressed
from foresee_exchange.openscenario.reading import importer
from foresee_exchange.openscenario.reading.places import Places
from foresee_exchange.openscenario.reading.roads import Roads

from foresee_dsl.exchange.outcome import Imported
from foresee_dsl.language.model import Quantity, Scenario
from foresee_dsl.language.project.loading import load_test_case
from tests.support import openscenario_files as osc

_EGO_AT_50 = '<Position><LanePosition roadId="1" laneId="-2" s="50"/></Position>'


def imported(folder: Path, text: str, **options: object) -> tuple[Imported, Scenario]:
    """Import a scenario; return what was said, and what was written."""
    done = importer.run(osc.write(folder / "in", text), out=folder / "out", **options)  # type: ignore[arg-type]
    return done, load_test_case(folder / "out" / "cut_in.foresee").scenario


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> Places:
    """Positions on the straight road; the ego is at 50 m on the right, `Other` at 90 m on the left, going west."""
    file = tmp_path_factory.mktemp("road") / "straight.xodr"
    file.write_text(osc.XODR)
    other = '<Position><LanePosition roadId="1" laneId="1" s="90"/></Position>'
    inits = {"Ego": ElementTree.fromstring(_EGO_AT_50), "Other": ElementTree.fromstring(other)}
    return Places(Roads(file), inits, along=lambda _x, _y: 0.0)


_TURN = '<Orientation type="relative" h="3.14159265"/>'
_WAY = "<RouteRef><Route name='r' closed='false'>" + "".join(
    f'<Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="{lane}" s="{s}"/></Position>'
    "</Waypoint>" for lane, s in ((1, 400), (1, 100))
) + "</Route></RouteRef>"  # fmt: skip


@pytest.mark.parametrize(
    ("position", "pose"),
    [  # as esmini 3.6 has them
        (f'<LanePosition roadId="1" laneId="1" s="80">{_TURN}</LanePosition>', (80, 1.75, 0)),  # against the traffic
        ('<LanePosition roadId="1" laneId="1" s="80"/>', (80, 1.75, 180)),
        ('<LanePosition roadId="1" laneId="1" s="80"><Orientation h="0"/></LanePosition>', (80, 1.75, 0)),
        ('<LanePosition roadId="1" laneId="1" s="80"><Orientation p="0"/></LanePosition>', (80, 1.75, 180)),
        ('<RelativeRoadPosition entityRef="Other" ds="30" dt="-3.5"/>', (120, -1.75, 0)),
        ('<RelativeLanePosition entityRef="Other" dLane="0" dsLane="30"/>', (60, 1.75, 180)),
        ('<RelativeLanePosition entityRef="Other" dLane="0" ds="30"/>', (120, 1.75, 0)),
        ('<RelativeLanePosition entityRef="Other" dLane="1" dsLane="0"/>', (90, -1.75, 0)),
        ('<RelativeObjectPosition entityRef="Other" dx="30" dy="0"/>', (60, 1.75, 180)),
        (
            f'<RoutePosition>{_WAY}<InRoutePosition><FromLaneCoordinates pathS="100" laneId="2"/></InRoutePosition>'
            "</RoutePosition>",
            (300, 5.25, 180),
        ),
    ],
)
def test_positions_look_where_the_standard_says(
    places: Places, position: str, pose: tuple[float, float, float]
) -> None:
    found = places.pose(ElementTree.fromstring(f"<Position>{position}</Position>"))
    assert (found.x, found.y) == pytest.approx(pose[:2], abs=1e-6)
    assert abs(math.remainder(found.heading_rad - math.radians(pose[2]), math.tau)) < 1e-6


def test_a_second_place_may_be_relative_to_the_first(places: Places) -> None:
    again = ElementTree.fromstring('<Position><RelativeRoadPosition entityRef="Ego" ds="10" dt="3.5"/></Position>')
    moved = Places(places.roads, {"Ego": again}, earlier={"Ego": [places.inits["Ego"]]})
    assert (moved.initial("Ego").x, moved.initial("Ego").y) == pytest.approx((60, -1.75))
    with pytest.raises(NotExpressed, match="depend on each other"):
        Places(places.roads, {"Ego": again}).initial("Ego")


def test_since_version_1_3_an_orientation_without_a_type_is_relative(places: Places) -> None:
    text = '<Position><LanePosition roadId="1" laneId="1" s="80"><Orientation h="0"/></LanePosition></Position>'
    later = Places(places.roads, places.inits, minor=3)
    assert abs(later.pose(ElementTree.fromstring(text)).heading_rad) == pytest.approx(math.pi)


def _mirrored(description: str) -> str:
    text = osc.scenario().replace("A &quot;cut-in&quot;", description)
    text = text.replace(
        '<LanePosition roadId="1" laneId="-2" s="50" offset="0"/>', '<WorldPosition x="50" y="5.25" h="0"/>'
    )
    text = re.sub(r"<RelativeLanePosition[^>]*/>", '<WorldPosition x="75" y="1.75" h="0"/>', text)
    return text.replace('x="300" y="-8.5" h="1.5707963"', 'x="300" y="8.5" h="-1.5707963"')


@pytest.mark.parametrize(
    ("description", "said"),
    [("CARLA:cut in", "description says CARLA"), ("town", "only then do its actors stand on lanes")],
)
def test_left_handed_coordinates_are_found_said_and_turned_round(tmp_path: Path, description: str, said: str) -> None:
    done, scenario = imported(tmp_path, _mirrored(description))
    (note,) = [note for note in done.notes if "left-handed" in note]
    assert said in note
    ego, _, walker = scenario.actors
    assert ego.state is not None
    assert walker.state is not None
    assert isinstance(ego.state.at.x, Quantity)
    assert (ego.state.at.x.si, ego.state.at.y.si) == pytest.approx((50 + 2.3, -5.25))  # places are of the middle
    assert walker.state.heading.si == pytest.approx(math.pi / 2, abs=1e-5)


def test_the_option_decides_which_way_coordinates_are_meant(tmp_path: Path) -> None:
    done, scenario = imported(tmp_path, osc.scenario(), coordinates=Coordinates.right)
    assert not any("left-handed" in note for note in done.notes)
    assert scenario.actors[2].state is not None
    assert scenario.actors[2].state.at.y.si == -8.5
