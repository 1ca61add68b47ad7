"""Cut a clip out of a run: the seconds around a risky point, as a file that rebuilds them exactly.

All actors of the first frame are restored, not only those near the ego: with those within 120 m alone, one in ten
deviated by over 0.5 m after 10 s, because who follows whom reaches far along a queue.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from foresee_dsl.derive.clipping.actions_under_way import at_once, rest_of, still_to_change, under_way
from foresee_dsl.derive.clipping.snapshot import authored, front, has_passed, present, remaining_route
from foresee_dsl.derive.clipping.trigger_state import Script, Told, held_back, script_at
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.forecast.settings import VEHICLE_KINDS
from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.model import (
    Action,
    Actor,
    ActorItem,
    ChangesSpeed,
    Clip,
    ClipItem,
    Comparison,
    CruiseSpeed,
    Delay,
    EdgeRoute,
    Ego,
    Goal,
    IgnoresRule,
    Line,
    Measure,
    Meets,
    MeetsState,
    Path,
    Point,
    Quantity,
    Recorded,
    Risk,
    SignalState,
    Starts,
    State,
    Steers,
    Stops,
    Timing,
    Value,
    Walked,
    When,
    Window,
)
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.traversal import all_actions, word_of
from foresee_dsl.language.units import Dimension
from foresee_dsl.simulate.actors.speed_orders import MET_M
from foresee_dsl.simulate.trace import ACCELERATION, HEADING, SPEED, STEER, STEP_S, ActorInfo, Trace, X, Y

DIGITS = 4
"""Decimals of metres, m/s and degrees in a clip. Ours, measured on the 65 clips of the bundled scenarios: with 3, the
driver decides otherwise in 5 of them (up to 0.64 m after 10 s); with 4 everybody stays within 1 cm, with 6 exactly."""
RECORDED_EVERY_S = 0.05
"""The ego's states of a hand-over: at each frame. Ours: with every second one it is millimetres off in between."""
PLANS_EVERY_S = 0.2
"""A clip with a hand-over begins at a multiple of this in the run. Ours: a driver that plans 5 or 10 times a second
then plans at the same moments as in the run."""
DRIVES_S = 1.0
"""The driver drives for so long before the risky point, at least. Ours: a mutation's onset in the preset `focused`."""
_WAYPOINT_M = 2.0
"""The spacing of `Trace.waypoints`."""


def clip(
    case: TestCase,
    trace: Trace,
    point: RiskyPoint,
    *,
    before_s: float,
    after_s: float,
    name: str,
    parent: str,
    handover_s: float = 0.0,
) -> Clip:
    """Make the clip of the window [point - before_s, point + after_s], bounded by the run.

    Args:
        case: what was run.
        trace: its run.
        point: around which moment.
        before_s: o_b. after_s: o_a (paper, section 3.3).
        name: the clip's name.
        parent: the case's file as the clip's file names it.
        handover_s: for so long the ego follows its recorded states while its driver watches. A clip that begins where
            its parent's run did needs none and has none.

    Returns:
        The clip, without a fidelity line (see `fidelity.with_fidelity`).

    Raises:
        ValueError: the trace has no such frame, or the hand-over ends less than `DRIVES_S` before the risky point.
    """
    if not 0 <= point.frame < trace.frames:
        raise ValueError(f"the run has {trace.frames} frames, none is {point.frame}")
    if handover_s > max(before_s - DRIVES_S, 0.0):
        raise ValueError(
            f"a hand-over of {handover_s:g} s is too long: it has to end {DRIVES_S:g} s before the risky point, which "
            f"is {before_s:g} s after the clip's beginning"
        )
    first = max(0, point.frame - round(before_s / STEP_S))
    if handover_s > 0:
        first -= first % round(PLANS_EVERY_S / STEP_S)
    last = min(trace.frames - 1, point.frame + round(after_s / STEP_S))
    return Clip(
        name=name,
        parent=parent,
        case=case.id.partition("::")[2] or None,
        pin=pin_of(case),
        body=_body(case, trace, point, first, last, round(handover_s / STEP_S) if first else 0),
    )


