"""Defects that were found in files of others: each as a small file."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from foresee_exchange.openscenario.losses import SourceError
from foresee_exchange.openscenario.reading import importer
from foresee_exchange.openscenario.reading.expressions import value_of
from typer.testing import CliRunner

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.cli import app
from foresee_dsl.exchange.outcome import Imported
from foresee_dsl.language import model as m
from foresee_dsl.language.model import Scenario, When
from foresee_dsl.language.printer import print_item
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.trace import SPEED, X, Y
from tests.support import openscenario_files as osc

_FRONT_M = 1.4 + 2.3


def imported(folder: Path, text: str, **options: object) -> tuple[Imported, Scenario]:
    """Import a scenario; return what was said, and what was written."""
    done = importer.run(osc.write(folder / "in", text), out=folder / "out", **options)  # type: ignore[arg-type]
    return done, load_test_case(folder / "out" / "cut_in.foresee").scenario


def whens(scenario: Scenario) -> list[str]:
    """Its triggers as text, on one line each."""
    return [" ".join(print_item(when).split()) for when in scenario.all(When)]


def events(*found: str, actor: str = "Target-1") -> str:
    """A scenario with events of one actor."""
    return osc.scenario(events=osc.group(actor, *found))


def on_time(value: float, **options: float) -> str:
    """A trigger by simulation time."""
    inner = f'<ByValueCondition><SimulationTimeCondition value="{value}" rule="greaterThan"/></ByValueCondition>'
    return osc.condition(inner, **options)


def on_state(kind: str, ref: str, state: str) -> str:
    """A trigger by the state of a part of the storyboard."""
    inner = f'storyboardElementType="{kind}" storyboardElementRef="{ref}" state="{state}"'
    return osc.condition(f"<ByValueCondition><StoryboardElementStateCondition {inner}/></ByValueCondition>")


# ---- parameters -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("${pi / 2}", repr(math.pi / 2)),
        ("${-$pi}", repr(-math.pi)),
        ("${$forward + $standoff}", "7"),  # names that contain `or`, `and`
        ("${$andy}", "3"),
        ("${not ($forward > 3 and $andy == 3)}", "false"),
        ("${round($forward / 3) + floor(1.9) - ceil(0.1) + sqrt(pow(3, 2))}", "4"),
        ("$road.xodr", "main.xodr"),
        ("a $andy b", "a 3 b"),
        ("${7 % 4}", "3"),
    ],
)
def test_expressions(text: str, value: str) -> None:
    assert value_of(text, {"forward": "4", "standoff": "3", "andy": "3", "road": "main"}) == value


@pytest.mark.parametrize(
    "text", ["${1 +}", "${(1}", "${a + 1}", "${1 / 0}", "$gone", "${'x' * 2}", "${" + "(" * 400 + "}"]
)
def test_what_is_no_expression_is_refused(text: str) -> None:
    with pytest.raises(SourceError):
        value_of(text, {})


def test_parameters_are_found_wherever_they_are_written(tmp_path: Path) -> None:
    """References with `$`, conditions on parameters, names that look like expressions, catalogues by a file's name."""
    never = '<ByValueCondition><ParameterCondition parameterRef="$gap" rule="lessThan" value="3"/></ByValueCondition>'
    text = events(
        osc.event("${$who + trajectory event}", osc.speed_action("${$pace / 2}"), on_time(2)),
        osc.event("next", osc.speed_action("3"), on_state("event", "${$who + trajectory event}", "completeState")),
        osc.event("never", osc.speed_action("4"), osc.condition(never)),
    ).replace('parameterRef="topSpeed"', 'parameterRef="$topSpeed"').replace('"Cars"', '"cars"')  # fmt: skip
    done, scenario = imported(tmp_path, text)
    assert not done.lost
    assert done.left_out == {"events whose conditions never hold": 1}
    assert whens(scenario) == [
        "when time > 2 s { target_1 changes speed to 6 m/s over 0.05 s "
        "then { target_1 changes speed to 3 m/s over 0.05 s } }"
    ]


# ---- what happens ---------------------------------------------------------------------------------------------------

