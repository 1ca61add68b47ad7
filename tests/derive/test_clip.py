import math
from dataclasses import replace

import numpy as np
import pytest

from foresee_dsl.derive.clipping.clip import clip, goal
from foresee_dsl.derive.clipping.snapshot import edges_driven, has_passed, remaining_route
from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.model import (
    ChangesLane,
    ChangesSpeed,
    Comparison,
    CruiseSpeed,
    Delay,
    EdgeRoute,
    Ego,
    Goal,
    Ignores,
    IgnoresRule,
    Measure,
    Meets,
    MeetsState,
    Path,
    SignalState,
    Starts,
    Steers,
    Stops,
    Timing,
    Walked,
    When,
    Window,
)
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.simulate.trace import STEER
from foresee_dsl.simulate.trigger_record import ActorOrders, DirectorRecord, TriggerState, add
from tests.support.handmade_traces import EAST, SOUTH, make_trace, straight, until
from tests.support.situations import Actor, case_with, crossing, risky, walker
from tests.support.worlds import q


def cut(trace, at_s=11.0, actor="runner", case=None, before_s=5.0, after_s=5.0, fired=()):
    case = case or case_with()
    found = clip(
        case,
        replace(trace, director=record_of(case.scenario, fired)),
        risky(trace, actor, at_s),
        before_s=before_s,
        after_s=after_s,
        name="runs_r02_p1",
        parent="runs.foresee",
    )
    assert parse(print_model(found), "clip.foresee").model == found
    return found


def of(found, kind):
    return [item for item in found.body if isinstance(item, kind)]


def actor(found, name):
    return next(item for item in of(found, Actor) if item.name == name)


def has(found, name, kind):
    return [item for item in actor(found, name).body if isinstance(item, kind)]


def record_of(scenario, fired):
    """What a director would record of triggers (number, time, s) that fire; the rest of them does not."""
    whens = scenario.all(When)
    triggers = [[TriggerState(0.0, None, False, {}, None)] for _ in whens]
    orders = {}
    for index, time_s in fired:
        add(triggers[index], TriggerState(time_s, time_s, True, {}, None))
        for action in whens[index].actions:
            states = orders.setdefault(action.actor, [])
            add(states, (states[-1] if states else ActorOrders()).after(action, time_s))
    return DirectorRecord(tuple(map(tuple, triggers)), {actor: tuple(states) for actor, states in orders.items()})


def when(*actions, limit="2 s", what="time", **measure):
    return When(condition=Comparison(left=Measure(what=what, **measure), op=">", right=q(limit)), actions=actions)


RUNNER = Actor(kind="vehicle", name="runner", model="car.compact")


def test_a_clip_says_where_everyone_is_at_its_first_frame():
    found = cut(make_trace(crossing()))
    (window,) = of(found, Window)
    assert (window.start, window.end) == (q("6.00 s"), q("16.00 s"))
    assert (found.case, found.parent, found.pin) == ("r02", "runs.foresee", pin_of(case_with()))
    (ego,) = of(found, Ego)
    # 6 s at 5 m/s, and half of 4 m from the middle to the front bumper.
    assert (ego.state.at.x, ego.state.at.y) == (q("32.000 m"), q("0.000 m"))
    assert ego.state.speed == q("5.000 m/s")
    assert ego.body == (EdgeRoute(edges=("west", "east_back")),)
    runner = actor(found, "runner")
    assert (runner.state.at.x, runner.state.at.y) == (q("50.000 m"), q("-22.000 m"))
    assert runner.state.heading == q("90.000 deg")
    assert runner.body == (EdgeRoute(edges=("south", "north_back")), CruiseSpeed(speed=q("4.000 m/s")))
    assert found.risk.actor == "runner"
    assert found.risk.at == q("11.00 s")


def test_a_window_is_bounded_by_the_run():
    (window,) = of(cut(make_trace(crossing()), at_s=18.0), Window)
    assert (window.start, window.end) == (q("13.00 s"), q("20.00 s"))