def goal(trace: Trace, first: int, last: int) -> tuple[float, float]:
    """Return the waypoint nearest to where the ego was at frame `last`, never behind it, m.

    Only waypoints that it can have reached since frame `first` are looked at, as a route may cross itself. Without
    waypoints it is the ego's front.
    """
    here = np.array(front(trace, 0, last))
    points = trace.waypoints
    if not len(points):
        return float(here[0]), float(here[1])
    driven_m = float(np.nansum(trace.states[first : last + 1, 0, SPEED])) * STEP_S
    begin = int(np.hypot(*(points - front(trace, 0, first)).T).argmin())
    end = begin + math.ceil(driven_m / _WAYPOINT_M) + 3
    nearest = begin + int(np.hypot(*(points[begin:end] - here).T).argmin())
    heading = trace.states[last, 0, HEADING]
    ahead = (points - here) @ np.array([math.cos(heading), math.sin(heading)])
    while ahead[nearest] < 0 and nearest + 1 < min(end, len(points)):
        nearest += 1
    return float(points[nearest, 0]), float(points[nearest, 1])


def _body(
    case: TestCase, trace: Trace, point: RiskyPoint, first: int, last: int, handover: int
) -> tuple[ClipItem, ...]:
    start_s = float(trace.time_s[first])
    here = present(trace, first)
    gone = frozenset(info.id for k, info in enumerate(trace.actors) if k not in here)
    script = script_at(case.scenario, trace, first)
    written = authored(case.scenario)
    running, taken = under_way(script, trace)
    later = [*running, *script.pending]
    later += held_back(script, later)
    waiting = frozenset(a.actor for when in later for a in all_actions(when.actions) if isinstance(a, Starts))
    resumed = [when for k in here if k for when in _resumed(trace, k, first, script, waiting, taken)]
    resumed += [when for k in here if k for when in _kept(trace.actors[k], written, script)]
    actors = [_actor(trace, k, first, written, script, waiting, taken) for k in here if k]
    return (
        Window(start=_seconds(start_s), end=_seconds(float(trace.time_s[last]))),
        Risk(
            text=point.why.replace('"', "'"),
            at=_seconds(float(trace.time_s[point.frame])),
            actor=point.actor if point.actor and point.actor not in gone else None,
        ),
        _ego(case, trace, first, min(first + handover, last)),
        Goal(at=_at(goal(trace, first, last))),
        *actors,
        *_signals(trace, first),
        *resumed,
        *later,
    )


# --- actors ----------------------------------------------------------------------------------------------------------


def _ego(case: TestCase, trace: Trace, frame: int, drives_from: int) -> Ego:
    info = trace.actors[0]
    authored_ego = case.scenario.one(Ego)
    kept = [item for item in (authored_ego.body if authored_ego else ()) if isinstance(item, CruiseSpeed)]
    route = remaining_route(trace, 0, frame)
    body: list[ActorItem] = [EdgeRoute(edges=route)] if route else []
    return Ego(
        model=info.model, state=_state(trace, 0, frame), body=(*body, *kept, *_recorded(trace, frame, drives_from))
    )


def _recorded(trace: Trace, first: int, drives_from: int) -> tuple[Recorded, ...]:
    """Return the ego's states after a frame, up to that from which its driver drives."""
    step = round(RECORDED_EVERY_S / STEP_S)
    frames = [*range(first + step, drives_from, step), drives_from] if drives_from > first else []
    return tuple(Recorded(time=_seconds((k - first) * STEP_S), state=_state(trace, 0, k)) for k in frames)


def _actor(
    trace: Trace,
    actor: int,
    frame: int,
    written: dict[str, Actor],
    script: Script,
    waiting: frozenset[str],
    taken: frozenset[tuple[str, str]],
) -> Actor:
    info, now_s = trace.actors[actor], float(trace.time_s[frame])
    source, told = written.get(info.id), script.of(info.id)
    return Actor(
        kind=_kind(info),
        name=info.id,
        model=info.model,
        state=_state(trace, actor, frame, _timing(source)),
        body=(
            *_way(trace, actor, frame),
            *_speed(info, source, told),
            *_rules(trace, actor, frame, source, replace(told, command=None) if (info.id, "speed") in taken else told),
            *_offsets(source, told, now_s, waits=info.id in waiting, on_path=bool(info.path)),
        ),
    )


