"""The package that writes OpenSCENARIO, which is an extra, and what all who use it share."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.placement.starts import WHEELS
from foresee_dsl.exchange.outcome import ExchangeError

MINOR_VERSION = 2
"""OpenSCENARIO XML 1.2, which simulators read today (asked for)."""
DIGITS = 6
"""Decimals of what is written: micrometres, so that nothing of a trace's place is lost that anybody could measure."""


@cache
def library() -> Any:  # noqa: ANN401 - the package has no types
    """Return `scenariogeneration.xosc`.

    Raises:
        ExchangeError: it is not installed.
    """
    try:
        from scenariogeneration import xosc
    except ImportError as err:
        raise ExchangeError(
            "the package scenariogeneration is missing: pip install 'foresee-dsl[openscenario]'"
        ) from err
    return xosc


def behind_centre_m(spec: ModelSpec) -> float:
    """Return how far an entity's reference point lies behind the middle of its footprint, m.

    OpenSCENARIO's is the middle of a vehicle's rear axle; of pedestrians and things the middle of their box.
    """
    return spec.length_m / 2 - spec.rear_overhang_m if spec.kind in WHEELS else 0.0


def reference_point(x: float, y: float, heading_rad: float, spec: ModelSpec) -> tuple[float, float]:
    """Return an entity's reference point from the middle of its footprint, m."""
    back = behind_centre_m(spec)
    return x - back * math.cos(heading_rad), y - back * math.sin(heading_rad)


def world(x: float, y: float, heading_rad: float | None = None) -> Any:  # noqa: ANN401 - as above
    """Return a `WorldPosition` on the ground, rounded; heading in rad, counter-clockwise from east."""
    h = None if heading_rad is None else figure(math.remainder(heading_rad, math.tau))
    return library().WorldPosition(figure(x), figure(y), 0, h)


def figure(value: float) -> float:
    """Return a number rounded for writing, without a sign on zero."""
    return round(float(value), DIGITS) + 0.0


def at_once() -> Any:  # noqa: ANN401 - as above
    """Return the dynamics of a step."""
    osc = library()
    return osc.TransitionDynamics(osc.DynamicsShapes.step, osc.DynamicsDimension.time, 0)


def at_time(name: str, time_s: float, point: str = "start") -> Any:  # noqa: ANN401 - as above
    """Return a trigger that fires at a time of the simulation and starts (or stops: `stop`) something."""
    osc = library()
    when = osc.SimulationTimeCondition(figure(time_s), osc.Rule.greaterOrEqual)
    return osc.ValueTrigger(name, 0, osc.ConditionEdge.none, when, point)


def event(name: str, actions: list[tuple[str, Any]], trigger: Any) -> Any:  # noqa: ANN401 - as above
    """Return an event that runs beside others, with named actions."""
    osc = library()
    made = osc.Event(name, osc.Priority.parallel)
    for action_name, action in actions:
        made.add_action(action_name, action)
    made.add_trigger(trigger)
    return made