def test_a_frame_outside_the_run_is_refused():
    trace = make_trace(crossing())
    with pytest.raises(ValueError, match="401 frames"):
        clip(
            case_with(),
            trace,
            replace(risky(trace, "runner", 5.0), frame=500),
            before_s=5,
            after_s=5,
            name="x",
            parent="y",
        )


def test_all_actors_that_are_there_are_restored_and_no_others():
    far = straight("van", 400, 300, SOUTH, 9)
    gone = until(straight("car", 10, 50, EAST, 9), 3.0)
    found = cut(make_trace(crossing(far=far, gone=gone, box=straight("obstacle", 70, 2, EAST, 0))))
    assert [a.name for a in of(found, Actor)] == ["runner", "far", "box"]
    box = actor(found, "box")
    assert (box.kind, box.state.at.x, box.body) == ("obstacle", q("70.000 m"), ())  # its middle, not its front


def test_path_followers_say_how_far_they_have_come():
    found = cut(make_trace(crossing(walker=walker(60, -8, math.pi / 2, 1.4))), actor="walker")
    assert has(found, "walker", Walked)[0].along == q("8.400 m")
    (path,) = has(found, "walker", Path)
    assert [(p.x.si, p.y.si) for p in path.points] == [(60, -8), (60, 32)]
    assert actor(found, "walker").state.at.y == q("0.400 m")
    assert actor(found, "walker").state.acceleration is None


def test_the_remaining_route_begins_where_the_actor_is():
    lanes = ("south_0",) * 100 + (":j4_3_0",) * 40 + ("mid_1",) * 60 + (":j5_1_0",) * 20 + ("south_0",) * 181
    runner = crossing()["runner"]
    trace = make_trace(crossing(runner=replace(runner, route=("south", "mid", "south"), lanes=lanes)))
    assert remaining_route(trace, 1, 0) == ("south", "mid", "south")
    assert remaining_route(trace, 1, 120) == ("south", "mid", "south")  # on the junction: the edge before it
    assert remaining_route(trace, 1, 150) == ("mid", "south")
    assert remaining_route(trace, 1, 210) == ("mid", "south")
    assert remaining_route(trace, 1, 300) == ("south",)
    assert edges_driven(trace, 1, 150) == ["south", ":j4_3", "mid"]
    assert not has_passed(trace, 1, "j4", 120)
    assert has_passed(trace, 1, "j4", 150)


def test_the_goal_is_the_nearest_waypoint_and_never_behind():
    waypoints = np.array([[2.0 * k, 0.0] for k in range(60)])
    trace = make_trace(crossing(), waypoints=waypoints)
    assert goal(trace, 0, 200) == (52.0, 0.0)  # the front is at 52 m
    assert goal(trace, 0, 202) == (54.0, 0.0)  # at 52.5 m: 52 m would be nearer
    assert of(cut(trace), Goal)[0].at.x == q("82.000 m")


def test_a_goal_lies_on_the_part_of_the_route_that_was_driven():
    # The route comes back over itself: waypoint 100 lies where waypoint 25 does.
    out = [[2.0 * k, 0.0] for k in range(60)]
    trace = make_trace(crossing(), waypoints=np.array(out + [[2.0 * k, 0.1] for k in range(60)]))
    assert goal(trace, 0, 200) == (52.0, 0.0)


def test_signals_show_their_stage_and_since_when():
    trace = make_trace(crossing(), signals={"j4": (("ns_go", "ew_go"), 1, 3.25)})
    assert of(cut(trace), SignalState) == [SignalState(junction="j4", stage="ew_go", elapsed=q("9.25 s"))]


def test_what_a_trigger_told_is_in_force_and_the_trigger_is_gone():
    meets = Meets(actor="runner", other="ego", junction="j4", gap=q("2.1 s"))
    ignores = Ignores(actor="runner", what="signals", junction="j4")
    case = case_with(RUNNER, when(meets, ignores))
    found = cut(make_trace(crossing()), fired=[(0, 2.0)], case=case)
    assert has(found, "runner", MeetsState) == [MeetsState(other="ego", junction="j4", gap=q("2.1 s"))]
    assert has(found, "runner", IgnoresRule) == [IgnoresRule(what="signals", junction="j4")]
    assert of(found, When) == []