def _kind(info: ActorInfo) -> Literal["vehicle", "bicycle", "pedestrian", "obstacle"]:
    if info.kind == "bicycle":
        return "bicycle"
    if info.kind == "pedestrian":
        return "pedestrian"
    return "obstacle" if info.kind == "obstacle" else "vehicle"


def _timing(source: Actor | None) -> float:
    """Return the factor on an actor's speeds that its author wrote."""
    found = next((item.factor for item in (source.body if source else ()) if isinstance(item, Timing)), None)
    return found.si if isinstance(found, Quantity) and found.si > 0 else 1.0


def _state(trace: Trace, actor: int, frame: int, timing: float = 1.0) -> State:
    info, row = trace.actors[actor], trace.states[frame, actor]
    wheels = info.kind in VEHICLE_KINDS  # placed by the front; a pedestrian or an obstacle by its middle
    acceleration, steer = float(row[ACCELERATION]), float(row[STEER])
    heading = math.remainder(float(row[HEADING]), math.tau)
    return State(
        at=_at(front(trace, actor, frame) if wheels else (float(row[X]), float(row[Y]))),
        heading=_quantity(heading, "angle"),
        speed=_quantity(float(row[SPEED]) / timing, "speed"),  # `timing` scales the speed that a file says
        # A path-follower's acceleration decides nothing, as its speed is given; SUMO goes on from a vehicle's.
        acceleration=_unless_zero(acceleration, "acceleration") if wheels and not info.path else None,
        steer=_unless_zero(steer, "angle") if actor == 0 else None,
    )


def _way(trace: Trace, actor: int, frame: int) -> tuple[ActorItem, ...]:
    info = trace.actors[actor]
    if info.path:
        points, along = tuple(_at(p) for p in info.path), float(trace.along[frame, actor])
        return Path(points=points), Walked(along=_quantity(0.0 if math.isnan(along) else along, "length"))
    route = remaining_route(trace, actor, frame)
    return (EdgeRoute(edges=route),) if route else ()


def _speed(info: ActorInfo, source: Actor | None, told: Told) -> tuple[ActorItem, ...]:
    """Return the cruise speed: what it keeps near a junction, or what it drives otherwise."""
    cruise = _cruise(info, source, told) if told.keeps_mps is None else _quantity(told.keeps_mps, "speed")
    return (CruiseSpeed(speed=cruise),) if cruise is not None else ()


def _cruise(info: ActorInfo, source: Actor | None, told: Told) -> Value | None:
    """Return what it was told last, what the author wrote, or what it drives."""
    if told.cruise is not None:
        return told.cruise
    written = next((item.speed for item in (source.body if source else ()) if isinstance(item, CruiseSpeed)), None)
    return written or (_quantity(info.cruise_mps, "speed") if info.cruise_mps > 0 else None)


def _rules(
    trace: Trace, actor: int, frame: int, source: Actor | None, told: Told
) -> tuple[IgnoresRule | MeetsState, ...]:
    """Return what is ignored and who is met, without what is over because the junction lies behind."""
    items: list[IgnoresRule | MeetsState] = [
        item for item in (source.body if source else ()) if isinstance(item, IgnoresRule)
    ]
    items += [IgnoresRule(what=i.what, junction=i.junction) for i in told.ignores]
    if told.command and isinstance(m := told.command[0], Meets) and told.keeps_mps is None:
        items.append(MeetsState(other=m.other, junction=m.junction, gap=m.gap, order=m.order))
    in_force = [i for i in items if i.junction is None or not has_passed(trace, actor, word_of(i.junction), frame)]
    return tuple(dict.fromkeys(in_force))


