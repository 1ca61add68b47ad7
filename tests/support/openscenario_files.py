"""Foreign files for the tests, written by hand: a straight road of two lanes each way, a catalogue, a cut-in."""

from __future__ import annotations

from pathlib import Path

XODR = """<?xml version="1.0"?>
<OpenDRIVE>
  <header revMajor="1" revMinor="4" name="straight" version="1" north="0" south="0" east="0" west="0"/>
  <road name="main" length="600" id="1" junction="-1">
    <type s="0" type="town"><speed max="50" unit="km/h"/></type>
    <planView><geometry s="0" x="0" y="0" hdg="0" length="600"><line/></geometry></planView>
    <lanes>
      <laneSection s="0">
        <left>
          <lane id="2" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
          <lane id="1" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
        </left>
        <center><lane id="0" type="none" level="false"/></center>
        <right>
          <lane id="-1" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
          <lane id="-2" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
        </right>
      </laneSection>
    </lanes>
  </road>
</OpenDRIVE>
"""

CATALOGUE = """<?xml version="1.0"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="1" date="2024-01-01T00:00:00" description="cars" author="tests"/>
  <Catalog name="Cars">
    <Vehicle name="saloon" vehicleCategory="car" mass="1500">
      <ParameterDeclarations>
        <ParameterDeclaration name="topSpeed" parameterType="double" value="50"/>
      </ParameterDeclarations>
      <BoundingBox>
        <Center x="1.4" y="0" z="0.7"/><Dimensions width="1.8" length="4.6" height="1.4"/>
      </BoundingBox>
      <Performance maxSpeed="$topSpeed" maxAcceleration="3" maxDeceleration="9"/>
      <Axles>
        <FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionX="2.7" positionZ="0.3"/>
        <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.6" positionX="0" positionZ="0.3"/>
      </Axles>
      <Properties/>
    </Vehicle>
  </Catalog>
</OpenSCENARIO>
"""

_CAR = """<ScenarioObject name="{name}">
      <CatalogReference catalogName="{catalogue}" entryName="saloon">
        <ParameterAssignments><ParameterAssignment parameterRef="topSpeed" value="45"/></ParameterAssignments>
      </CatalogReference>
    </ScenarioObject>"""


def scenario(*, events: str = "", init: str = "", entities: str = "", catalogue: str = "Cars") -> str:
    """Return a scenario with an ego, a car `Target-1` and a pedestrian; further ones can be added."""
    return f"""<?xml version="1.0"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="2" date="2024-01-01T00:00:00" description="A &quot;cut-in&quot;" author="tests"/>
  <ParameterDeclarations>
    <ParameterDeclaration name="pace" parameterType="double" value="12"/>
    <ParameterDeclaration name="gap" parameterType="double" value="15"/>
  </ParameterDeclarations>
  <CatalogLocations><VehicleCatalog><Directory path="catalogues"/></VehicleCatalog></CatalogLocations>
  <RoadNetwork><LogicFile filepath="straight.xodr"/></RoadNetwork>
  <Entities>
    {_CAR.format(name="Ego", catalogue=catalogue)}
    {_CAR.format(name="Target-1", catalogue=catalogue)}
    <ScenarioObject name="walker">
      <Pedestrian name="adult" mass="75" model="adult" pedestrianCategory="pedestrian">
        <BoundingBox><Center x="0" y="0" z="0.9"/><Dimensions width="0.6" length="0.5" height="1.8"/></BoundingBox>
      </Pedestrian>
    </ScenarioObject>
    {entities}
  </Entities>
  <Storyboard>
    <Init><Actions>
      <Private entityRef="Ego">
        {teleport('<LanePosition roadId="1" laneId="-2" s="50" offset="0"/>')}
        {speed("$pace")}
      </Private>
      <Private entityRef="Target-1">
        {teleport('<RelativeLanePosition entityRef="Ego" dLane="1" ds="${$gap * 2 - 5}" offset="0"/>')}
        {speed("${$pace + 2}")}
      </Private>
      <Private entityRef="walker">
        {teleport('<WorldPosition x="300" y="-8.5" h="1.5707963"/>')}
        {speed("0")}
      </Private>
      {init}
    </Actions></Init>
    <Story name="story">
      <Act name="act">
        {events}
        <StartTrigger><ConditionGroup>
          {condition('<ByValueCondition><SimulationTimeCondition value="0" rule="greaterThan"/></ByValueCondition>')}
        </ConditionGroup></StartTrigger>
      </Act>
    </Story>
    <StopTrigger><ConditionGroup>
      {condition('<ByValueCondition><SimulationTimeCondition value="25" rule="greaterThan"/></ByValueCondition>')}
    </ConditionGroup></StopTrigger>
  </Storyboard>
</OpenSCENARIO>
"""