_TO_EGOS_LANE = osc.lane_change(0).replace('entityRef="Target-1"', 'entityRef="Ego"')
_AS_FAST = """<LongitudinalAction><SpeedAction><SpeedActionDynamics dynamicsShape="linear" value="2"
  dynamicsDimension="time"/><SpeedActionTarget><RelativeTargetSpeed entityRef="Ego" value="-2"
  speedTargetValueType="delta" continuous="false"/></SpeedActionTarget></SpeedAction></LongitudinalAction>"""


def test_lane_changes_and_speeds_relative_to_the_ego_and_states_of_the_storyboard(tmp_path: Path) -> None:
    text = events(
        osc.event("in", _TO_EGOS_LANE, on_time(1, delay=0.5)),
        osc.event("slow", _AS_FAST, on_state("event", "in", "startTransition")),
        osc.event("after", osc.speed_action("4"), on_state("action", "slow_action", "endTransition")),
        osc.event("with_act", osc.speed_action("0"), on_state("act", "act", "startTransition"), on_time(9)),
    )
    done, scenario = imported(tmp_path, text)
    assert not done.lost
    assert whens(scenario) == [
        "when time > 1.5 s { target_1 changes lane right }",
        "when time > 1.5 s { target_1 changes speed to 10 m/s over 2 s then { target_1 changes speed to 4 m/s } }",
        "when time > 9 s { target_1 changes speed to 0 m/s }",
    ]
    assert "lane changes relative to the ego count from its lane at the beginning" in done.notes


@pytest.mark.parametrize(
    ("inner", "said"),
    [
        ('<TraveledDistanceCondition value="100"/>', "ego within 5 m of 104 m along ego.route"),
        (
            '<ReachPositionCondition tolerance="2"><Position><WorldPosition x="100" y="-5.25" h="0"/></Position>'
            "</ReachPositionCondition>",
            "ego within 1 m of (102.7 m, -5.25 m)",
        ),
        (
            '<RelativeDistanceCondition entityRef="Target-1" value="20" freespace="false" rule="lessThan" '
            'relativeDistanceType="longitudinal"/>',
            "overlap(ego, target_1) > -15.4 m",
        ),
        ('<CollisionCondition><ByType type="pedestrian"/></CollisionCondition>', "ego within 0 m of walker"),
        ('<SpeedCondition value="5" rule="equalTo"/>', "ego.speed >= 4.9 m/s and ego.speed <= 5.1 m/s"),
    ],
)
def test_conditions_are_about_the_same_point_of_a_car(tmp_path: Path, inner: str, said: str) -> None:
    done, scenario = imported(tmp_path, events(osc.event("e", osc.speed_action("3"), osc.of_entity("Ego", inner))))
    assert not done.lost
    assert whens(scenario) == [f"when {said} {{ target_1 changes speed to 3 m/s over 0.05 s }}"]


def test_what_happens_at_once_is_how_it_begins_and_a_trajectory_is_a_start(tmp_path: Path) -> None:
    vertices = "".join(
        f'<Vertex time="{k}"><Position><WorldPosition x="{200 + 10 * k}" y="-1.75" h="0"/></Position></Vertex>'
        for k in range(4)
    )
    follow = f"""<RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="t" closed="false">
      <Shape><Polyline>{vertices}</Polyline></Shape></Trajectory></TrajectoryRef>
      <TimeReference><Timing domainAbsoluteRelative="relative" scale="1" offset="0"/></TimeReference>
    </FollowTrajectoryAction></RoutingAction>"""
    car = osc._CAR.format(name="Only", catalogue="Cars")
    text = osc.scenario(
        entities=car,
        events=osc.group("Only", osc.event("goes", follow))
        + osc.group("Target-1", osc.event("fast", osc.speed_action("20"))),
    )
    done, scenario = imported(tmp_path, text)
    assert not done.lost
    by_name = {actor.name: actor for actor in scenario.actors}
    only, target = by_name["only"].state, by_name["target_1"].state
    assert only is not None
    assert target is not None
    assert only.at.x.si == pytest.approx(200 + _FRONT_M)
    assert target.speed.si == 20
    assert whens(scenario)[-1].startswith("when time >= 0 s { only changes speed to 10 m/s over")


