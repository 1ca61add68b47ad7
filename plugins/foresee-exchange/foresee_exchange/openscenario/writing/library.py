"""The optional package that writes OpenSCENARIO, and conversions that all writers share."""

from __future__ import annotations

import math
from functools import cache
from typing import Any, TypeAlias

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.placement.statements import WHEELS
from foresee_dsl.exchange.outcome import ExchangeError

MINOR_VERSION = 2
"""OpenSCENARIO XML 1.2, which current simulators read (a requirement)."""
DIGITS = 6
"""Decimals of written numbers. Ours: micrometres, below what a trace can resolve."""

Xosc: TypeAlias = Any
"""An object of `scenariogeneration.xosc`, which has no types."""


@cache
def library() -> Xosc:
    """Return the module `scenariogeneration.xosc`; `ExchangeError` if it is not installed."""
    try:
        from scenariogeneration import xosc
    except ImportError as err:
        raise ExchangeError(
            "the package scenariogeneration is missing: pip install 'foresee-dsl[openscenario]'"
        ) from err
    return xosc


class _Library:
    """Gives access to the attributes of `library()`, which is imported on first use: `osc.Event`."""

    def __getattr__(self, name: str) -> Xosc:
        return getattr(library(), name)


osc = _Library()


def behind_centre_m(spec: ModelSpec) -> float:
    """Return how far an entity's reference point is behind the centre of its footprint, m.

    In OpenSCENARIO it is the middle of a vehicle's rear axle, and the centre of the box of pedestrians and things.
    """
    return spec.length_m / 2 - spec.rear_overhang_m if spec.kind in WHEELS else 0.0


def reference_position(x: float, y: float, heading_rad: float, spec: ModelSpec) -> Xosc:
    """Return the position of an entity's reference point, given the centre of its footprint."""
    back = behind_centre_m(spec)
    return world(x - back * math.cos(heading_rad), y - back * math.sin(heading_rad), heading_rad)


def world(x: float, y: float, heading_rad: float | None = None) -> Xosc:
    """Return a `WorldPosition` on the ground, rounded; heading in rad, counter-clockwise from east."""
    h = None if heading_rad is None else figure(math.remainder(heading_rad, math.tau))
    return osc.WorldPosition(figure(x), figure(y), 0, h)


def figure(value: float) -> float:
    """Return a number rounded for writing, without a sign on zero."""
    return round(float(value), DIGITS) + 0.0


def at_once() -> Xosc:
    """Return the dynamics of an immediate change."""
    return osc.TransitionDynamics(osc.DynamicsShapes.step, osc.DynamicsDimension.time, 0)


def at_time(name: str, time_s: float, point: str = "start") -> Xosc:
    """Return a trigger at a time of the simulation; `point` is `start` or `stop`."""
    when = osc.SimulationTimeCondition(figure(time_s), osc.Rule.greaterOrEqual)
    return osc.ValueTrigger(name, 0, osc.ConditionEdge.none, when, point)


def event(name: str, actions: dict[str, Xosc], trigger: Xosc, most: int = 1) -> Xosc:
    """Return an event that runs parallel to others, at most `most` times, with actions by name."""
    new_event = osc.Event(name, osc.Priority.parallel, most)
    for action_name, action in actions.items():
        new_event.add_action(action_name, action)
    new_event.add_trigger(trigger)
    return new_event


def maneuver_group(actor: str, events: list[Xosc]) -> Xosc:
    """Return the group of one actor's events."""
    maneuver = osc.Maneuver(f"{actor}_maneuver")
    for new_event in events:
        maneuver.add_event(new_event)
    group = osc.ManeuverGroup(f"{actor}_group")
    group.add_actor(actor)
    group.add_maneuver(maneuver)
    return group
