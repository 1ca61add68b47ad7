"""Carries out the triggers of a run: makes actors start, stop, change speed or lane, ignore rules, or meet another
actor.

Each effect is recorded as an event: the steps of triggers (see `trigger`), `place` (the position of a place on an
actor's route), and each actor's actions. The state that a clip needs to begin in between is recorded too (see
`record`).
"""

from __future__ import annotations

import contextlib
import math
from typing import Any, TypeVar, assert_never

from foresee_dsl.compile.bundle import TimedValue
from foresee_dsl.compile.placement.doors import door_side
from foresee_dsl.compile.placement.paths import joined_way
from foresee_dsl.compile.placement.statements import lane_kind
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.language import model as m
from foresee_dsl.language.printer import written as text_of
from foresee_dsl.language.traversal import fields_of, si_of, word_of
from foresee_dsl.simulate.actors.guided_vehicles import GuidedVehicle
from foresee_dsl.simulate.actors.moved_actors import OpenDoor, PathActor
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import SimulatedActor
from foresee_dsl.simulate.orders.pair import Gap, Match, SideGap, Synchrony
from foresee_dsl.simulate.orders.speed import (
    Braking,
    Command,
    Halt,
    LateralShift,
    Meeting,
    Ramp,
    Reverse,
    Stop,
    StopSpot,
)
from foresee_dsl.simulate.recorder import Recorder
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.trigger_record import DirectorRecord, Order
from foresee_dsl.simulate.triggers.conditions import Conditions
from foresee_dsl.simulate.triggers.standing_orders import StandingOrders
from foresee_dsl.simulate.triggers.trigger import IsComplete, Trigger

_Item = TypeVar("_Item", bound=m.Item)
IN_LANE_M = 0.2
"""Distance from a lane's centreline within which an actor has reached the lane, m. Ours: drivers deviate more in a
lane."""