@pytest.mark.parametrize(("seconds", "slows"), [(4, False), (1, True)])
def test_a_change_over_the_middle_keeps_the_speed_of_an_actor_above_the_limit(
    tmp_path: Path, seconds: float, slows: bool
) -> None:
    """With 20 m/s where 13.9 m/s are allowed, into the lane of the other direction and back; what tyres cannot hold is
    said."""
    init = f"""<Private entityRef="Target-1">{
        osc.teleport(
            '<LanePosition roadId="1" laneId="1" s="75"><Orientation type="relative" h="3.14159265"/></LanePosition>'
        )
    }{osc.speed("20")}</Private>"""
    change = osc.lane_change(-1).replace('value="3" dynamicsDimension', f'value="{seconds}" dynamicsDimension')
    text = osc.scenario(init=init, events=osc.group("Target-1", osc.event("back", change, on_time(0.5))))
    done, _ = imported(tmp_path, text.replace('value="25" rule', 'value="6" rule'))
    assert any("target_1 slows down in a lane change" in note for note in done.notes) == slows
    if not slows:
        trace = run_test_case(load_test_case(tmp_path / "out" / "cut_in.foresee"), "idm", 0).trace
        target = trace.states[-1, trace.index("target_1")]
        assert (target[SPEED], target[Y]) == pytest.approx((20.0, -1.75), abs=0.1)


def test_an_actor_begins_where_its_spline_does(tmp_path: Path) -> None:
    spline = """<RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="t" closed="false"><Shape>
      <ClothoidSpline><Segment curvatureStart="0" curvatureEnd="0" length="80"><PositionStart>
      <LanePosition roadId="1" laneId="-1" s="200"/></PositionStart></Segment></ClothoidSpline></Shape></Trajectory>
      </TrajectoryRef><TimeReference><None/></TimeReference></FollowTrajectoryAction></RoutingAction>"""
    init = f'<Private entityRef="Only"><PrivateAction>{spline}</PrivateAction>{osc.speed("9")}</Private>'
    _, scenario = imported(tmp_path, osc.scenario(entities=osc._CAR.format(name="Only", catalogue="Cars"), init=init))
    only = next(actor for actor in scenario.actors if actor.name == "only")
    assert only.state is not None
    assert only.state.at.x.si == pytest.approx(200 + _FRONT_M)


def test_a_loop_is_driven_round(tmp_path: Path) -> None:
    ring = """<OpenDRIVE><header revMajor="1" revMinor="4" name="ring" version="1"/>
      <road name="r" length="251.327" id="1" junction="-1">
      <link><predecessor elementType="road" elementId="1" contactPoint="end"/>
        <successor elementType="road" elementId="1" contactPoint="start"/></link>
      <planView><geometry s="0" x="0" y="-40" hdg="0" length="251.327"><arc curvature="0.025"/></geometry></planView>
      <lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>
        <lane id="-1" type="driving"><link><predecessor id="-1"/><successor id="-1"/></link>
          <width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection></lanes></road></OpenDRIVE>"""
    text = osc.scenario().replace('laneId="-2" s="50"', 'laneId="-1" s="20"').replace('dLane="1"', 'dLane="0"')
    text = text.replace('x="300" y="-8.5"', 'x="0" y="-46"')
    file = osc.write(tmp_path / "in", text, road=ring)
    importer.run(file, out=tmp_path / "out")
    target = load_test_case(tmp_path / "out" / "cut_in.foresee").scenario.actors[1]
    (path,) = [item for item in target.body if isinstance(item, m.Path)]
    places = [(point.x.si, point.y.si) for point in path.points if isinstance(point, m.Point)]
    assert sum(math.dist(a, b) for a, b in itertools.pairwise(places)) > 600


