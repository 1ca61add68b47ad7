"""Reads the statements of an actor that determine its position, and the kind of lanes that its model uses."""

from __future__ import annotations

import math
from typing import TypeVar

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.compile.roads.topology import LaneKind
from foresee_dsl.language import model as m
from foresee_dsl.language.traversal import si_of

_T = TypeVar("_T", bound=m.Item)
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


def centre(state: m.State, spec: ModelSpec) -> tuple[float, float, float]:
    """Return the footprint's middle and the heading of an exact state; a vehicle's state is that of its front
    bumper."""
    heading = wrap(si(state.heading))
    back = spec.length_m / 2 if spec.kind in WHEELS else 0.0
    return si(state.at.x) - back * math.cos(heading), si(state.at.y) - back * math.sin(heading), heading
