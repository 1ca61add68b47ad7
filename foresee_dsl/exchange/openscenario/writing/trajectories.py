"""A recorded run as OpenSCENARIO: every actor follows its recorded trajectory, frame by frame."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.exchange.openscenario.writing.library import (
    Xosc,
    at_time,
    event,
    figure,
    maneuver_group,
    osc,
    reference_position,
)
from foresee_dsl.simulate.trace import HEADING, Trace, X, Y

STANDS_M = 1e-6
"""An actor that moved less between two frames stood: a vertex at either end of that time is enough."""


def groups(trace: Trace, specs: dict[str, ModelSpec]) -> list[Xosc]:
    """Return a maneuver group for each actor that moves, comes later or goes before the end."""
    return [made for k in range(len(trace.actors)) if (made := _group(trace, k, specs[trace.actors[k].id])) is not None]


def present(trace: Trace, actor: int) -> tuple[int, int] | None:
    """Return the first and last frame in which an actor is there, or None."""
    frames = np.flatnonzero(~np.isnan(trace.states[:, actor, X]))
    return (int(frames[0]), int(frames[-1])) if len(frames) else None


def vertices(trace: Trace, actor: int) -> Iterator[int]:
    """Yield the frames that an actor's trajectory needs: all, but for the inside of times at which it stood."""
    span = present(trace, actor)
    if span is None:
        return
    rows = trace.states[span[0] : span[1] + 1, actor][:, [X, Y, HEADING]]
    still = np.abs(np.diff(rows, axis=0)).max(axis=1) < STANDS_M if len(rows) > 1 else np.zeros(0, dtype=bool)
    last = len(rows) - 1
    for k in range(len(rows)):
        if not (0 < k < last and still[k - 1] and still[k]):
            yield span[0] + k


def _group(trace: Trace, actor: int, spec: ModelSpec) -> Xosc:
    name, span = trace.actors[actor].id, present(trace, actor)
    if span is None:
        return None

    def position(frame: int) -> Xosc:
        x, y, heading_rad = (float(value) for value in trace.states[frame, actor, [X, Y, HEADING]])
        return reference_position(x, y, math.remainder(heading_rad, math.tau), spec)

    def at(frame: int) -> Xosc:
        return at_time("time", float(trace.time_s[frame]))

    first, last = span
    events = []
    frames = list(vertices(trace, actor))
    rows = trace.states[first : last + 1, actor][:, [X, Y, HEADING]]
    if first > 0:
        events.append(event(f"{name}_comes", {"comes": osc.AddEntityAction(name, position(first))}, at(first)))
    if len(frames) > 1 and np.ptp(rows, axis=0).max() >= STANDS_M:
        line = osc.Trajectory(f"{name}_trajectory", False)
        line.add_shape(osc.Polyline([figure(trace.time_s[k]) for k in frames], [position(k) for k in frames]))
        follow = osc.FollowTrajectoryAction(line, osc.FollowingMode.position, osc.ReferenceContext.absolute, 1, 0)
        events.append(event(f"{name}_goes", {"goes": follow}, at(first)))
    if last < trace.frames - 1:
        events.append(event(f"{name}_leaves", {"leaves": osc.DeleteEntityAction(name)}, at(last + 1)))
    return maneuver_group(name, events) if events else None