def _offsets(source: Actor | None, told: Told, now_s: float, *, waits: bool, on_path: bool) -> tuple[ActorItem, ...]:
    """Return what a mutation (or the author) gave the actor, with times counted from the window's beginning."""
    kept: list[ActorItem] = []
    for item in source.body if source else ():
        if isinstance(item, Timing) or (isinstance(item, Line) and not on_path):  # a path has it in its points
            kept.append(item)
        elif isinstance(item, Delay) and isinstance(item.time, Quantity):
            left_s = item.time.si - (now_s - (told.started_s or 0.0))
            if waits:  # the delay begins when it is started
                kept.append(item)
            elif left_s > 0:
                kept.append(Delay(time=_seconds(left_s)))
        elif isinstance(item, Steers):
            kept += _steers_left(item, now_s)
    return tuple(kept)


def _steers_left(item: Steers, now_s: float) -> list[ActorItem]:
    start_s = item.start.si if isinstance(item.start, Quantity) else 0.0
    if not isinstance(item.duration, Quantity):
        left = None
    else:
        left = min(item.duration.si, start_s + item.duration.si - now_s)
        if left <= 0:
            return []
    return [
        Steers(
            value=item.value,
            start=_seconds(max(0.0, start_s - now_s)),
            duration=None if left is None else _seconds(left),
        )
    ]


# --- script and signals ----------------------------------------------------------------------------------------------


def _resumed(
    trace: Trace,
    actor: int,
    frame: int,
    script: Script,
    waiting: frozenset[str],
    taken: frozenset[tuple[str, str]],
) -> tuple[When, ...]:
    """Return a trigger that takes up at once what an actor is in the middle of: a stop, a change of speed or lane.

    What a sequence waits for is `taken` up there.
    """
    again: list[Action] = []
    name = trace.actors[actor].id
    told = script.of(name)
    action, since_s = told.command or (None, 0.0)
    if isinstance(action, ChangesSpeed | Stops) and (name, "speed") not in taken:
        left = rest_of(trace, actor, frame, action, since_s)
        again += [left] if left else []
    elif action is None and told.cruise is not None and name in waiting:
        again.append(ChangesSpeed(actor=name, to=told.cruise))  # it moves, although nobody has started it yet
    if told.lane and (name, "lane") not in taken and still_to_change(trace, actor, frame, told.lane[1]):
        again.append(told.lane[0])
    return (at_once(*again),) if again else ()


def _kept(info: ActorInfo, written: dict[str, Actor], script: Script) -> tuple[When, ...]:
    """Return the trigger that ends what an actor keeps its speed for, where it meets another."""
    told = script.of(info.id)
    meets = told.command[0] if told.command else None
    cruise = _cruise(info, written.get(info.id), told)
    if told.keeps_mps is None or not isinstance(meets, Meets) or cruise is None:
        return ()
    inside = Comparison(
        left=Measure(what="distance", actor=info.id, other=meets.junction), op="<=", right=_quantity(-MET_M, "length")
    )
    return (When(condition=inside, actions=(ChangesSpeed(actor=info.id, to=cruise),)),)


def _signals(trace: Trace, frame: int) -> tuple[SignalState, ...]:
    return tuple(
        SignalState(
            junction=junction,
            stage=trace.signal_stages[k][int(trace.stages[frame, k])],
            elapsed=_seconds(float(trace.elapsed[frame, k])),
        )
        for k, junction in enumerate(trace.signals)
    )


# --- values ----------------------------------------------------------------------------------------------------------


def _seconds(value: float) -> Quantity:
    """Two decimals hold every multiple of the step, 0.05 s, exactly."""
    return Quantity.of(value, "time", 2)


def _quantity(value: float, dimension: Dimension) -> Quantity:
    return Quantity.of(value, dimension, DIGITS)


def _unless_zero(value: float, dimension: Dimension) -> Quantity | None:
    found = _quantity(0.0 if math.isnan(value) else value, dimension)
    return found if found.value else None


def _at(place: tuple[float, float]) -> Point:
    return Point(x=_quantity(place[0], "length"), y=_quantity(place[1], "length"))