def test_a_vehicle_that_somebody_slower_would_hold_up_keeps_its_speed(tmp_path: Path) -> None:
    """As a default controller would drive it, also one that changes lanes."""
    slow = osc._CAR.format(name="Slow", catalogue="Cars")
    init = f"""<Private entityRef="Slow">{osc.teleport('<LanePosition roadId="1" laneId="-1" s="100"/>')}</Private>"""
    _, scenario = imported(tmp_path / "keeps", osc.scenario(entities=slow, init=init))
    target = next(actor for actor in scenario.actors if actor.name == "target_1")
    (path,) = [item for item in target.body if isinstance(item, m.Path)]
    assert all(isinstance(point, m.Point) and point.y.si == -1.75 for point in path.points)  # type: ignore[union-attr]
    text = osc.scenario(entities=slow, init=init, events=osc.group("Target-1", osc.event("in", osc.lane_change(-1))))
    _, scenario = imported(tmp_path / "changes", text)
    target = next(actor for actor in scenario.actors if actor.name == "target_1")
    assert any(isinstance(item, m.Path) for item in target.body)


def test_without_a_name_the_ego_is_the_first_vehicle_on_a_lane(tmp_path: Path) -> None:
    text = (
        osc.scenario()
        .replace('"Ego"', '"First"')
        .replace('laneId="-2" s="50" offset="0"', 'laneId="-2" s="50" offset="-6"')
    )
    _, scenario = imported(tmp_path, text)
    assert [actor.name for actor in scenario.actors] == ["ego", "first", "walker"]


_BESIDE_EGO = """<DistanceCondition value="20" freespace="false" rule="{rule}"><Position>
  <RelativeObjectPosition entityRef="Ego" dx="0" dy="0"/></Position></DistanceCondition>"""
_LANE_PLACE = """<ReachPositionCondition tolerance="8"><Position>
  <RelativeLanePosition entityRef="Ego" dLane="1" ds="{ds}"/></Position></ReachPositionCondition>"""


@pytest.mark.parametrize(
    ("inner", "said"),
    [
        (_BESIDE_EGO.format(rule="lessThan"), "distance(target_1, ego) < 15.4 m"),
        (_LANE_PLACE.format(ds=30), "target_1 within 4.3 m of 26.3 m ahead of ego offset 3.5 m"),
        (
            '<DistanceCondition value="2" freespace="true" rule="lessThan"><Position>'
            '<RelativeObjectPosition entityRef="Ego" dx="20" dy="-1"/></Position></DistanceCondition>',
            "target_1 within 2 m of 16.3 m ahead of ego offset -1 m",
        ),
        (
            '<RelativeDistanceCondition entityRef="Ego" value="5" freespace="false" rule="greaterThan" '
            'relativeDistanceType="longitudinal"/>',
            "overlap(target_1, ego) < -0.4 m",
        ),
    ],
)
def test_a_place_of_an_entity_that_moves_goes_with_it(tmp_path: Path, inner: str, said: str) -> None:
    text = events(osc.event("e", osc.speed_action("3"), osc.of_entity("Target-1", inner)))
    done, scenario = imported(tmp_path, text)
    assert not done.lost
    assert whens(scenario) == [f"when {said} {{ target_1 changes speed to 3 m/s over 0.05 s }}"]


@pytest.mark.parametrize(
    ("rule", "said"),
    [
        ("lessThan", "ttc_along(target_1, ego) < 3 s"),
        ("greaterThan", "ttc_along(target_1, ego) > 3 s and ttc_along(target_1, ego) < 3600 s"),
    ],
)
def test_a_time_to_collision_along_the_road_is_one_in_any_lane(tmp_path: Path, rule: str, said: str) -> None:
    """A cut-in begins in another lane, where two footprints never touch. Where the two draw apart there is no such
    time, and no rule holds."""
    target = '<TimeToCollisionConditionTarget><EntityRef entityRef="Ego"/></TimeToCollisionConditionTarget>'
    inner = f"""<TimeToCollisionCondition value="3" freespace="true" rule="{rule}"
        relativeDistanceType="longitudinal" coordinateSystem="road">{target}</TimeToCollisionCondition>"""
    text = events(osc.event("e", osc.speed_action("3"), osc.of_entity("Target-1", inner)))
    done, scenario = imported(tmp_path, text)
    assert not done.lost
    assert whens(scenario) == [f"when {said} {{ target_1 changes speed to 3 m/s over 0.05 s }}"]


