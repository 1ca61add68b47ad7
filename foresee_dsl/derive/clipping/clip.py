"""Cuts a clip out of a run: the seconds around a risky point, as a file that rebuilds them exactly.

All actors of the first frame are restored, not only those near the ego: if only those within 120 m are, one actor in
ten deviates by over 0.5 m after 10 s, because car-following reaches far along a queue."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple, assert_never

import numpy as np

from foresee_dsl.compile.placement.doors import door_actions, door_side
from foresee_dsl.derive.clipping.conditions import point_of, quantity
from foresee_dsl.derive.clipping.snapshot import (
    TrackProgress,
    ego_track,
    front,
    has_passed,
    present,
    remaining_route,
    track_progress,
)
from foresee_dsl.derive.clipping.triggers import Resumed, at_once, triggers_at
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.forecast.settings import VEHICLE_KINDS
from foresee_dsl.language import model as m
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.meaning import pin_of
from foresee_dsl.language.traversal import all_actions, si_of, word_of
from foresee_dsl.language.units import Dimension
from foresee_dsl.simulate.orders.speed import MET_M
from foresee_dsl.simulate.trace import ACCELERATION, HEADING, SPEED, STEER, STEP_S, WAYPOINT_M, ActorInfo, Trace, X, Y
from foresee_dsl.simulate.trigger_record import ActorOrders

_Timed = m.Steers | m.Line | m.Brakes
RECORDED_EVERY_S = 0.05
"""Time between the ego's recorded states of a hand-over, s: one frame. Ours: if only every second frame were recorded,
the ego would be off by millimetres in between.
"""
PLANS_EVERY_S = 0.2
"""A clip with a hand-over begins at a time of the run that is a multiple of this, s. Ours: a driver that plans 5 or 10
times a second then plans at the same moments as in the run."""
DRIVES_S = 1.0
"""Shortest time that the driver must drive before the risky point, s. Ours: the time between a change's beginning and
the risky point in the preset `focused`."""


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
) -> m.Clip:
    """Return the clip of the window [point - before_s, point + after_s], bounded by the run.

    If the point has a proposed change, its clip begins with the change, or with a hand-over that ends when the change
    begins.

    Args:
        case: the test case.
        trace: its run.
        point: the risky point.
        before_s, after_s: o_b and o_a (paper, section 3.3).
        name: the clip's name.
        parent: the case's file as the clip's file names it.
        handover_s: how long the ego follows its recorded states while its driver watches. A clip that begins where its
            parent's run did has no hand-over, as it needs none.

    Returns:
        The clip, without a fidelity line (see `fidelity.with_fidelity`).

    Raises:
        ValueError: the trace does not have the frame, has no record of its triggers, or is of another scenario; or the
            hand-over ends less than `DRIVES_S` before the risky point.
    """
    if not 0 <= point.frame < trace.frames:
        raise ValueError(f"the run has {trace.frames} frames, so there is no frame {point.frame}")
    if point.begins is None and handover_s > max(before_s - DRIVES_S, 0.0):
        raise ValueError(
            f"a hand-over of {handover_s:g} s is too long: it must end {DRIVES_S:g} s before the risky point, which "
            f"is {before_s:g} s after the clip's beginning"
        )
    frames = clip_frames(trace, point, before_s=before_s, after_s=after_s, handover_s=handover_s)
    return m.Clip(
        name=name,
        parent=parent,
        case=case.id.partition("::")[2] or None,
        pin=pin_of(case),
        body=_body(case, trace, point, frames),
    )


class ClipFrames(NamedTuple):
    """The frames of a run that a clip has: its first, the one from which the driver drives, and its last."""

    first: int
    drives_from: int
    last: int


def clip_frames(
    trace: Trace, point: RiskyPoint, *, before_s: float, after_s: float, handover_s: float = 0.0
) -> ClipFrames:
    """Return the frames of the clip around a point; `clip` explains the arguments."""
    handover = round(handover_s / STEP_S)
    first = point.begins - handover if point.begins is not None else point.frame - round(before_s / STEP_S)
    first = max(0, first)
    if handover > 0:
        first -= first % round(PLANS_EVERY_S / STEP_S)
    if point.begins is not None:
        handover = point.begins - first  # the hand-over lasts until the proposed change begins
    elif first == 0:
        handover = 0
    last = point.frame + round(after_s / STEP_S)
    if point.begins is not None:  # not longer than the clip of another point would be
        last = min(last, max(point.begins + round((before_s + after_s) / STEP_S), point.frame + 1))
    last = min(trace.frames - 1, last)
    return ClipFrames(first, min(first + handover, last), last)


def goal(trace: Trace, first: int, last: int) -> tuple[float, float]:
    """Return the waypoint nearest to the ego at frame `last` and not behind it, m.

    As a route may cross itself, only waypoints within the distance driven since frame `first` count. If there are no
    waypoints, the goal is the middle of the ego's front.
    """
    here = np.array(front(trace, 0, last))
    points = trace.waypoints
    if not len(points):
        return float(here[0]), float(here[1])
    driven_m = float(np.nansum(trace.states[first : last + 1, 0, SPEED])) * STEP_S
    begin = int(np.hypot(*(points - front(trace, 0, first)).T).argmin())
    end = begin + math.ceil(driven_m / WAYPOINT_M) + 3
    nearest = begin + int(np.hypot(*(points[begin:end] - here).T).argmin())
    heading = trace.states[last, 0, HEADING]
    ahead = (points - here) @ np.array([math.cos(heading), math.sin(heading)])
    while ahead[nearest] < 0 and nearest + 1 < min(end, len(points)):
        nearest += 1
    return float(points[nearest, 0]), float(points[nearest, 1])


def _body(case: TestCase, trace: Trace, point: RiskyPoint, frames: ClipFrames) -> tuple[m.ClipItem, ...]:
    first, drives_from, last = frames
    begins = _Beginning(case, trace, first)
    actor = point.actor if point.actor and point.actor not in begins.gone else None
    return (
        m.Window(start=_seconds(float(trace.time_s[first])), end=_seconds(float(trace.time_s[last]))),
        m.Risk(
            text=point.why.replace('"', "'"),
            at=_seconds(float(trace.time_s[point.frame])),
            actor=actor,
            operator=point.operator or None if actor else None,
        ),
        begins.ego(drives_from),
        m.Goal(at=point_of(goal(trace, first, last))),
        *begins.patches(),
        *begins.actors(),
        *begins.signals(),
        *begins.whens(),
    )


class _Beginning:
    """Builds the statements of a clip about its first frame."""

    def __init__(self, case: TestCase, trace: Trace, frame: int) -> None:
        self._trace, self._frame, self._now_s = trace, frame, float(trace.time_s[frame])
        self._ego: m.Ego | None = None
        self._written: dict[str, m.Actor] = {}
        self._patches: list[m.Slippery] = []
        for item in case.scenario.body:
            match item:
                case m.Ego():
                    self._ego = item
                case m.Actor():
                    self._written[item.name] = item
                case m.Slippery():
                    self._patches.append(item)
                case m.When() | m.SignalState() | m.Traffic() | m.End():
                    pass  # rewritten for this frame: triggers, signals, each actor of the traffic, the window
                case m.UseNetwork() | m.UseModels() | m.UseTracks() | m.Network():
                    pass  # added from the parent by `language.project.expand.expand_clip`
                case m.Weather() | m.Tags() | m.Expect():
                    pass  # added from the parent by `language.project.expand.expand_clip`
                case m.Doc() | m.Expected() | m.Param() | m.Require() | m.Case() | m.Cases():
                    pass  # statements about the parent's text, and parameters, whose values are already inserted
                case _:
                    assert_never(item)
        self._on_tracks = track_progress(case, trace, frame)
        absent = frozenset(name for name in self._on_tracks if math.isnan(trace.states[frame, trace.index(name), X]))
        self._triggers = triggers_at(case.scenario, trace, frame, later=absent)
        self.gone = self._triggers.moment.gone
        doors = {m.door_name(action.actor, door_side(action)) for action in door_actions(case.scenario)}
        here = {*present(trace, frame), *(trace.index(name) for name in absent)} - {0}
        self._others = tuple(k for k in sorted(here) if trace.actors[k].id not in doors)
        running, self._taken = self._triggers.under_way()
        later = (*running, *self._triggers.pending())
        self._later = (*later, *self._triggers.held_back(later))
        started = (a.actor for when in self._later for a in all_actions(when.actions) if isinstance(a, m.Starts))
        self._waiting = frozenset(started)

    def ego(self, drives_from: int) -> m.Ego:
        """Return the ego, with its recorded states up to the frame from which its driver drives."""
        trace, first = self._trace, self._frame
        kept = [item for item in (self._ego.body if self._ego else ()) if isinstance(item, m.CruiseSpeed)]
        route = remaining_route(trace, 0, first)
        step = round(RECORDED_EVERY_S / STEP_S)
        frames = [*range(first + step, drives_from, step), drives_from] if drives_from > first else []
        recorded = (m.Recorded(time=_seconds((k - first) * STEP_S), state=_state(trace, 0, k)) for k in frames)
        body: list[m.ActorItem] = [m.EdgeRoute(edges=route)] if route else []
        track = None if self._ego is None else ego_track(self._ego, self._now_s)
        body += [] if track is None else [track]
        return m.Ego(model=trace.actors[0].model, state=_state(trace, 0, first), body=(*body, *kept, *recorded))

    def actors(self) -> list[m.Actor]:
        """Return the other actors that are present."""
        return [self._actor(k) for k in self._others]

    def patches(self) -> list[m.Slippery]:
        """Return the slippery patches at positions in the world, because an actor that their places refer to may have
        moved.
        """
        at = {event.actor: event.detail for event in self._trace.events if event.what == "slippery"}
        spots = ((patch, at[patch.name]) for patch in self._patches if patch.name in at)
        return [patch.model_copy(update={"place": point_of((spot["x"], spot["y"]))}) for patch, spot in spots]

    def signals(self) -> list[m.SignalState]:
        """Return the stage of each signal, and how long it has lasted."""
        trace, frame = self._trace, self._frame
        return [
            m.SignalState(
                junction=junction,
                stage=trace.signal_stages[k][int(trace.stages[frame, k])],
                elapsed=_seconds(float(trace.elapsed[frame, k])),
            )
            for k, junction in enumerate(trace.signals)
        ]

    def whens(self) -> list[m.When]:
        """Return triggers that resume the actors' unfinished orders, and the triggers of the run that may
        still fire.
        """
        resumed = [*self._triggers.things(), *(self._resumed(k) for k in self._others)]
        kept = [self._ends_keeping(k) for k in self._others]
        return [when for when in (*resumed, *kept) if when is not None] + list(self._later)

    def _source(self, actor: str) -> tuple[m.ActorItem, ...]:
        """Return the scenario's statements about an actor; empty for an actor of the background traffic."""
        written = self._written.get(actor)
        return written.body if written else ()

    def _actor(self, k: int) -> m.Actor:
        info, orders = self._trace.actors[k], self._triggers.orders_of(self._trace.actors[k].id)
        source = self._source(info.id)
        if info.id in self._on_tracks:
            return self._follower(info, self._on_tracks[info.id], orders)
        timing = next((si_of(item.factor) for item in source if isinstance(item, m.Timing)), 1.0)
        cruise = self._cruise(info, orders) if orders.keeps_mps is None else quantity(orders.keeps_mps, "speed")
        carried = [statement for item in source for statement in self._carried(item, info, orders)]
        if orders.line_m is not None and not any(isinstance(item, m.Line) for item in carried):
            carried.append(m.Line(left=quantity(orders.line_m, "length")))
        return m.Actor(
            kind=_kind(info),
            name=info.id,
            model=info.model,
            state=_state(self._trace, k, self._frame, timing if timing > 0 else 1.0),
            body=(
                *self._way(k, orders),
                *((m.CruiseSpeed(speed=cruise),) if cruise is not None else ()),
                *self._rules(k, orders),
                *carried,
            ),
        )

    def _follower(self, info: ActorInfo, progress: TrackProgress, orders: ActorOrders) -> m.Actor:
        """Return an actor that follows its track; the track gives its place, so it has no state."""
        actor = self._written[info.id]
        changed = (i for i in actor.body if isinstance(i, m.Timing | m.Delay | m.Brakes))
        carried = (statement for i in changed for statement in self._carried(i, info, orders))
        body = (*progress.statements(actor), *carried)
        return m.Actor(kind=_kind(info), name=info.id, model=info.model, body=body)

    def _way(self, k: int, orders: ActorOrders) -> tuple[m.ActorItem, ...]:
        info = self._trace.actors[k]
        along = float(self._trace.along[self._frame, k])
        path, joins = (orders.path, orders.joins) if orders.path else (info.path, info.route if info.path else ())
        if path and not (joins and math.isnan(along)):
            walked = m.Walked(along=quantity(0.0 if math.isnan(along) else along, "length"))
            then = (m.Joins(edges=joins),) if joins else ()
            return m.Path(points=tuple(point_of(p) for p in path)), *then, walked
        route = remaining_route(self._trace, k, self._frame, joins)
        return (m.EdgeRoute(edges=route),) if route else ()

    def _cruise(self, info: ActorInfo, orders: ActorOrders) -> m.Value | None:
        """Return an actor's cruise speed: as a trigger last set it; if none did, as the author wrote it; if the author
        did not, as in the trace.
        """
        if orders.cruise is not None:
            return orders.cruise
        written = next((item.speed for item in self._source(info.id) if isinstance(item, m.CruiseSpeed)), None)
        return written or (quantity(info.cruise_mps, "speed") if info.cruise_mps > 0 else None)

    def _rules(self, k: int, orders: ActorOrders) -> tuple[m.IgnoresRule | m.MeetsState, ...]:
        """Return the statements on the rules that an actor ignores and on the actor that it meets, without those about
        junctions that it has passed already.
        """
        name = self._trace.actors[k].id
        items: list[m.IgnoresRule | m.MeetsState] = [i for i in self._source(name) if isinstance(i, m.IgnoresRule)]
        items += [m.IgnoresRule(what=i.what, junction=i.junction) for i in orders.ignores]
        meets = orders.speed.action if orders.speed and orders.keeps_mps is None else None
        if isinstance(meets, m.Meets) and (name, "speed") not in self._taken:
            state = m.MeetsState(other=meets.other, junction=meets.junction, gap=meets.gap, order=meets.order)
            items.append(state)
        passed = [i.junction and has_passed(self._trace, k, word_of(i.junction), self._frame) for i in items]
        return tuple(dict.fromkeys(item for item, over in zip(items, passed, strict=True) if not over))

    def _carried(self, item: m.ActorItem, info: ActorInfo, orders: ActorOrders) -> tuple[m.ActorItem, ...]:
        """Return a statement of the author or of a mutation about an actor, with times that count from the clip's
        beginning.
        """
        match item:
            case m.Timing() | m.PassesInLane() | m.Style():
                return (item,)
            case m.Line(start=None, duration=None):
                # The points of the path in the trace contain it.
                return () if info.path or orders.line_m is not None else (item,)
            case m.Steers() | m.Line() | m.Brakes():
                return _left(item, self._now_s)
            case m.Delay():
                if info.id in self._waiting:  # the statement begins when the actor is started
                    return (item,)
                left_s = si_of(item.time) - (self._now_s - (orders.started_s or 0.0))
                return (m.Delay(time=_seconds(left_s)),) if left_s > 0 else ()
            case (
                # Triggers may have changed these; `_cruise` and `_rules` write them.
                m.CruiseSpeed()
                | m.IgnoresRule()
                | m.MeetsState()
                # The trace contains the actor's place, its speed and the rest of its route.
                | m.Route()
                | m.EdgeRoute()
                | m.Path()
                | m.PathAlong()
                | m.Track()
                | m.Joins()
                | m.Walked()
                | m.StartAt()
                | m.StartSpeed()
                | m.GoalAt()
                # Only the ego has recorded states, and in this clip they are over.
                | m.Recorded()
            ):
                return ()
            case _:
                assert_never(item)

    def _resumed(self, k: int) -> m.When | None:
        """Return a trigger that at once resumes an actor's unfinished stop, change of speed or change of lane.

        An order that a sequence waits for is resumed in that sequence.
        """
        again: list[m.Action] = []
        name = self._trace.actors[k].id
        if name in self._on_tracks:
            return at_once(m.LeavesTrack(actor=name)) if self._on_tracks[name].leaves else None
        orders = self._triggers.orders_of(name)
        if orders.speed is not None:
            action = orders.speed.action
            if isinstance(action, Resumed) and (name, "speed") not in self._taken:
                left = self._triggers.rest_of(action, orders.speed.since_s)
                again += [left] if left else []
        elif orders.cruise is not None and name in self._waiting:
            # The actor moves although no trigger has started it.
            again.append(m.ChangesSpeed(actor=name, to=orders.cruise))
        sideways = None if (name, "sideways") in self._taken else orders.sideways
        if sideways is not None and isinstance(sideways.action, Resumed):
            left = self._triggers.rest_of(sideways.action, sideways.since_s)
            again += [left] if left else []
        lane = None if (name, "lane") in self._taken else orders.lane
        if lane is not None and self._triggers.still_to_change(name, lane.since_s):
            again.append(lane.action)
        return at_once(*again) if again else None

    def _ends_keeping(self, k: int) -> m.When | None:
        """Return the trigger that restores an actor's cruise speed once it has met another actor, because until then it
        keeps another speed.
        """
        info = self._trace.actors[k]
        orders = self._triggers.orders_of(info.id)
        meets = orders.speed.action if orders.speed else None
        cruise = self._cruise(info, orders)
        if orders.keeps_mps is None or not isinstance(meets, m.Meets) or cruise is None:
            return None
        room = m.Measure(what="distance", actor=info.id, other=meets.junction)
        inside = m.Comparison(left=room, op="<=", right=quantity(-MET_M, "length"))
        return m.When(condition=inside, actions=(m.ChangesSpeed(actor=info.id, to=cruise),))