class Director:
    """Evaluates the triggers of a scene and begins their actions, from the first frame on."""

    def __init__(self, simulation: Simulation, conditions: Conditions, recorder: Recorder) -> None:
        self._simulation, self._conditions, self._recorder = simulation, conditions, recorder
        self._orders = StandingOrders(simulation, recorder)
        self._strays: list[tuple[float, m.ChangesLine]] = []
        self._things: list[Order] = []
        # The place that a text such as `12 m after start` means depends on where its actor starts, so the scene states
        # it.
        self._places = {text_of(place, frozenset()): at for place, at in simulation.scene.places.items()}
        self._begin()
        whens = enumerate(simulation.scene.whens)
        self._triggers = [Trigger(index, when, conditions, self.act, self.event) for index, when in whens]

    def step(self) -> None:
        """Evaluate the triggers at the current frame; their orders take effect in the next step."""
        if not (self._triggers or self._strays or self._orders.any()):
            return
        for trigger in self._triggers:
            trigger.look()
        self._orders.take_effect()
        # A completed action may let the next one begin in the same step, and the order of that one may be complete at
        # once.
        while True:
            self._orders.new.clear()
            for trigger in self._triggers:
                trigger.advance()
            if not self._orders.new:
                break
            self._orders.update(self._orders.new)
        if self._strays:
            self._stray(self._simulation.time_s)
        self._orders.take_late_effect()
        for trigger in self._triggers:
            trigger.record()

    def record(self) -> DirectorRecord:
        """Return the record of the run so far."""
        orders = {actor: tuple(states) for actor, states in self._orders.recorded.items()}
        triggers = tuple(tuple(trigger.states) for trigger in self._triggers)
        return DirectorRecord(triggers, orders, self._places, tuple(self._things))

    # --- what triggers need ----------------------------------------------------------------------------------------

    def event(self, what: str, detail: dict[str, Any], actor: str = "") -> None:
        """Record an event of a trigger or of an actor."""
        self._recorder.event(self._simulation.time_s, actor, what, detail)

    def act(self, action: m.Action) -> IsComplete:
        """Begin an action; return a function that says whether it is complete."""
        if isinstance(action, m.Wait):
            until = self._simulation.time_s + si_of(action.duration)
            return lambda: self._simulation.time_s >= until - STEP_S / 100
        if isinstance(action, m.Then):
            raise TypeError(
                "a block of actions cannot be carried out as one action; `Sequence` carries out its actions"
            )
        if isinstance(action, m.TurnsTo | m.Limit | m.Door | m.LeavesTrack):
            return self._do_at_once(action)
        action = self._settled(action)
        actor = self._simulation.by_id.get(action.actor)
        on_track = actor is not None and self._simulation.on_track(actor)
        if not on_track:
            self._orders.record(action, action.actor)
        # An actor of the traffic may not have been placed, and only its track moves an actor that follows one.
        if actor is None or not actor.present or (on_track and not isinstance(action, m.Leaves)):
            return _at_once
        complete = self._begin_action(actor, action)
        return lambda: not actor.present or complete()

    def _do_at_once(self, action: m.TurnsTo | m.Limit | m.Door | m.LeavesTrack) -> IsComplete:
        match action:
            case m.TurnsTo():
                return self._turn(action)
            case m.Limit():
                return self._limit(action)
            case m.Door():
                return self._door(action)
            case m.LeavesTrack():  # also before its track begins
                return self._leave_track(action)
            case _:
                assert_never(action)

    def _begin_action(self, actor: SimulatedActor, action: m.Moves) -> IsComplete:
        match action:
            case m.Meets():
                complete = self._meet(actor, action)
            case m.Ignores():
                self._ignore(actor, action.what, None if action.junction is None else word_of(action.junction))
                complete = _at_once
            case m.Starts():
                complete = self._start(actor)
            case m.ChangesSpeed():
                complete = self._change_speed(actor, action)
            case m.ChangesLane():
                complete = self._change_lane(actor, action)
            case m.Stops() | m.BrakesFor():
                complete = self._stop(actor, action)
            case m.StopsAt():
                complete = self._halt(actor, action)
            case m.KeepsGap() | m.MatchesSpeed() | m.Synchronises():
                complete = self._by_another(actor, action)
            case m.Reverses() | m.FollowsPath():
                complete = self._off_the_lanes(actor, action)
            case m.Leaves():
                complete = self._leave(actor)
            case m.ChangesLine() | m.KeepsBeside():
                complete = self._keep_sideways(actor, action)
            case _:
                assert_never(action)
        return complete

    def _begin(self) -> None:
        for actor in self._simulation.actors[1:]:
            placed = actor.placed
            if placed.control == "static":
                continue
            if placed.playback is not None:
                self.event("track", {"name": placed.playback.track.name}, actor.id)
                continue  # its clock follows its statements
            if placed.waits or placed.delay_s > 0:
                self._simulation.order_speed(actor, 0.0)
            if not placed.waits and placed.delay_s > 0:
                self._orders.start(actor, placed.delay_s)
            for what, junction in placed.ignores:
                self._ignore(actor, what, junction)
            if placed.brakes is not None:
                self._orders.brake(actor, Braking(self._simulation, actor, placed.brakes))
            if placed.strays is not None:
                self._strays += _there_and_back(actor.id, placed.strays)
            for state in placed.meets:
                meets = m.Meets(
                    actor=actor.id, other=state.other, junction=state.junction, gap=state.gap, order=state.order
                )
                self._orders.record(meets, actor.id)
                self._meet(actor, meets)
        for text, (x, y) in self._places.items():
            self.event("place", {"text": text, "x": x, "y": y})

    def _stray(self, time_s: float) -> None:
        """Let actors that are to leave their line for a time go to the other line, or back, when the time has come."""
        due = [(at, action) for at, action in self._strays if time_s >= at - STEP_S / 100]
        self._strays = [stray for stray in self._strays if stray not in due]
        for _, action in due:
            self.act(action)

    # --- actions ---------------------------------------------------------------------------------------------------

    def _meet(self, actor: SimulatedActor, meets: m.Meets) -> IsComplete:
        junction, gap_s = word_of(meets.junction), si_of(meets.gap)
        detail = {"other": meets.other, "junction": junction, "gap_s": gap_s, "order": meets.order}
        self.event("meets", detail, actor.id)
        meeting = Meeting(self._simulation, self._recorder, actor, meets)
        if actor.placed.timing == 1.0:
            return self._orders.give(actor, meeting)
        # A meeting adapts the speed and would compensate the actor's `timing`; instead the actor drives at the speed
        # that the order sets now, times `timing`.
        if not meeting.over():
            self._orders.end(actor)
            self._simulation.cruise_mps[actor.id] = meeting.pace_mps() * actor.placed.timing
            self._simulation.order_speed(actor, self._simulation.cruise_mps[actor.id])
        return self._orders.note(actor, "speed", meeting.complete)

    def _ignore(self, actor: SimulatedActor, what: str, junction: str | None) -> None:
        self.event("ignores", {"what": what, "junction": junction}, actor.id)
        if junction is None:
            self._simulation.ignore(actor, what)
        else:
            self._orders.ignore_near(actor, what, junction)

    def _start(self, actor: SimulatedActor) -> IsComplete:
        self.event("starts", {"delay_s": actor.placed.delay_s}, actor.id)
        return self._orders.start(actor, self._simulation.time_s + actor.placed.delay_s)

    def _change_speed(self, actor: SimulatedActor, action: m.ChangesSpeed) -> IsComplete:
        to, over = si_of(action.to), None if action.over is None else si_of(action.over)
        self.event("changes_speed", {"to_mps": to, "over_s": over, "from_mps": actor.speed}, actor.id)
        return self._orders.give(actor, Ramp(self._simulation, actor, to * actor.placed.timing, over or 0.0))

    def _change_lane(self, actor: SimulatedActor, action: m.ChangesLane) -> IsComplete:
        side = word_of(action.side)
        self.event("changes_lane", {"side": side}, actor.id)
        if actor.id not in self._simulation.world:
            return _at_once
        step = self._simulation.network.lanes_to(1 if side == "left" else -1)
        self._simulation.world.change_lane(actor.id, step)
        edge, _, index = actor.lane.rpartition("_")
        target = f"{edge}_{int(index or -1) + step}"
        return lambda: self._in_lane(actor, target)

    def _in_lane(self, actor: SimulatedActor, target: str) -> bool:
        """Return whether an actor has reached a lane, or cannot reach it: the lane does not exist, or the actor is on
        another road by now.
        """
        lane = self._simulation.network.lanes.get(target)
        if (
            lane is None
            or lane_kind(actor.placed.model) not in lane.kinds
            or actor.lane.rpartition("_")[0] != lane.edge
        ):
            return True
        return actor.lane == target and abs(lane.line.project(*actor.front)[1]) <= IN_LANE_M

    def _stop(self, actor: SimulatedActor, action: m.Stops | m.BrakesFor) -> IsComplete:
        if isinstance(action, m.BrakesFor):
            return self._brake_for(actor, action)
        duration = None if action.duration is None else si_of(action.duration)
        self.event("stops", {"duration_s": duration}, actor.id)
        return self._orders.give(actor, Stop(self._simulation, actor, duration))

    def _brake_for(self, actor: SimulatedActor, action: m.BrakesFor) -> IsComplete:
        duration_s = math.inf if action.duration is None else si_of(action.duration)
        braking_mps2 = min(si_of(action.braking), actor.placed.model.emergency_braking_mps2 or math.inf)
        detail = {"braking_mps2": braking_mps2, "duration_s": None if action.duration is None else duration_s}
        self.event("brakes_for", detail, actor.id)
        now_s = self._simulation.time_s
        return self._orders.give(
            actor, Braking(self._simulation, actor, TimedValue(braking_mps2, now_s, now_s + duration_s), acts=True)
        )

    def _halt(self, actor: SimulatedActor, action: m.StopsAt) -> IsComplete:
        duration = None if action.duration is None else si_of(action.duration)
        spot = self._spot_on(actor, action.where)
        halt = Halt(self._simulation, actor, spot, duration)
        detail = {"at": text_of(action.where, frozenset()), "duration_s": duration, "missed": halt.missed}
        self.event("stops_at", detail, actor.id)
        if not halt.missed:
            return self._orders.give(actor, halt)
        # The actor drives on, and its earlier speed order ends.
        self._orders.end(actor)
        self._simulation.order_speed(actor, self._simulation.cruise_mps[actor.id])
        self._orders.note(actor, "speed", halt.complete)
        return _at_once

    def _settled(self, action: _Item) -> _Item:
        """Return an action in which each place relative to a moving actor is replaced by its current point."""
        points: dict[str, m.Point] = {}
        for field, value in fields_of(action):
            if isinstance(value, m.OfActor) and "." not in field and (at := self._at(value)) is not None:
                points[field] = m.Point(x=m.Quantity.of(at[0], "length", 4), y=m.Quantity.of(at[1], "length", 4))
        return action.model_copy(update=points) if points else action

    def _at(self, where: m.AtStop | m.Place) -> tuple[float, float] | None:
        """Return the current x and y of a place, m; None if the place is relative to an absent actor."""
        if isinstance(where, m.Point):
            return si_of(where.x), si_of(where.y)
        if isinstance(where, m.OfActor):
            pose = self._conditions.ways.place(where)
            return None if pose is None or math.isnan(pose[0]) else (pose[0], pose[1])
        return self._simulation.scene.places[where]

    def _spot_on(self, actor: SimulatedActor, where: m.AtStop | m.Place) -> StopSpot:
        """Return where a place is along an actor's route."""
        progress = self._simulation.progress
        at = self._at(where)
        s = math.nan if at is None else progress.along(actor, *at)
        if not isinstance(where, m.AtStop):
            return StopSpot(s)
        stop = self._simulation.network.stops[where.stop]
        if math.isnan(s) and stop.bay:  # a line that begins in the bay may not return to the lanes for cars
            s = progress.along(actor, *stop.lane.line.at(stop.pos_m)[:2])
        return StopSpot(s, stop, stop.length_m - actor.length)

    def _by_another(self, actor: SimulatedActor, action: m.KeepsGap | m.MatchesSpeed | m.Synchronises) -> IsComplete:
        detail: dict[str, Any] = {"other": action.other}
        if isinstance(action, m.KeepsGap):
            detail |= {"way": action.way, "gap": si_of(action.gap), "timed": action.gap_is_time}
        self.event(action.kind, detail, actor.id)
        other = self._simulation.by_id.get(action.other)
        if other is None:  # an actor of the traffic may not have been placed
            return _at_once
        command: Command
        match action:
            case m.KeepsGap():
                command = Gap(self._simulation, actor, action)
            case m.MatchesSpeed():
                command = Match(self._simulation, actor, action)
            case m.Synchronises():
                final = None if action.speed is None else si_of(action.speed)
                places = self._spot_on(actor, action.place).s, self._spot_on(other, action.there).s
                command = Synchrony(self._simulation, actor, other, places, final)
        return self._orders.give(actor, command)

    def _off_the_lanes(self, actor: SimulatedActor, action: m.Reverses | m.FollowsPath) -> IsComplete:
        return self._reverse(actor, action) if isinstance(action, m.Reverses) else self._follow_path(actor, action)

    def _reverse(self, actor: SimulatedActor, action: m.Reverses) -> IsComplete:
        self.event("reverses", {"length_m": si_of(action.length), "speed_mps": si_of(action.speed)}, actor.id)
        if not isinstance(actor, GuidedVehicle) or actor.guide is not None:
            return _at_once  # an actor on a path does not follow a lane
        return self._orders.give(actor, Reverse(self._simulation, actor, si_of(action.length), si_of(action.speed)))

    def _follow_path(self, actor: SimulatedActor, action: m.FollowsPath) -> IsComplete:
        points = [at for place in action.points if (at := self._at(place)) is not None]
        self.event("follows_path", {"points": points, "joins": bool(action.edges)}, actor.id)
        if len(points) < len(action.points) or not isinstance(actor, PathActor | GuidedVehicle):
            return _at_once  # a point's actor is absent, or this actor is steered and has left its lane
        joined = None
        if action.edges and isinstance(actor, GuidedVehicle):
            with contextlib.suppress(RouteError):  # a place relative to an actor may be off the edges' lanes
                kind = lane_kind(actor.placed.model)
                joined = joined_way(self._simulation.network, action.edges, points[-1], kind)
        path = self._simulation.follow_path(actor, points, joined)
        joins = joined[0] if joined is not None else ()
        self._orders.record_path(actor, path, joins)
        return self._orders.note(actor, "path", lambda: self._simulation.path_done(actor))

    def _leave(self, actor: SimulatedActor) -> IsComplete:
        self.event("leaves", {}, actor.id)
        self._simulation.leave(actor)
        self._orders.end(actor)
        return _at_once

    def _leave_track(self, action: m.LeavesTrack) -> IsComplete:
        self.event("leaves_track", {}, action.actor)
        if (actor := self._simulation.by_id.get(action.actor)) is not None:
            self._simulation.leave_track(actor)
            playback = actor.placed.playback
            if playback is not None and playback.brakes is not None:
                self._orders.brake(actor, Braking(self._simulation, actor, playback.brakes))
        return _at_once

    def _keep_sideways(self, actor: SimulatedActor, action: m.ChangesLine | m.KeepsBeside) -> IsComplete:
        order: Command
        vehicle = self._simulation.sumo_vehicles.get(actor.id)
        if isinstance(action, m.ChangesLine):
            self.event("changes_line", {"to_m": si_of(action.to)}, actor.id)
        else:
            detail = {"other": action.other, "side": word_of(action.side), "room_m": si_of(action.room)}
            self.event("keeps_beside", detail, actor.id)
        if vehicle is None or vehicle.id not in self._simulation.world:
            return _at_once  # an actor on a path does not follow a lane
        if isinstance(action, m.ChangesLine):
            order = LateralShift(self._simulation, vehicle, action)
        elif action.other in self._simulation.by_id:
            order = SideGap(self._simulation, vehicle, action)
        else:
            return _at_once
        return self._orders.give_sideways(actor, order)

    # --- actions without an actor ----------------------------------------------------------------------------------

    def _turn(self, action: m.TurnsTo) -> IsComplete:
        junction, stage = word_of(action.junction), word_of(action.stage)
        self.event("turns_to", {"junction": junction, "stage": stage, "light": action.light})
        self._simulation.world.signals.turn(junction, stage, action.light)
        self._recorder.look_again()
        return _at_once

    def _limit(self, action: m.Limit) -> IsComplete:
        road, lane = word_of(action.road), None if action.lane is None else int(si_of(action.lane))
        self.event("limit", {"road": road, "lane": lane, "speed_mps": si_of(action.speed)})
        self._things.append(Order(action, self._orders.now_s))
        self._simulation.limits.change(road, lane, si_of(action.speed))
        self._simulation.keep_limits()
        return _at_once

    def _door(self, action: m.Door) -> IsComplete:
        side, opens = door_side(action), action.what == "opens"
        self.event("door", {"of": action.actor, "side": side, "opens": opens})
        self._things.append(Order(action, self._orders.now_s))
        door = self._simulation.by_id.get(m.door_name(action.actor, side))
        if isinstance(door, OpenDoor):
            door.swing(opens=opens)
        return _at_once


def _at_once() -> bool:
    """Return True: the test for actions that are complete as soon as they have begun."""
    return True


def _there_and_back(actor: str, strays: TimedValue) -> list[tuple[float, m.ChangesLine]]:
    """Return the times and actions with which an actor goes to a temporary line and back."""
    there = m.ChangesLine(actor=actor, to=m.Quantity.of(strays.value, "length", 4))
    back = there.model_copy(update={"to": m.Quantity.of(0.0, "length", 4)})
    return [(at, action) for at, action in ((strays.from_s, there), (strays.until_s, back)) if math.isfinite(at)]
