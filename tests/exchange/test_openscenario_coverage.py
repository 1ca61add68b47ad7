"""The table of what is understood, in the docs: every action, condition, position and shape of the standard is in it,
and the importer does what it says."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from foresee_dsl.exchange.openscenario.reading import importer
from foresee_dsl.exchange.openscenario.reading.places import Places
from foresee_dsl.exchange.openscenario.reading.roads import Roads
from foresee_dsl.exchange.openscenario.reading.ways.curves import vertices
from foresee_dsl.exchange.openscenario.reading.ways.trajectories import read_trajectory
from foresee_dsl.exchange.outcome import Imported, NotExpressed
from tests.support import openscenario_files as osc

DOCS = Path(__file__).parents[2] / "docs" / "guide" / "import.md"

# Names of OpenSCENARIO XML 1.0 to 1.3, from its schemas, each with an example.
_DYNAMICS = 'dynamicsShape="linear" value="2" dynamicsDimension="time"'
_AT = '<Position><LanePosition roadId="1" laneId="-1" s="200"/></Position>'
PRIVATE = {
    "SpeedAction": osc.speed_action("3"),
    "SpeedProfileAction": '<LongitudinalAction><SpeedProfileAction><SpeedProfileEntry speed="5" time="2"/>'
                          "</SpeedProfileAction></LongitudinalAction>",
    "LongitudinalDistanceAction": '<LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" distance="9" '
                                  'continuous="true" freespace="true"/></LongitudinalAction>',
    "LaneChangeAction": osc.lane_change(-1),
    "LaneOffsetAction": '<LateralAction><LaneOffsetAction continuous="false"><LaneOffsetActionDynamics '
                        'dynamicsShape="step"/><LaneOffsetTarget><AbsoluteTargetLaneOffset value="1"/>'
                        "</LaneOffsetTarget></LaneOffsetAction></LateralAction>",
    "LateralDistanceAction": '<LateralAction><LateralDistanceAction entityRef="Ego" distance="2" continuous="false" '
                             'freespace="true"/></LateralAction>',
    "VisibilityAction": '<VisibilityAction graphics="true" sensors="true" traffic="true"/>',
    "SynchronizeAction": '<SynchronizeAction masterEntityRef="Ego"><TargetPositionMaster>'
                         f'{_AT.removeprefix("<Position>").removesuffix("</Position>")}</TargetPositionMaster>'
                         f'<TargetPosition>{_AT.removeprefix("<Position>").removesuffix("</Position>")}'
                         '</TargetPosition></SynchronizeAction>',
    "ActivateControllerAction": '<ActivateControllerAction longitudinal="true"/>',
    "AssignControllerAction": '<ControllerAction><AssignControllerAction/></ControllerAction>',
    "OverrideControllerValueAction": '<ControllerAction><OverrideControllerValueAction/></ControllerAction>',
    "TeleportAction": f"<TeleportAction>{_AT}</TeleportAction>",
    "AssignRouteAction": f'<RoutingAction><AssignRouteAction><Route name="r" closed="false"><Waypoint>{_AT}</Waypoint>'
                         "</Route></AssignRouteAction></RoutingAction>",
    "FollowTrajectoryAction": "<RoutingAction><FollowTrajectoryAction><Trajectory name='t' closed='false'><Shape>"
                              f"<Polyline><Vertex time='0'>{_AT}</Vertex><Vertex time='9'>"
                              f"{_AT.replace('200', '300')}</Vertex></Polyline></Shape></Trajectory>"
                              "</FollowTrajectoryAction></RoutingAction>",
    "AcquirePositionAction": f"<RoutingAction><AcquirePositionAction>{_AT}</AcquirePositionAction></RoutingAction>",
    "RandomRouteAction": "<RoutingAction><RandomRouteAction/></RoutingAction>",
    "LightStateAction": "<AppearanceAction><LightStateAction/></AppearanceAction>",
    "AnimationAction": "<AppearanceAction><AnimationAction/></AppearanceAction>",
    "ConnectTrailerAction": '<TrailerAction><ConnectTrailerAction trailerRef="walker"/></TrailerAction>',
    "DisconnectTrailerAction": "<TrailerAction><DisconnectTrailerAction/></TrailerAction>",
}  # fmt: skip
GLOBAL = {
    "EnvironmentAction": "<EnvironmentAction/>",
    "AddEntityAction": "<EntityAction entityRef='walker'><AddEntityAction/></EntityAction>",
    "DeleteEntityAction": "<EntityAction entityRef='walker'><DeleteEntityAction/></EntityAction>",
    "ParameterAction": "<ParameterAction parameterRef='pace'><SetAction value='1'/></ParameterAction>",
    "VariableAction": "<VariableAction variableRef='v'><SetAction value='1'/></VariableAction>",
    "SetMonitorAction": "<SetMonitorAction monitorRef='m' value='true'/>",
    **{
        name: f"<InfrastructureAction><TrafficSignalAction><{name}/></TrafficSignalAction></InfrastructureAction>"
        for name in ("TrafficSignalStateAction", "TrafficSignalControllerAction")
    },
    **{
        name: f"<TrafficAction><{name}/></TrafficAction>"
        for name in (
            "TrafficSourceAction", "TrafficSinkAction", "TrafficSwarmAction", "TrafficAreaAction", "TrafficStopAction",
        )
    },
    "UserDefinedAction": "<CustomCommandAction type='blink'/>",
}  # fmt: skip
_COMPARED = 'value="5" rule="lessThan"'
OF_ENTITY = {
    "EndOfRoadCondition": '<EndOfRoadCondition duration="1"/>',
    "CollisionCondition": '<CollisionCondition><EntityRef entityRef="walker"/></CollisionCondition>',
    "OffroadCondition": '<OffroadCondition duration="1"/>',
    "TimeHeadwayCondition": f'<TimeHeadwayCondition entityRef="walker" {_COMPARED} freespace="true"/>',
    "TimeToCollisionCondition": f'<TimeToCollisionCondition {_COMPARED}><TimeToCollisionConditionTarget>'
                                '<EntityRef entityRef="walker"/></TimeToCollisionConditionTarget>'
                                "</TimeToCollisionCondition>",
    "AccelerationCondition": f"<AccelerationCondition {_COMPARED}/>",
    "StandStillCondition": '<StandStillCondition duration="1"/>',
    "SpeedCondition": f"<SpeedCondition {_COMPARED}/>",
    "RelativeSpeedCondition": f'<RelativeSpeedCondition entityRef="walker" {_COMPARED}/>',
    "TraveledDistanceCondition": '<TraveledDistanceCondition value="100"/>',
    "ReachPositionCondition": f'<ReachPositionCondition tolerance="2">{_AT}</ReachPositionCondition>',
    "DistanceCondition": f'<DistanceCondition {_COMPARED} freespace="true">{_AT}</DistanceCondition>',
    "RelativeDistanceCondition": f'<RelativeDistanceCondition entityRef="walker" {_COMPARED} freespace="true" '
                                 'relativeDistanceType="cartesianDistance"/>',
    "RelativeClearanceCondition": '<RelativeClearanceCondition freeSpace="true" oppositeLanes="false"/>',
    "AngleCondition": '<AngleCondition angle="1" angleTolerance="1" angleType="heading"/>',
    "RelativeAngleCondition": '<RelativeAngleCondition angle="1" angleTolerance="1" angleType="heading"/>',
}  # fmt: skip
BY_VALUE = {
    "ParameterCondition": '<ParameterCondition parameterRef="gap" value="15" rule="equalTo"/>',
    "VariableCondition": '<VariableCondition variableRef="w" value="1" rule="equalTo"/>',
    "TimeOfDayCondition": '<TimeOfDayCondition rule="lessThan" dateTime="2024-01-01T00:00:00"/>',
    "SimulationTimeCondition": '<SimulationTimeCondition value="5" rule="greaterThan"/>',
    "StoryboardElementStateCondition": '<StoryboardElementStateCondition storyboardElementType="event" '
                                       'storyboardElementRef="SimulationTimeCondition" state="endTransition"/>',
    "UserDefinedValueCondition": '<UserDefinedValueCondition name="mood" value="1" rule="equalTo"/>',
    "TrafficSignalCondition": '<TrafficSignalCondition name="1" state="red"/>',
    "TrafficSignalControllerCondition": '<TrafficSignalControllerCondition trafficSignalControllerRef="1" phase="a"/>',
}  # fmt: skip
_ROUTE = f"<RouteRef><Route name='r' closed='false'><Waypoint>{_AT.replace('200', '100')}</Waypoint><Waypoint>{_AT}" \
         "</Waypoint></Route></RouteRef>"  # fmt: skip
POSITIONS = {
    "WorldPosition": '<WorldPosition x="1" y="-2" h="0"/>',
    "RelativeWorldPosition": '<RelativeWorldPosition entityRef="Ego" dx="1" dy="1"/>',
    "RelativeObjectPosition": '<RelativeObjectPosition entityRef="Ego" dx="1" dy="1"/>',
    "RoadPosition": '<RoadPosition roadId="1" s="1" t="1"/>',
    "RelativeRoadPosition": '<RelativeRoadPosition entityRef="Ego" ds="1" dt="1"/>',
    "LanePosition": '<LanePosition roadId="1" laneId="-1" s="1"/>',
    "RelativeLanePosition": '<RelativeLanePosition entityRef="Ego" dLane="1" ds="1"/>',
    "RoutePosition": f"<RoutePosition>{_ROUTE}<InRoutePosition><FromLaneCoordinates pathS='10' laneId='-1'/>"
                     "</InRoutePosition></RoutePosition>",
    "TrajectoryPosition": "<TrajectoryPosition s='1'><TrajectoryRef><Trajectory name='t' closed='false'><Shape>"
                          f"<Polyline><Vertex>{_AT}</Vertex><Vertex>{_AT.replace('200', '300')}</Vertex></Polyline>"
                          "</Shape></Trajectory></TrajectoryRef></TrajectoryPosition>",
    "GeoPosition": '<GeoPosition latitudeDeg="1" longitudeDeg="1"/>',
}  # fmt: skip
_CONTROLS = "".join(
    f"<ControlPoint time='{k}'>{_AT.replace('200', str(100 + 20 * k))}</ControlPoint>" for k in range(3)
)
SHAPES = {
    "Polyline": f"<Polyline><Vertex time='0'>{_AT}</Vertex><Vertex time='1'>{_AT}</Vertex></Polyline>",
    "Clothoid": f"<Clothoid curvature='0' curvaturePrime='0.001' length='10' stopTime='2'>{_AT}</Clothoid>",
    "ClothoidSpline": f"<ClothoidSpline timeEnd='3'><ClothoidSplineSegment curvatureStart='0' curvatureEnd='0.01' "
                      f"length='10' timeStart='0'>{_AT.replace('Position>', 'PositionStart>', 1)}"
                      "</ClothoidSplineSegment></ClothoidSpline>".replace("</Position>", "</PositionStart>"),
    "Nurbs": f"<Nurbs order='3'>{_CONTROLS}" + "".join(f"<Knot value='{k}'/>" for k in (0, 0, 0, 1, 1, 1)) + "</Nurbs>",
}  # fmt: skip
SHAPES["ClothoidSpline"] = (
    SHAPES["ClothoidSpline"].replace("<Position>", "<PositionStart>").replace("</Position>", "</PositionStart>")
)


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