def car(name: str) -> str:
    """Return a further entity: a car of the catalogue."""
    return _CAR.format(name=name, catalogue="Cars")


def group(actor: str, *events: str) -> str:
    """Return a maneuver group of one actor."""
    return f"""<ManeuverGroup name="{actor}_group" maximumExecutionCount="1">
      <Actors selectTriggeringEntities="false"><EntityRef entityRef="{actor}"/></Actors>
      <Maneuver name="{actor}_maneuver">{"".join(events)}</Maneuver>
    </ManeuverGroup>"""


def event(name: str, action: str, *conditions: str) -> str:
    """Return an event with one private action and conditions that hold together."""
    return f"""<Event name="{name}" priority="overwrite" maximumExecutionCount="1">
      <Action name="{name}_action"><PrivateAction>{action}</PrivateAction></Action>
      <StartTrigger><ConditionGroup>{"".join(conditions)}</ConditionGroup></StartTrigger>
    </Event>"""


def condition(inner: str, *, delay: float = 0, edge: str = "none") -> str:
    """Return a condition."""
    return f'<Condition name="c" delay="{delay}" conditionEdge="{edge}">{inner}</Condition>'


def of_entity(entity: str, inner: str, *, delay: float = 0, edge: str = "none") -> str:
    """Return a condition about an entity."""
    return condition(
        f"""<ByEntityCondition>
          <TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="{entity}"/></TriggeringEntities>
          <EntityCondition>{inner}</EntityCondition>
        </ByEntityCondition>""",
        delay=delay,
        edge=edge,
    )


def teleport(position: str) -> str:
    """Return an init action."""
    return f"<PrivateAction><TeleportAction><Position>{position}</Position></TeleportAction></PrivateAction>"


def speed(value: str) -> str:
    """Return an init action."""
    return f"<PrivateAction>{speed_action(value)}</PrivateAction>"


def speed_action(value: str, dynamics: str = 'dynamicsShape="step" value="0" dynamicsDimension="time"') -> str:
    """Return a speed action."""
    return f"""<LongitudinalAction><SpeedAction><SpeedActionDynamics {dynamics}/>
      <SpeedActionTarget><AbsoluteTargetSpeed value="{value}"/></SpeedActionTarget>
    </SpeedAction></LongitudinalAction>"""


def lane_change(by: int) -> str:
    """Return a lane change relative to the actor's own lane."""
    return f"""<LateralAction><LaneChangeAction>
      <LaneChangeActionDynamics dynamicsShape="sinusoidal" value="3" dynamicsDimension="time"/>
      <LaneChangeTarget><RelativeTargetLane entityRef="Target-1" value="{by}"/></LaneChangeTarget>
    </LaneChangeAction></LateralAction>"""


def write(folder: Path, text: str, *, catalogue: str = CATALOGUE, road: str = XODR) -> Path:
    """Write a scenario with its road and catalogue; return its file."""
    (folder / "catalogues").mkdir(parents=True, exist_ok=True)
    (folder / "catalogues" / "cars.xosc").write_text(catalogue)
    (folder / "straight.xodr").write_text(road)
    file = folder / "cut in.xosc"
    file.write_text(text)
    return file


# Names of OpenSCENARIO XML 1.0 to 1.3, from its schemas, each with an example.
_DYNAMICS = 'dynamicsShape="linear" value="2" dynamicsDimension="time"'
_AT = '<Position><LanePosition roadId="1" laneId="-1" s="200"/></Position>'
PRIVATE = {
    "SpeedAction": speed_action("3"),
    "SpeedProfileAction": '<LongitudinalAction><SpeedProfileAction><SpeedProfileEntry speed="5" time="2"/>'
                          "</SpeedProfileAction></LongitudinalAction>",
    "LongitudinalDistanceAction": '<LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" distance="9" '
                                  'continuous="true" freespace="true"/></LongitudinalAction>',
    "LaneChangeAction": lane_change(-1),
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