def _kind(info: ActorInfo) -> Literal["vehicle", "bicycle", "pedestrian", "obstacle"]:
    match info.kind:
        case "bicycle" | "pedestrian" | "obstacle":
            return info.kind
        case _:
            return "vehicle"


def _state(trace: Trace, actor: int, frame: int, timing: float = 1.0) -> m.State:
    info, row = trace.actors[actor], trace.states[frame, actor]
    # The statement places an actor by its front; pedestrians and obstacles by their middle.
    wheels = info.kind in VEHICLE_KINDS
    on_lanes = math.isnan(trace.along[frame, actor])
    acceleration, steer = float(row[ACCELERATION]), float(row[STEER])
    heading = math.remainder(float(row[HEADING]), math.tau)
    return m.State(
        at=point_of(front(trace, actor, frame) if wheels else (float(row[X]), float(row[Y]))),
        heading=quantity(heading, "angle"),
        speed=quantity(float(row[SPEED]) / timing, "speed"),  # `timing` multiplies the speed that the file states
        # A path-follower's acceleration has no effect, because its speed is prescribed; a vehicle's has, because SUMO
        # continues from it.
        acceleration=_unless_zero(acceleration, "acceleration") if wheels and on_lanes else None,
        steer=_unless_zero(steer, "angle") if actor == 0 else None,
    )


def _left(item: _Timed, now_s: float) -> tuple[_Timed, ...]:
    """Return the rest of a statement that holds for a limited time; empty if that time is over."""
    start_s = 0.0 if item.start is None else si_of(item.start)
    left = None
    if item.duration is not None:
        length_s = si_of(item.duration)
        left_s = min(length_s, start_s + length_s - now_s)
        if left_s <= 0:
            return ()
        left = _seconds(left_s)
    return (item.model_copy(update={"start": _seconds(max(0.0, start_s - now_s)), "duration": left}),)


# --- values ----------------------------------------------------------------------------------------------------------


def _seconds(value: float) -> m.Quantity:
    """Return a time as a quantity; two decimals are enough for each multiple of the step of 0.05 s."""
    return m.Quantity.of(value, "time", 2)


def _unless_zero(value: float, dimension: Dimension) -> m.Quantity | None:
    rounded = quantity(0.0 if math.isnan(value) else value, dimension)
    return rounded if rounded.value else None
