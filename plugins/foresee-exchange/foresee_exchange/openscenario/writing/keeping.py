"""Predicts how far a player of an exported file deviates from the run: a player does not know the decisions of
traffic.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.bundle import PlacedActor
from foresee_dsl.simulate.trace import STEP_S, Trace, X, Y

_FAR_M = 1.0
"""An actor that is farther off than this is reported, m (ours: visible in two films side by side)."""
_LOOKS_S = (3.0, 8.0)
"""Times at which the deviation is measured, s (those at which exports were compared with a player)."""


@dataclass(frozen=True)
class SpeedOrder:
    """An exported change of speed.

    Attributes:
        time_s: its start in the run. to_mps: the final speed.
        over_s, rate_mps2: its duration, or its rate; with neither the speed changes at once.
    """

    time_s: float
    to_mps: float
    over_s: float | None = None
    rate_mps2: float | None = None


def notes_of(
    actors: Sequence[PlacedActor],
    trace: Trace,
    orders: Mapping[str, Sequence[SpeedOrder]],
    led: Mapping[str, str],
    turned: Mapping[str, Sequence[float]],
    forks: Mapping[str, str],
) -> Iterator[str]:
    """Yield a note on each actor whose motion a player cannot reproduce.

    Args:
        actors: the actors of the scene. trace: the trace of the run.
        orders: the actors' exported changes of speed. led: actors that keep to another actor, with the action's text.
        turned: times of ordered lane changes, s.
        forks: junctions at which the lane of an actor leads to two lanes of its next road.
    """
    names = [info.id for info in trace.actors]
    for actor in actors:
        if actor.control not in ("sumo", "path") or actor.id not in names:
            continue
        states = trace.states[:, names.index(actor.id)][:, [X, Y]]
        there = ~np.isnan(states[:, 0])
        if not there[0]:
            continue
        steps = np.hypot(*np.diff(states, axis=0).T)
        covered = np.r_[0.0, np.cumsum(np.where(np.isnan(steps), 0.0, steps))]
        written = _written(actor, sorted(orders.get(actor.id, ()), key=lambda order: order.time_s), len(covered))
        aside = _aside(actor, states, turned.get(actor.id, ()))
        off = np.where(there, np.hypot(covered - written, aside), 0.0)
        looks = [k for k in (round(t / STEP_S) for t in _LOOKS_S) if k < len(off) and there[k]] or [
            int(there.sum()) - 1
        ]
        far = {k * STEP_S: float(off[k]) for k in looks if off[k] > _FAR_M}
        if actor.id in led:
            yield f"{actor.id} {led[actor.id]}: the player decides how"
        elif far:
            where = ", ".join(f"{metres:.1f} m after {time_s:g} s" for time_s, metres in far.items())
            why = (
                "it changes lane by itself"
                if abs(aside[looks[-1]]) > _FAR_M
                else "it drives as traffic and bends allow"
            )
            yield f"in a player that follows the file exactly, {actor.id} deviates from this run by {where}: {why}"
        elif actor.id in forks:
            yield f"{actor.id} can continue on two lanes at {forks[actor.id]}, and the player decides on which of them"


def _written(
    actor: PlacedActor, orders: Sequence[SpeedOrder], frames: int
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the distance covered by an actor that only obeys the exported orders, m at each frame."""
    speed, along, covered = actor.speed_mps, 0.0, [0.0]
    order: SpeedOrder | None = None
    begin_mps, upcoming = speed, list(orders)
    for frame in range(1, frames):
        now_s = (frame - 1) * STEP_S
        while upcoming and upcoming[0].time_s <= now_s + 1e-6:
            order, begin_mps = upcoming.pop(0), speed
        before = speed
        if order is not None:
            gap = order.to_mps - speed
            most = math.inf
            if order.over_s:
                most = abs(order.to_mps - begin_mps) / order.over_s * STEP_S
            elif order.rate_mps2:
                most = order.rate_mps2 * STEP_S
            speed += math.copysign(min(abs(gap), most), gap)
        along += (before + speed) / 2 * STEP_S
        covered.append(along)
    return np.array(covered)


def _aside(actor: PlacedActor, states: NDArray[np.float64], turned: Sequence[float]) -> NDArray[np.float64]:
    """Return an actor's lateral distance from its way, m at each frame, from its first lane change without an order on;
    0 for an actor on a path."""
    zero = np.zeros(len(states))
    if actor.line is None or turned:
        return zero
    offsets, at = [], actor.line.origin_s
    for x, y in states:
        if math.isnan(x):
            offsets.append(0.0)
            continue
        at, beside = actor.line.project(float(x), float(y), at)
        offsets.append(beside)
    return np.array(offsets) - offsets[0]
