"""OpenSCENARIO files become scenarios: who, where, when; what is not expressed is counted."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from xml.etree import ElementTree

import pytest
from foresee_exchange.openscenario.reading import importer as openscenario_import
from typer.testing import CliRunner

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.cli import app
from foresee_dsl.compile import compile_test_case
from foresee_dsl.errors import ForeseeError
from foresee_dsl.exchange.outcome import ExchangeError, Imported
from foresee_dsl.language.model import When
from foresee_dsl.language.printer import print_item
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.trace import SPEED, Y
from tests.support import openscenario_files as osc

_TTC = '<TimeToCollisionCondition value="4" rule="lessThan" freespace="true" coordinateSystem="entity" ' \
       'relativeDistanceType="longitudinal"><TimeToCollisionConditionTarget><EntityRef entityRef="Ego"/>' \
       "</TimeToCollisionConditionTarget></TimeToCollisionCondition>"  # fmt: skip
_NEAR = '<RelativeDistanceCondition entityRef="Ego" relativeDistanceType="cartesianDistance" value="40" ' \
        'freespace="true" rule="lessThan"/>'  # fmt: skip
_OVER = '<ByValueCondition><StoryboardElementStateCondition storyboardElementType="event" ' \
        'storyboardElementRef="cut_in" state="completeState"/></ByValueCondition>'  # fmt: skip
CUT_IN = osc.scenario(
    events=osc.group(
        "Target-1",
        osc.event("cut_in", osc.lane_change(-1), osc.of_entity("Target-1", _NEAR)),
        osc.event(
            "brake",
            osc.speed_action("6", 'dynamicsShape="linear" value="2" dynamicsDimension="rate"'),
            osc.condition(_OVER, delay=0.5),
        ),
    )
    + osc.group(
        "walker",
        osc.event(
            "walks",
            osc.speed_action("1.5"),
            osc.of_entity(
                "Ego", '<ReachPositionCondition tolerance="60"><Position><WorldPosition x="300" y="-5.25"/></Position>'
                       "</ReachPositionCondition>"
            ),
        ),
    )
)  # fmt: skip


def imported(folder: Path, text: str = CUT_IN, *, partial: bool = False) -> tuple[Imported, Path]:
    """Import a scenario; return what was said, and its file."""
    done = openscenario_import.run(osc.write(folder / "in", text), out=folder / "out", partial=partial)
    return done, folder / "out" / "cut_in.foresee"


def test_a_cut_in_reads_like_one_and_happens(tmp_path: Path) -> None:
    done, file = imported(tmp_path)
    case = load_test_case(file)
    assert [actor.name for actor in case.scenario.actors] == ["ego", "target_1", "walker"]
    assert [print_item(when) for when in case.scenario.all(When)] == [
        "when distance(target_1, ego) < 40 m {\n"
        "  target_1 changes lane right\n"
        "  then {\n"
        "    wait 0.5 s\n"
        "    then {\n"
        "      target_1 changes speed to 6 m/s over 4 s\n"
        "    }\n"
        "  }\n"
        "}",
        "when ego within 56.3 m of (300 m, -5.25 m) {\n  walker changes speed to 1.5 m/s over 0.05 s\n}",
    ]
    assert done.taken == {"of the kind ego": 1, "of the kind pedestrian": 1, "of the kind vehicle": 1}
    assert done.left_out == {"durations of lane changes (1 m/s sideways is driven)": 1}

    trace = run_test_case(case, "idm", 0).trace
    target, walker = trace.index("target_1"), trace.index("walker")
    assert trace.states[0, target, Y] == pytest.approx(-1.75, abs=1e-3)
    assert trace.states[-1, target, Y] == pytest.approx(-5.25, abs=0.3)
    assert trace.states[:, target, SPEED].min() == pytest.approx(6, abs=0.1)
    assert trace.states[0, walker, SPEED] == 0
    assert trace.states[:, walker, SPEED].max() == pytest.approx(1.5, abs=0.01)
    assert trace.duration_s <= 25


def test_reference_points_are_rear_axles_and_parameters_have_values(tmp_path: Path) -> None:
    _, file = imported(tmp_path)
    scene = compile_test_case(load_test_case(file)).scene
    ego, target, walker = scene.actors
    front_m = 1.4 + 4.6 / 2  # from the rear axle to the front bumper
    assert (ego.x, ego.y) == pytest.approx((50 + front_m, -5.25), abs=1e-4)
    assert (target.x, target.y) == pytest.approx((50 + 25 + front_m, -1.75), abs=1e-4)  # ds = 15 * 2 - 5
    assert (ego.speed_mps, target.speed_mps) == (12, 14)
    assert (walker.x, walker.y) == (300, -8.5)
    assert ego.model.max_speed_mps == 45  # assigned where the catalogue is named
    assert ego.model.wheelbase_m == pytest.approx(2.7)
    assert ego.model.front_overhang_m == pytest.approx(front_m - 2.7)
    assert ego.model.max_steer_rad == pytest.approx(0.5, abs=1e-5)
    assert ego.model.name == target.model.name == "car.saloon"


def test_a_timed_trajectory_is_followed_in_its_times(tmp_path: Path) -> None:
    """A quarter circle, first slow, then fast: where the car is at each time."""
    vertices = []
    for k in range(41):
        turned = (k / 40) ** 2 * math.pi / 2  # speeds up from standing
        x, y = 100 + 20 * math.sin(turned), -5 - 20 * math.cos(turned)
        at = f'<Position><WorldPosition x="{x}" y="{y}" h="{turned}"/></Position>'
        vertices.append(f'<Vertex time="{k * 0.25}">{at}</Vertex>')
    follow = f"""<RoutingAction><FollowTrajectoryAction>
      <TrajectoryRef><Trajectory name="t" closed="false">
        <Shape><Polyline>{"".join(vertices)}</Polyline></Shape>
      </Trajectory></TrajectoryRef>
      <TimeReference><Timing domainAbsoluteRelative="absolute" scale="1" offset="0"/></TimeReference>
      <TrajectoryFollowingMode followingMode="position"/>
    </FollowTrajectoryAction></RoutingAction>"""
    bike = """<ScenarioObject name="bike"><Vehicle name="bike" vehicleCategory="bicycle">
      <BoundingBox><Center x="0.5" y="0" z="0.9"/><Dimensions width="0.6" length="1.8" height="1.8"/></BoundingBox>
      <Performance maxSpeed="20" maxAcceleration="3" maxDeceleration="7"/>
    </Vehicle></ScenarioObject>"""
    begin = osc.condition(
        '<ByValueCondition><SimulationTimeCondition value="0" rule="greaterOrEqual"/></ByValueCondition>'
    )
    init = '<Private entityRef="bike">' + osc.teleport('<WorldPosition x="100" y="-25" h="0"/>') + "</Private>"
    text = osc.scenario(entities=bike, init=init, events=osc.group("bike", osc.event("goes", follow, begin)))
    _, file = imported(tmp_path, text)
    trace = run_test_case(load_test_case(file), "idm", 0).trace
    k = trace.index("bike")
    for time_s in (0.0, 2.5, 5.0, 7.5, 9.5):
        turned = (time_s / 10) ** 2 * math.pi / 2
        x = 100 + 20 * math.sin(turned) + 0.5 * math.cos(turned)
        y = -5 - 20 * math.cos(turned) + 0.5 * math.sin(turned)
        assert math.dist(trace.states[trace.frame_at(time_s), k, :2], (x, y)) < 0.1


@pytest.mark.parametrize(
    ("position", "pose"),
    [
        ('<WorldPosition x="80" y="-1.75"/>', (80, -1.75, 0)),
        ('<LanePosition roadId="1" laneId="-1" s="80"/>', (80, -1.75, 0)),
        ('<LanePosition roadId="1" laneId="1" s="80" offset="0.2"/>', (80, 1.95, 180)),
        ('<RoadPosition roadId="1" s="80" t="-2"/>', (80, -2, 0)),
        ('<RelativeObjectPosition entityRef="Ego" dx="30" dy="3.5"/>', (80, -1.75, 0)),
        ('<RelativeWorldPosition entityRef="Ego" dx="30" dy="3.5"/>', (80, -1.75, 0)),
        ('<RelativeRoadPosition entityRef="Ego" ds="30" dt="3.5"/>', (80, -1.75, 0)),
        ('<RelativeLanePosition entityRef="Ego" dLane="2" ds="30"/>', (80, 1.75, 0)),
        (
            '<LanePosition roadId="1" laneId="-1" s="80"><Orientation type="relative" h="0.1"/></LanePosition>',
            (80, -1.75, math.degrees(0.1)),
        ),
    ],
)
def test_every_kind_of_place(tmp_path: Path, position: str, pose: tuple[float, float, float]) -> None:
    text = osc.scenario()
    start = text.index("<RelativeLanePosition")
    text = text[:start] + position + text[text.index("/>", start) + 2 :]
    _, file = imported(tmp_path, text)
    target = load_test_case(file).scenario.actors[1]
    assert target.state is not None
    front, heading = 1.4 + 2.3, math.radians(pose[2])
    at = pose[0] + front * math.cos(heading), pose[1] + front * math.sin(heading)
    assert (target.state.at.x.si, target.state.at.y.si) == pytest.approx(at, abs=1e-3)
    assert abs(math.remainder(target.state.heading.si - heading, math.tau)) < 1e-5


@pytest.mark.parametrize(
    ("inner", "said"),
    [
        ('<SpeedCondition value="5" rule="greaterThan"/>', "ego.speed > 5 m/s"),
        ('<AccelerationCondition value="-2" rule="lessThan"/>', "ego.acceleration < -2 m/s^2"),
        ('<StandStillCondition duration="2"/>', "ego.speed < 0.1 m/s for 2 s"),
        (
            '<TimeHeadwayCondition entityRef="walker" value="3" rule="lessOrEqual" freespace="true"/>',
            "headway(ego, walker) <= 3 s and not walker behind ego",
        ),
        (
            '<TimeHeadwayCondition entityRef="walker" value="3" rule="greaterThan" freespace="true"/>',
            "headway(ego, walker) > 3 s and walker ahead of ego",
        ),
        (
            '<TimeToCollisionCondition value="2" rule="lessThan" freespace="true"><TimeToCollisionConditionTarget>'
            '<EntityRef entityRef="walker"/></TimeToCollisionConditionTarget></TimeToCollisionCondition>',
            "ttc(ego, walker) < 2 s",
        ),
        (
            '<DistanceCondition value="9" rule="greaterThan" freespace="true"><Position>'
            '<WorldPosition x="1" y="2"/></Position></DistanceCondition>',
            "not ego within 9 m of (1 m, 2 m)",
        ),
        ('<CollisionCondition><EntityRef entityRef="walker"/></CollisionCondition>', "ego within 0 m of walker"),
    ],
)
def test_every_kind_of_condition(tmp_path: Path, inner: str, said: str) -> None:
    text = osc.scenario(
        events=osc.group("Target-1", osc.event("e", osc.speed_action("3"), osc.of_entity("Ego", inner)))
    )
    _, file = imported(tmp_path, text)
    (when,) = load_test_case(file).scenario.all(When)
    assert print_item(when).startswith(f"when {said} {{")


def test_routes_of_catalogues_and_speed_profiles(tmp_path: Path) -> None:
    """A route from a catalogue makes the car turn; entries of a profile follow each other."""
    profile = """<LongitudinalAction><SpeedProfileAction followingMode="follow">
      <SpeedProfileEntry speed="5" time="2"/><SpeedProfileEntry speed="9" time="3"/>
    </SpeedProfileAction></LongitudinalAction>"""
    route = '<PrivateAction><RoutingAction><AssignRouteAction><CatalogReference catalogName="Ways" entryName="on"/>' \
            "</AssignRouteAction></RoutingAction></PrivateAction>"  # fmt: skip
    init = f'<Private entityRef="Target-1">{route}</Private>'
    ways = """<OpenSCENARIO><FileHeader revMajor="1" revMinor="1" date="2024-01-01T00:00:00" description="" author=""/>
      <Catalog name="Ways"><Route name="on" closed="false">
        <Waypoint><Position><LanePosition roadId="1" laneId="-1" s="100"/></Position></Waypoint>
        <Waypoint><Position><LanePosition roadId="1" laneId="-2" s="500"/></Position></Waypoint>
      </Route></Catalog></OpenSCENARIO>"""
    after = osc.condition(
        '<ByValueCondition><SimulationTimeCondition value="2" rule="greaterThan"/></ByValueCondition>'
    )
    text = osc.scenario(init=init, events=osc.group("Target-1", osc.event("e", profile, after)))
    file = osc.write(tmp_path / "in", text)
    (tmp_path / "in" / "catalogues" / "ways.xosc").write_text(ways)
    done = openscenario_import.run(file, out=tmp_path / "out")
    assert not done.left_out
    scenario = load_test_case(tmp_path / "out" / "cut_in.foresee").scenario
    (when,) = scenario.all(When)
    assert print_item(when) == (
        "when time > 2 s {\n"
        "  target_1 changes speed to 5 m/s over 2 s\n"
        "  then {\n"
        "    target_1 changes speed to 9 m/s over 3 s\n"
        "  }\n"
        "}"
    )


def test_what_is_not_expressed_is_counted(tmp_path: Path) -> None:
    friction = osc.of_entity("Ego", '<OffroadCondition duration="1"/>')
    train = osc.scenario(
        entities='<ScenarioObject name="t"><Vehicle name="t" vehicleCategory="tram"><BoundingBox><Center x="0" y="0" '
        'z="0"/><Dimensions width="1" length="1" height="1"/></BoundingBox></Vehicle></ScenarioObject>',
        init="<GlobalAction><EnvironmentAction><Environment name='e'><Weather><Fog visualRange='200'/></Weather>"
        "<RoadCondition frictionScaleFactor='0.75'/></Environment></EnvironmentAction></GlobalAction>"
        "<UserDefinedAction/>",
        events=osc.group("Target-1", osc.event("far", osc.speed_action("3"), friction))
        + osc.group(
            "Target-1",
            osc.event("odd", "<VisibilityAction graphics='true' sensors='true' traffic='true'/>"),
        )
        + osc.group("Ego", osc.event("mine", osc.speed_action("3"))),
    )
    with pytest.raises(ExchangeError, match="1 entities: tram; 1 actions: UserDefinedAction; 1 conditions: Off"):
        imported(tmp_path, train)
    done, file = imported(tmp_path, train, partial=True)
    assert done.lost == {
        "entities: tram": 1,
        "actions: UserDefinedAction": 1,
        "conditions: OffroadCondition": 1,
        "actions: VisibilityAction": 1,
    }
    assert done.left_out == {"actions of the ego, whose driver decides: SpeedAction": 1}
    written = file.read_text()
    assert "# Lost: entities: tram, 't'." in written
    assert "# Lost: conditions: OffroadCondition, event 'far' of Target-1." in written
    assert "# Left out: actions of the ego, whose driver decides: SpeedAction, event 'mine' of Ego." in written
    scene = compile_test_case(load_test_case(file)).scene
    assert scene.fog == pytest.approx(0.25)
    assert scene.friction == pytest.approx(0.9 * 0.75, abs=1e-3)


def test_whatever_is_missing_or_odd_it_is_a_scenario_or_an_error_in_words(tmp_path: Path) -> None:
    """Every seventh element left out, and every seventh attribute with something else in it."""
    elements = len(list(ElementTree.fromstring(CUT_IN).iter()))
    tries = [(k, None, "") for k in range(1, elements, 7)]
    odd = itertools.cycle(["", "x", "-5", "1e400", "nan", "$", "${1/0}", "99999999", "0"])
    attributes = [(k, a) for k, e in enumerate(ElementTree.fromstring(CUT_IN).iter()) for a in e.attrib if k]
    tries += [(k, name, next(odd)) for k, name in attributes[::7]]
    refused = 0
    for k, name, value in tries:
        root = ElementTree.fromstring(CUT_IN)
        element = list(root.iter())[k]
        if name is None:
            next(parent for parent in root.iter() if element in parent).remove(element)
        else:
            element.set(name, value)
        file = osc.write(tmp_path / "in", ElementTree.tostring(root, encoding="unicode"))
        try:
            openscenario_import.run(file, out=tmp_path / f"out{k}", partial=k % 2 == 0)
        except ForeseeError as err:
            refused += 1
            assert str(err)
    assert 10 < refused < len(tries)


BOMB = '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;">]>' \
       "<OpenSCENARIO>&b;</OpenSCENARIO>"  # fmt: skip


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (CUT_IN[: len(CUT_IN) // 2], "a damaged one"),
        (BOMB, "declares entities"),
        ("<OpenDRIVE/>", "its root is <OpenDRIVE>"),
        ("", "a damaged one"),
        ("<a>" * 200_000, "nests more than 100"),
        (CUT_IN.replace('revMajor="1"', 'revMajor="2"'), "1.0 to 1.3 are read"),
        (osc.scenario(catalogue="Trucks"), "the catalogue 'Trucks'"),
        (CUT_IN.replace('entryName="saloon"', 'entryName="limousine"'), "has no entry 'limousine'"),
        (CUT_IN.replace('path="catalogues"', 'path="nowhere"'), "the folder 'nowhere' does not exist"),
        (CUT_IN.replace('path="catalogues"', 'path="../../.."'), "--allow-outside"),
        (CUT_IN.replace("straight.xodr", "gone.xodr"), "'gone.xodr', which does not exist"),
        (CUT_IN.replace("$pace", "$speed"), "the parameter $speed is not declared"),
        (CUT_IN.replace("$gap * 2", "__import__('os').getpid()"), "cannot be computed"),
        (CUT_IN.replace('s="50"', 's="5000"'), "it has no place at 5000 m"),
        (CUT_IN.replace('value="$pace"', 'value="fast"'), "is not a usable number"),
    ],
)
def test_bad_files_are_refused_in_words_and_nothing_is_written(tmp_path: Path, text: str, said: str) -> None:
    file = osc.write(tmp_path / "in", text)
    with pytest.raises(ForeseeError) as caught:
        openscenario_import.run(file, out=tmp_path / "out")
    assert said in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_which_vehicle_became_the_ego_is_said_if_none_is_called_so(tmp_path: Path) -> None:
    file = osc.write(tmp_path, CUT_IN.replace('"Ego"', '"Fred"'))
    done = openscenario_import.run(file, out=tmp_path / "out")
    assert [note for note in done.notes if note.startswith("the ego is 'Fred'") and "--ego NAME" in note]
    assert not [note for note in imported(tmp_path / "named")[0].notes if "the ego is" in note]
    with pytest.raises(ExchangeError, match="no vehicle 'nix' that can be driven; its vehicles are Fred, Target-1"):
        openscenario_import.run(file, out=tmp_path / "other", ego="nix")


def test_a_file_that_is_too_large_is_not_even_opened(tmp_path: Path) -> None:
    file = osc.write(tmp_path, CUT_IN)
    with file.open("r+b") as stream:
        stream.truncate(200_000_000)
    result = CliRunner().invoke(app, ["import", "openscenario", str(file), "--out", str(tmp_path / "out")])
    assert isinstance(result.exception, ExchangeError)
    assert "has 200 MB, more than the 100 MB" in str(result.exception)
    assert not (tmp_path / "out").exists()