def test_a_place_of_a_moving_entity_is_where_that_is_when_the_event_asks(tmp_path: Path) -> None:
    """The target stands 25 m ahead beside the ego's lane, and drives off when the ego is 10 m away (9.4 m along)."""
    inner = _BESIDE_EGO.format(rule="lessThan").replace('value="20"', 'value="10"')
    text = events(osc.event("e", osc.speed_action("3"), osc.of_entity("Target-1", inner, edge="rising")))
    imported(tmp_path, text.replace("${$pace + 2}", "0").replace('value="25" rule', 'value="3" rule'))
    trace = run_test_case(load_test_case(tmp_path / "out" / "cut_in.foresee"), "idm", 0).trace
    ego, target = trace.index("ego"), trace.index("target_1")
    starts = int(np.flatnonzero(trace.states[:, target, SPEED] > 0.01)[0])
    assert trace.states[starts, target, X] - trace.states[starts, ego, X] == pytest.approx(9.4, abs=0.8)


def test_a_place_that_turns_with_the_world_is_lost_where_its_entity_moves(tmp_path: Path) -> None:
    inner = _BESIDE_EGO.replace("RelativeObjectPosition", "RelativeWorldPosition").replace('dx="0"', 'dx="9"')
    event = osc.event("e", osc.speed_action("3"), osc.of_entity("Target-1", inner.format(rule="lessThan")))
    done, _ = imported(tmp_path, events(event), partial=True)
    assert done.lost == {"positions: RelativeWorldPosition (of an entity that moves)": 1}


_NEAR_EGO = (
    '<RelativeDistanceCondition entityRef="Ego" value="{value}" freespace="true" rule="lessThan" '
    'relativeDistanceType="cartesianDistance"/>'
)


@pytest.mark.parametrize(
    ("value", "edge", "said"),
    [  # 25 m of reference points are 20.55 m between the footprints
        ("40", "rising", "distance(target_1, ego) < 40 m and not distance(target_1, ego) < 40 m for 0.05 s"),
        ("10", "rising", "distance(target_1, ego) < 10 m"),
        ("40", "none", "distance(target_1, ego) < 40 m"),
        (
            "40",
            "risingOrFalling",
            "distance(target_1, ego) < 40 m and not distance(target_1, ego) < 40 m for 0.05 s or "
            "not distance(target_1, ego) < 40 m and not (not distance(target_1, ego) < 40 m) for 0.05 s",
        ),
    ],
)
def test_an_edge_is_not_a_condition_that_holds_from_the_beginning(
    tmp_path: Path, value: str, edge: str, said: str
) -> None:
    inner = osc.of_entity("Target-1", _NEAR_EGO.format(value=value), edge=edge)
    done, scenario = imported(tmp_path, events(osc.event("e", osc.speed_action("3"), inner)))
    assert not done.lost
    assert whens(scenario) == [f"when {said} {{ target_1 changes speed to 3 m/s over 0.05 s }}"]


@pytest.mark.parametrize(("edge", "slows"), [("rising", False), ("none", True)])
def test_a_rising_edge_does_not_fire_where_the_condition_holds_at_the_start(
    tmp_path: Path, edge: str, slows: bool
) -> None:
    inner = osc.of_entity("Target-1", _NEAR_EGO.format(value="40"), edge=edge)
    text = events(osc.event("e", osc.speed_action("3"), inner)).replace('value="25" rule', 'value="2" rule')
    imported(tmp_path, text)
    trace = run_test_case(load_test_case(tmp_path / "out" / "cut_in.foresee"), "idm", 0).trace
    assert (trace.states[-1, trace.index("target_1"), SPEED] < 4) == slows


def _crossing(domain: str = "relative", offset: float = 0.0, start: float = -8.5) -> str:
    vertices = "".join(
        f'<Vertex time="{2 * k}"><Position><WorldPosition x="300" y="{start + 3 * k}" h="1.5708"/></Position></Vertex>'
        for k in range(3)
    )
    follow = f"""<RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="t" closed="false">
      <Shape><Polyline>{vertices}</Polyline></Shape></Trajectory></TrajectoryRef>
      <TimeReference><Timing domainAbsoluteRelative="{domain}" scale="1" offset="{offset}"/></TimeReference>
    </FollowTrajectoryAction></RoutingAction>"""
    return osc.scenario(events=osc.group("walker", osc.event("goes", follow, on_time(1))))