def test_what_is_over_behind_a_junction_is_not_written():
    runner = replace(crossing()["runner"], lanes=("south_0",) * 40 + (":j4_3_0",) * 40 + ("north_back_0",) * 400)
    ignores = Ignores(actor="runner", what="signals", junction="j4")
    trace = make_trace(crossing(runner=runner))
    assert has(cut(trace, fired=[(0, 1.0)], case=case_with(RUNNER, when(ignores))), "runner", IgnoresRule) == []


def test_pending_triggers_stay_with_times_counted_from_the_window():
    stops = Stops(actor="runner")
    case = case_with(
        RUNNER, when(stops, limit="9 s"), when(stops, limit="3 m", what="distance", actor="ego", other="runner")
    )
    found = cut(make_trace(crossing()), case=case)
    assert [w.condition.right for w in of(found, When)] == [q("3.00 s"), q("3 m")]


def test_a_trigger_that_fires_after_the_window_begins_is_pending():
    case = case_with(RUNNER, when(Stops(actor="runner"), limit="9 s"))
    found = cut(make_trace(crossing()), fired=[(0, 9.05)], case=case)
    assert len(of(found, When)) == 1


def test_triggers_about_actors_that_are_gone_are_dropped():
    gone = until(straight("car", 10, 50, EAST, 9), 3.0)
    about_gone = when(Stops(actor="runner"), limit="3 m", what="distance", actor="ego", other="gone")
    mixed = when(Stops(actor="gone"), Stops(actor="runner"), limit="9 s")
    found = cut(make_trace(crossing(gone=gone)), case=case_with(RUNNER, about_gone, mixed))
    (left,) = of(found, When)
    assert left.actions == (Stops(actor="runner"),)


def test_an_actor_that_has_started_does_not_wait_for_another_trigger():
    case = case_with(
        RUNNER, when(Starts(actor="walker")), when(Starts(actor="walker"), Stops(actor="runner"), limit="9 s")
    )
    trace = make_trace(crossing(walker=walker(60, -8, math.pi / 2, 1.4, start_s=2)))
    (left,) = of(cut(trace, case=case, fired=[(0, 2.0)]), When)
    assert left.actions == (Stops(actor="runner"),)


@pytest.mark.parametrize(
    ("told_s", "expected"), [(None, q("1.5 s")), (5.5, q("1.00 s")), (2.0, None)], ids=["waits", "told", "over"]
)
def test_a_delay_counts_from_the_trigger(told_s, expected):
    source = Actor(kind="pedestrian", name="walker", model="pedestrian.adult", body=(Delay(time=q("1.5 s")),))
    case = case_with(RUNNER, source, when(Starts(actor="walker")))
    fired = [] if told_s is None else [(0, told_s)]
    trace = make_trace(crossing(walker=walker(60, -8, math.pi / 2, 1.4, start_s=9)))
    assert [d.time for d in has(cut(trace, case=case, fired=fired), "walker", Delay)] == (
        [expected] if expected else []
    )


def test_a_finished_change_of_speed_is_the_new_cruise_speed():
    change = ChangesSpeed(actor="runner", to=q("18 km/h"), over=q("2 s"))
    found = cut(make_trace(crossing()), fired=[(0, 2.0)], case=case_with(RUNNER, when(change)))
    assert has(found, "runner", CruiseSpeed) == [CruiseSpeed(speed=q("18 km/h"))]
    assert of(found, When) == []


def test_a_change_of_speed_goes_on_for_what_is_left_of_it():
    change = ChangesSpeed(actor="runner", to=q("18 km/h"), over=q("5 s"))
    found = cut(make_trace(crossing()), fired=[(0, 2.0)], case=case_with(RUNNER, when(change)))
    (resumed,) = of(found, When)
    assert resumed.condition == Comparison(left=Measure(what="time"), op=">=", right=q("0.00 s"))
    assert resumed.actions == (ChangesSpeed(actor="runner", to=q("18 km/h"), over=q("1.00 s")),)


