"""Recorded runs as OpenSCENARIO: everybody goes where he went, frame by frame."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.exchange.openscenario.writing.library import at_time, event, figure, library, reference_point, world
from foresee_dsl.simulate.trace import HEADING, Trace, X, Y

STANDS_M = 1e-6
"""Who moved less between two frames stood: one vertex at either end of the time is enough."""


def groups(trace: Trace, specs: dict[str, ModelSpec]) -> list[Any]:
    """Return a maneuver group for each actor that moves, comes later or goes before the end."""
    return [made for k in range(len(trace.actors)) if (made := _group(trace, k, specs[trace.actors[k].id])) is not None]


def stays(trace: Trace, actor: int) -> tuple[int, int] | None:
    """Return the first and last frame at which an actor is there, or None."""
    there = np.flatnonzero(~np.isnan(trace.states[:, actor, X]))
    return (int(there[0]), int(there[-1])) if len(there) else None


def vertices(trace: Trace, actor: int) -> Iterator[int]:
    """Yield the frames that an actor's trajectory needs: all, but for the inside of times at which it stood."""
    span = stays(trace, actor)
    if span is None:
        return
    rows = trace.states[span[0] : span[1] + 1, actor][:, [X, Y, HEADING]]
    still = np.abs(np.diff(rows, axis=0)).max(axis=1) < STANDS_M if len(rows) > 1 else np.zeros(0, dtype=bool)
    last = len(rows) - 1
    for k in range(len(rows)):
        if not (0 < k < last and still[k - 1] and still[k]):
            yield span[0] + k


def _group(trace: Trace, actor: int, spec: ModelSpec) -> Any:  # noqa: ANN401 - the library has no types
    osc = library()
    info, span = trace.actors[actor], stays(trace, actor)
    if span is None:
        return None
    maneuver = osc.Maneuver(f"{info.id}_maneuver")
    frames = list(vertices(trace, actor))
    begins_s = float(trace.time_s[span[0]])
    if span[0] > 0:
        add = osc.AddEntityAction(info.id, _position(trace, actor, span[0], spec))
        maneuver.add_event(event(f"{info.id}_comes", [("comes", add)], at_time("time", begins_s)))
    if len(frames) > 1 and _moves(trace, actor, span):
        follow = osc.FollowTrajectoryAction(
            _trajectory(trace, actor, frames, spec), osc.FollowingMode.position, osc.ReferenceContext.absolute, 1, 0
        )
        maneuver.add_event(event(f"{info.id}_goes", [("goes", follow)], at_time("time", begins_s)))
    if span[1] < trace.frames - 1:
        gone_s = float(trace.time_s[span[1] + 1])
        leave = osc.DeleteEntityAction(info.id)
        maneuver.add_event(event(f"{info.id}_leaves", [("leaves", leave)], at_time("time", gone_s)))
    if not maneuver.events:
        return None
    group = osc.ManeuverGroup(f"{info.id}_group")
    group.add_actor(info.id)
    group.add_maneuver(maneuver)
    return group


def _moves(trace: Trace, actor: int, span: tuple[int, int]) -> bool:
    rows = trace.states[span[0] : span[1] + 1, actor][:, [X, Y, HEADING]]
    return bool(np.ptp(rows, axis=0).max() >= STANDS_M)


def _trajectory(trace: Trace, actor: int, frames: list[int], spec: ModelSpec) -> Any:  # noqa: ANN401 - as above
    osc = library()
    line = osc.Polyline([figure(trace.time_s[k]) for k in frames], [_position(trace, actor, k, spec) for k in frames])
    made = osc.Trajectory(f"{trace.actors[actor].id}_trajectory", False)
    made.add_shape(line)
    return made


def _position(trace: Trace, actor: int, frame: int, spec: ModelSpec) -> Any:  # noqa: ANN401 - as above
    row = trace.states[frame, actor]
    heading = math.remainder(float(row[HEADING]), math.tau)
    return world(*reference_point(float(row[X]), float(row[Y]), heading, spec), heading)