@pytest.mark.parametrize(("domain", "offset"), [("relative", 0.0), ("absolute", 1.0)])
def test_a_timed_trajectory_in_an_event_begins_with_the_event(tmp_path: Path, domain: str, offset: float) -> None:
    """1.5 m/s from 1 s on: nothing before, 3 m at 3 s."""
    done, _ = imported(tmp_path, _crossing(domain, offset).replace('value="25" rule', 'value="3.5" rule'))
    assert not done.lost
    trace = run_test_case(load_test_case(tmp_path / "out" / "cut_in.foresee"), "idm", 0).trace
    y = trace.states[:, trace.index("walker"), Y]
    assert y[trace.frame_at(1.0)] == pytest.approx(-8.5, abs=0.01)
    assert y[trace.frame_at(3.0)] == pytest.approx(-5.5, abs=0.15)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (_crossing("absolute", -1.0), "trajectories that begin before their action does"),
        (_crossing(start=-4.0), "trajectories that begin away from where the actor stands"),
    ],
)
def test_a_trajectory_that_an_event_cannot_begin_is_lost(tmp_path: Path, text: str, said: str) -> None:
    done, _ = imported(tmp_path, text, partial=True)
    assert done.lost == {said: 1}


def test_a_second_way_of_one_actor_is_lost(tmp_path: Path) -> None:
    way = "<RoutingAction><AcquirePositionAction><Position><LanePosition roadId='1' laneId='-1' s='{s}'/></Position>" \
          "</AcquirePositionAction></RoutingAction>"  # fmt: skip
    done, _ = imported(
        tmp_path, events(*(osc.event(f"e{s}", way.format(s=s), on_time(s / 100)) for s in (300, 400))), partial=True
    )
    assert done.lost == {"actions: AcquirePositionAction (a second way of the same actor)": 1}


def test_a_folder_of_maps_gives_the_map_before_a_net_that_was_made_of_it(tmp_path: Path) -> None:
    file, maps = osc.write(tmp_path / "in", osc.scenario()), tmp_path / "maps"
    maps.mkdir()
    (tmp_path / "in" / "straight.xodr").rename(maps / "straight.xodr")
    (maps / "straight.net.xml").write_text("<net/>")
    file.write_text(file.read_text().replace('"straight.xodr"', '"straight"'))
    done = importer.run(file, out=tmp_path / "out", road=maps)
    assert "straight_map.xodr" in {path.name for path in done.files}


# ---- nothing is lost in silence -------------------------------------------------------------------------------------

_LIGHT = "<AppearanceAction><LightStateAction/></AppearanceAction>"


def test_an_import_that_loses_something_fails_unless_it_may(tmp_path: Path) -> None:
    text = events(osc.event("swerve", _LIGHT, on_time(2)), osc.event("slow", osc.speed_action("3"), on_time(5)))
    file, out = osc.write(tmp_path / "in", text), tmp_path / "out"
    refused = CliRunner().invoke(app, ["import", "openscenario", str(file), "--out", str(out)])
    assert refused.exit_code == 1
    assert "1 actions: LightStateAction" in str(refused.exception)
    assert "--partial" in str(refused.exception)
    assert not out.exists()
    taken = CliRunner().invoke(app, ["import", "openscenario", str(file), "--out", str(out), "--partial"])
    assert taken.exit_code == 0
    assert "lost:\n  1 actions: LightStateAction" in taken.stdout
    written = (out / "cut_in.foresee").read_text()
    assert "  # Lost: actions: LightStateAction, event 'swerve' of Target-1, Target-1.\n  when time > 5 s {" in written


def test_an_event_that_waits_for_what_is_lost_is_lost_too_and_said(tmp_path: Path) -> None:
    far = osc.of_entity("Ego", '<OffroadCondition duration="1"/>')
    text = events(
        osc.event("far", osc.speed_action("3"), far),
        osc.event("then", osc.speed_action("4"), on_state("event", "far", "endTransition")),
    )
    done, scenario = imported(tmp_path, text, partial=True)
    assert done.lost == {"conditions: OffroadCondition": 1, "events that wait for what is lost": 1}
    assert not whens(scenario)