@pytest.mark.parametrize(("duration", "left"), [(None, None), ("4 s", "1.50 s"), ("1 s", "over")])
def test_a_stop_counts_from_when_the_actor_stands(duration, left):
    # Told at 2 s, stands from 3.5 s on; the window begins at 6 s.
    states = crossing()["runner"].states.copy()
    states[70:, 3] = 0.0
    runner = replace(crossing()["runner"], states=states)
    stops = Stops(actor="runner", duration=q(duration) if duration else None)
    found = cut(make_trace(crossing(runner=runner)), fired=[(0, 2.0)], case=case_with(RUNNER, when(stops)))
    expected = [] if left == "over" else [(Stops(actor="runner", duration=q(left) if left else None),)]
    assert [w.actions for w in of(found, When)] == expected


def test_a_later_command_replaces_a_meeting():
    meets = Meets(actor="runner", other="ego", junction="j4", gap=q("2.1 s"))
    case = case_with(RUNNER, when(meets), when(Stops(actor="runner")))
    found = cut(make_trace(crossing()), fired=[(0, 2.0), (1, 4.0)], case=case)
    assert has(found, "runner", MeetsState) == []
    assert [w.actions for w in of(found, When)] == [(Stops(actor="runner"),)]


@pytest.mark.parametrize(("lane", "count"), [("south_0", 1), ("south_1", 0)])
def test_a_change_of_lane_that_is_not_done_is_asked_for_again(lane, count):
    runner = replace(crossing()["runner"], lanes=("south_0",) * 80 + (lane,) * 400)
    case = case_with(RUNNER, when(ChangesLane(actor="runner", side="left")))
    assert len(of(cut(make_trace(crossing(runner=runner)), fired=[(0, 2.0)], case=case), When)) == count


def test_what_the_author_gave_an_actor_goes_on():
    body = (
        CruiseSpeed(speed=q("50 km/h")),
        Timing(factor=q("0.8")),
        Steers(value=q("0.1"), start=q("5.5 s"), duration=q("1 s")),
        IgnoresRule(what="priority"),
    )
    found = cut(make_trace(crossing()), case=case_with(RUNNER.model_copy(update={"body": body})))
    kept = actor(found, "runner")
    assert kept.state.speed == q("5.000 m/s")  # 4 m/s driven: `timing 0.8` scales what a file says
    assert has(found, "runner", CruiseSpeed) == [body[0]]
    assert has(found, "runner", Timing) == [body[1]]
    assert has(found, "runner", Steers) == [Steers(value=q("0.1"), start=q("0.00 s"), duration=q("0.50 s"))]
    assert has(found, "runner", IgnoresRule) == [body[3]]


def test_steering_that_is_over_is_not_written():
    body = (Steers(value=q("0.1"), start=q("1 s"), duration=q("1 s")),)
    found = cut(make_trace(crossing()), case=case_with(RUNNER.model_copy(update={"body": body})))
    assert has(found, "runner", Steers) == []


def test_a_scenario_without_cases_gives_a_clip_without_case():
    assert cut(make_trace(crossing()), case=case_with(case="")).case is None


def test_a_point_without_actor_names_none():
    assert cut(make_trace(crossing()), actor="").risk.actor is None


def test_a_clip_of_twenty_actors_is_short():
    queue = {
        f"others_{k:02}": replace(
            straight("car", -8.0 * k, 3.5, EAST, 5), route=("west", "east"), lanes=("west_0",), cruise_mps=13.9
        )
        for k in range(18)
    }
    text = print_model(cut(make_trace(crossing(**queue), signals={f"j{k}": (("a",), 0, 0.0) for k in range(9)})))
    assert len(text.splitlines()) < 120


def test_the_egos_wheels_are_turned_as_they_were_and_others_are_not():
    trace = make_trace(crossing())
    trace.states[:, 0, STEER] = np.linspace(-0.2, 0.2, trace.frames)
    trace.states[:, 1, STEER] = 0.1
    found = cut(trace)
    frame = trace.frame_at(found.start_s)
    assert of(found, Ego)[0].state.steer.si == pytest.approx(trace.states[frame, 0, STEER], abs=1e-4)
    assert actor(found, "runner").state.steer is None
