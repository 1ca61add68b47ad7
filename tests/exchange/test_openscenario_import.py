"""OpenSCENARIO files become scenarios: who, where, when; what is not expressed is counted."""

from __future__ import annotations

import math
from pathlib import Path

import osc_files as osc
import pytest
from typer.testing import CliRunner

from foresee_dsl.campaign.steps import run_test_case
from foresee_dsl.cli import app
from foresee_dsl.compile import compile_test_case
from foresee_dsl.exchange import openscenario_import
from foresee_dsl.exchange.outcome import ExchangeError, Imported
from foresee_dsl.language.model import When
from foresee_dsl.language.printer import print_item
from foresee_dsl.language.project import load_test_case
from foresee_dsl.simulate.trace import SPEED, Y

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


def imported(folder: Path, text: str = CUT_IN) -> tuple[Imported, Path]:
    """Import a scenario; return what was said, and its file."""
    done = openscenario_import.run(osc.write(folder / "in", text), out=folder / "out")
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
        "when ego within 60 m of (300 m, -5.25 m) {\n  walker changes speed to 1.5 m/s\n}",
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


def test_what_is_not_expressed_is_counted(tmp_path: Path) -> None:
    friction = osc.of_entity("Ego", '<TraveledDistanceCondition value="100"/>')
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
    done, file = imported(tmp_path, train)
    assert done.left_out == {
        "entities: tram": 1,
        "actions at the beginning: UserDefinedAction": 1,
        "conditions: TraveledDistanceCondition": 1,
        "events that wait for such a thing": 1,
        "actions: VisibilityAction": 1,
        "actions of the ego, whose driver decides: SpeedAction": 1,
    }
    scene = compile_test_case(load_test_case(file)).scene
    assert scene.fog == pytest.approx(0.25)
    assert scene.friction == pytest.approx(0.9 * 0.75, abs=1e-3)


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
        (CUT_IN.replace('path="catalogues"', 'path="nowhere"'), "'nowhere', which does not exist"),
        (CUT_IN.replace('path="catalogues"', 'path="../../.."'), "--allow-outside"),
        (CUT_IN.replace("straight.xodr", "gone.xodr"), "'gone.xodr', which does not exist"),
        (CUT_IN.replace("$pace", "$speed"), "the parameter $speed is not declared"),
        (CUT_IN.replace("$gap * 2", "__import__('os').getpid()"), "cannot be worked out"),
        (CUT_IN.replace('s="50"', 's="5000"'), "there is no 5000 m along it"),
        (CUT_IN.replace('value="$pace"', 'value="fast"'), "is no number"),
    ],
)
def test_bad_files_are_refused_in_words_and_nothing_is_written(tmp_path: Path, text: str, said: str) -> None:
    file = osc.write(tmp_path / "in", text)
    with pytest.raises(ExchangeError) as caught:
        openscenario_import.run(file, out=tmp_path / "out")
    assert said in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_file_that_is_too_large_is_not_even_opened(tmp_path: Path) -> None:
    file = osc.write(tmp_path, CUT_IN)
    with file.open("r+b") as stream:
        stream.truncate(200_000_000)
    result = CliRunner().invoke(app, ["import", "openscenario", str(file), "--out", str(tmp_path / "out")])
    assert isinstance(result.exception, ExchangeError)
    assert "has 200 MB, more than the 100 MB" in str(result.exception)
    assert not (tmp_path / "out").exists()
