"""The package that writes OpenSCENARIO, which is an extra, and the values that all writers share."""

from __future__ import annotations

import math
from functools import cache
from typing import Any, TypeAlias

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.placement.statements import WHEELS
from foresee_dsl.exchange.outcome import ExchangeError

MINOR_VERSION = 2
"""OpenSCENARIO XML 1.2, which simulators read today (asked for)."""
DIGITS = 6
"""Decimals of what is written. Ours: micrometres, below what can be measured in a trace."""

Xosc: TypeAlias = Any
"""An object of `scenariogeneration.xosc`, which has no types."""


@cache
def library() -> Xosc:
    """Return the module `scenariogeneration.xosc`; an `ExchangeError` where it is not installed."""
    try:
        from scenariogeneration import xosc
    except ImportError as err:
        raise ExchangeError(
            "the package scenariogeneration is missing: pip install 'foresee-dsl[openscenario]'"
        ) from err
    return xosc


class _Library:
    """`library()`, imported when its first name is asked for: `osc.Event`."""

    def __getattr__(self, name: str) -> Xosc:
        return getattr(library(), name)


osc = _Library()


def behind_centre_m(spec: ModelSpec) -> float:
    """Return how far an entity's reference point lies behind the middle of its footprint, m.

    OpenSCENARIO's is the middle of a vehicle's rear axle; of pedestrians and things the middle of their box.
    """
    return spec.length_m / 2 - spec.rear_overhang_m if spec.kind in WHEELS else 0.0


def reference_position(x: float, y: float, heading_rad: float, spec: ModelSpec) -> Xosc:
    """Return the position of an entity's reference point from the middle of its footprint."""
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
    """Return the dynamics of a step."""
    return osc.TransitionDynamics(osc.DynamicsShapes.step, osc.DynamicsDimension.time, 0)


def at_time(name: str, time_s: float, point: str = "start") -> Xosc:
    """Return a trigger that fires at a time of the simulation and starts (or stops: `stop`) something."""
    when = osc.SimulationTimeCondition(figure(time_s), osc.Rule.greaterOrEqual)
    return osc.ValueTrigger(name, 0, osc.ConditionEdge.none, when, point)


def event(name: str, actions: dict[str, Xosc], trigger: Xosc, most: int = 1) -> Xosc:
    """Return an event that runs beside others, `most` times at most, with actions by name."""
    made = osc.Event(name, osc.Priority.parallel, most)
    for action_name, action in actions.items():
        made.add_action(action_name, action)
    made.add_trigger(trigger)
    return made


def maneuver_group(actor: str, events: list[Xosc]) -> Xosc:
    """Return the group of everything that one actor does."""
    maneuver = osc.Maneuver(f"{actor}_maneuver")
    for one in events:
        maneuver.add_event(one)
    group = osc.ManeuverGroup(f"{actor}_group")
    group.add_actor(actor)
    group.add_maneuver(maneuver)
    return group
