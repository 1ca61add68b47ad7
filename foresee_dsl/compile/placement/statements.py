"""Reads the statements of an actor that determine its position, speed, steering and track, and the kind of lanes that
its model uses."""

from __future__ import annotations

import math
from typing import TypeVar

from foresee_dsl.compile.bundle import ModelSpec, RecordedState, TimedValue, TrackPlayback
from foresee_dsl.compile.catalogue import cruise_speed
from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.compile.roads.topology import LaneKind
from foresee_dsl.compile.tracks import FileTrack
from foresee_dsl.language import model as m
from foresee_dsl.language.traversal import si_of

_T = TypeVar("_T", bound=m.Item)
PUSHED_MPS2 = 2.0
"""Acceleration and braking of an obstacle that moves, m/s^2; models of obstacles have no such values. Ours: a value for
a cart that is pushed."""
WHEELS = frozenset({"car", "van", "truck", "bus", "motorcycle", "bicycle"})


def si(value: m.AnyValue | None) -> float:
    """Return a value of a concrete scenario in SI units, 0 for None."""
    return 0.0 if value is None else si_of(value)


def lane_kind(spec: ModelSpec) -> LaneKind:
    """Return the kind of lanes that a model uses."""
    match spec.kind:
        case "bicycle" | "pedestrian" | "bus":
            return spec.kind
        case _:
            return "car"


def item(actor: m.Ego | m.Actor, kind: type[_T]) -> _T | None:
    """Return an actor's last statement of a kind, if any; a mutation's statement comes after the author's."""
    return next((i for i in reversed(actor.body) if isinstance(i, kind)), None)


def items(actor: m.Ego | m.Actor, kind: type[_T]) -> tuple[_T, ...]:
    """Return an actor's statements of a kind."""
    return tuple(i for i in actor.body if isinstance(i, kind))


def route_of(actor: m.Ego | m.Actor) -> m.Route | m.EdgeRoute | None:
    """Return an actor's route statement, if any."""
    return item(actor, m.Route) or item(actor, m.EdgeRoute)


def path_of(actor: m.Ego | m.Actor) -> m.AnyPath | None:
    """Return the statement that leads an actor off the lanes, if any."""
    return item(actor, m.Path) or item(actor, m.PathAlong)


def track_of(actor: m.Ego | m.Actor) -> m.Track | None:
    """Return the statement with an actor's recorded track, if any."""
    return item(actor, m.Track)


def playback_of(actor: m.Ego | m.Actor, track: FileTrack, spec: ModelSpec) -> TrackPlayback:
    """Return how an actor with a `track` statement follows that track."""
    statement, timing, delay = track_of(actor), item(actor, m.Timing), item(actor, m.Delay)
    line, brakes, speed = item(actor, m.Line), item(actor, m.Brakes), item(actor, m.StartSpeed)
    start_s = si(statement.start) if statement is not None else 0.0
    return TrackPlayback(
        track=track,
        start_s=start_s,
        timing=si(timing.factor) if timing is not None else 1.0,
        delay_s=si(delay.time) if delay is not None else 0.0,
        brakes=timed(brakes.braking, brakes) if brakes is not None else None,
        speed_mps=si(speed.speed) if speed is not None else None,
        acceleration_mps2=spec.acceleration_mps2 or PUSHED_MPS2,
        left_m=si(line.left) if line is not None else 0.0,
        moves_over_s=start_s + (si(line.start) if line is not None else 0.0),
    )


def timed(value: m.AnyValue, statement: m.Line | m.Brakes | m.Steers) -> TimedValue:
    """Return the value of a statement with the time for which it holds."""
    until_s = math.inf if statement.duration is None else si(statement.start) + si(statement.duration)
    return TimedValue(si(value), si(statement.start), until_s)


def centre(state: m.State, spec: ModelSpec) -> tuple[float, float, float]:
    """Return the footprint's middle and the heading of an exact state; a vehicle's state is that of its front
    bumper."""
    heading = wrap(si(state.heading))
    back = spec.length_m / 2 if spec.kind in WHEELS else 0.0
    return si(state.at.x) - back * math.cos(heading), si(state.at.y) - back * math.sin(heading), heading


def cruise_of(actor: m.Ego | m.Actor, spec: ModelSpec, limit_mps: float) -> float:
    """Return an actor's cruise speed, m/s: its statement's, or its model's where this speed limit holds."""
    statement = item(actor, m.CruiseSpeed)
    return si(statement.speed) if statement is not None else cruise_speed(spec, limit_mps)


def recorded_state(statement: m.Recorded) -> RecordedState:
    """Return a state of the ego before its driver takes over."""
    state = statement.state
    return RecordedState(
        time_s=si(statement.time),
        x=si(state.at.x),
        y=si(state.at.y),
        heading_rad=si(state.heading),
        speed_mps=max(si(state.speed), 0.0),
        acceleration_mps2=si(state.acceleration),
        steer_rad=si(state.steer),
    )
