"""The table of what is understood, in the docs: every action, condition, position and shape of the standard is in it,
and the importer does what it says."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from foresee_exchange.openscenario.losses import NotExpressed
from foresee_exchange.openscenario.reading import importer
from foresee_exchange.openscenario.reading.places import Places
from foresee_exchange.openscenario.reading.roads import Roads
from foresee_exchange.openscenario.reading.ways.curves import vertices
from foresee_exchange.openscenario.reading.ways.trajectories import read_trajectory

from foresee_dsl.exchange.outcome import Imported
from tests.support import openscenario_files as osc
from tests.support.openscenario_files import BY_VALUE, GLOBAL, OF_ENTITY, POSITIONS, PRIVATE, SHAPES

DOCS = Path(__file__).parents[3] / "docs" / "guide" / "import.md"


def table() -> dict[str, str]:
    """The docs' table: what is done with each name, in one word."""
    rows = re.findall(r"^\| `(\w+)` \| (understood|lost) ", DOCS.read_text(), flags=re.MULTILINE)
    return dict(rows)


def understood(names: dict[str, str]) -> set[str]:
    """Those of some names that the docs call understood."""
    found = table()
    assert set(names) <= set(found), f"not in the docs' table: {sorted(set(names) - set(found))}"
    assert {found[name] for name in names} <= {"understood", "lost"}
    return {name for name in names if found[name] == "understood"}


def imported(folder: Path, text: str) -> Imported:
    """Import a scenario, whatever is lost of it."""
    return importer.run(osc.write(folder / "in", text), out=folder / "out", partial=True)


def lost(done: Imported, kind: str) -> set[str]:
    """The names that are lost, of what is said as `actions: NAME (...)`."""
    return {what.split(": ")[1].split(" ")[0] for what in done.lost if what.startswith(f"{kind}: ")}


def test_every_action_is_in_the_table_and_is_taken_over_or_lost_as_it_says(tmp_path: Path) -> None:
    events = [osc.event(name, action) for name, action in PRIVATE.items()]
    wrapped = {
        name: f"<GlobalAction>{action}</GlobalAction>" if name != "UserDefinedAction" else
              f"<UserDefinedAction>{action}</UserDefinedAction>"
        for name, action in GLOBAL.items()
    }  # fmt: skip
    events += [
        osc.event(name, "").replace("<PrivateAction></PrivateAction>", action) for name, action in wrapped.items()
    ]
    later = osc.condition(BY_VALUE["SimulationTimeCondition"].join(("<ByValueCondition>", "</ByValueCondition>")))
    events = [event.replace("<ConditionGroup></ConditionGroup>", f"<ConditionGroup>{later}</ConditionGroup>")
              for event in events]  # fmt: skip
    ways = ("FollowTrajectory", "AcquirePosition")  # an actor has one way, and the third of them the ego
    car = osc.group("Target-1", *(event for event in events if not any(way in event for way in ways)))
    car += osc.group("Ego", *(event for event in events if "AcquirePosition" in event))
    asked = '<ByValueCondition><{0}Condition {1}Ref="{2}" value="1" rule="equalTo"/></ByValueCondition>'
    car += osc.group("Target-1", *(
        osc.event(name, osc.speed_action("3"), osc.condition(asked.format(kind, kind.lower(), name)))
        for kind, name in (("Parameter", "pace"), ("Variable", "v"))
    ))  # a variable that nothing asks for makes no difference  # fmt: skip
    rider = osc.group("walker", *(event for event in events if "FollowTrajectory" in event))
    done = imported(tmp_path, osc.scenario(events=car + rider))
    everything = {**PRIVATE, **GLOBAL}
    assert lost(done, "actions") == set(everything) - understood(everything)


def test_every_condition_is_in_the_table_and_is_taken_over_or_lost_as_it_says(tmp_path: Path) -> None:
    events = [osc.event(name, osc.speed_action("3"), osc.of_entity("Ego", inner)) for name, inner in OF_ENTITY.items()]
    events += [
        osc.event(name, osc.speed_action("3"), osc.condition(f"<ByValueCondition>{inner}</ByValueCondition>"))
        for name, inner in BY_VALUE.items()
    ]
    text = osc.scenario(events=osc.group("Target-1", *events)).replace(
        "<CatalogLocations>",
        '<VariableDeclarations><VariableDeclaration name="w" variableType="integer" value="1"/></VariableDeclarations>'
        "<CatalogLocations>",
    )
    done = imported(tmp_path, text)
    everything = {**OF_ENTITY, **BY_VALUE}
    assert lost(done, "conditions") == set(everything) - understood(everything)
    written = (tmp_path / "out" / "cut_in.foresee").read_text()
    assert "# Lost: conditions: OffroadCondition, event 'OffroadCondition' of Target-1." in written
    assert "# Lost: conditions: UserDefinedValueCondition 'mood'" in written


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> Places:
    """Positions on the straight road, with the ego at 50 m."""
    file = tmp_path_factory.mktemp("road") / "straight.xodr"
    file.write_text(osc.XODR)
    ego = ElementTree.fromstring('<Position><LanePosition roadId="1" laneId="-2" s="50"/></Position>')
    line_of = lambda trajectory, places: [vertex.pose for vertex in vertices(trajectory, places)]  # noqa: E731
    referred = lambda holder, tag: None if holder is None else holder.find(f".//{tag}")  # noqa: E731
    return Places(Roads(file), {"Ego": ego}, referred, line_of=line_of)


def _taken(name: str, work: object) -> bool:
    try:
        work()  # type: ignore[operator]
    except NotExpressed as err:
        assert name in str(err)
        return False
    return True


def test_every_position_and_shape_is_in_the_table_and_is_read_or_refused_as_it_says(places: Places) -> None:
    positions = {name: ElementTree.fromstring(f"<Position>{text}</Position>") for name, text in POSITIONS.items()}
    read = {name for name, position in positions.items() if _taken(name, lambda p=position: places.pose(p))}
    assert read == understood(POSITIONS)
    shapes = {
        name: ElementTree.fromstring(f"<Trajectory><Shape>{t}</Shape></Trajectory>") for name, t in SHAPES.items()
    }
    read = {name for name, shape in shapes.items() if _taken(name, lambda s=shape: read_trajectory(s, places, 0.0))}
    assert read == understood(SHAPES)


def test_the_table_has_nothing_that_the_standard_does_not_have() -> None:
    assert set(table()) == {*PRIVATE, *GLOBAL, *OF_ENTITY, *BY_VALUE, *POSITIONS, *SHAPES}
