"""How far a player that does what is written comes from the run: no player knows what traffic does by itself."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.bundle import PlacedActor
from foresee_dsl.simulate.trace import STEP_S, Trace, X, Y

_FAR_M = 1.0
"""What is said: an actor farther off than this (ours: what a person sees in two films side by side)."""
_LOOKS_S = (3.0, 8.0)
"""When it is looked (the two times at which exports were compared with a player)."""


@dataclass(frozen=True)
class SpeedOrder:
    """A written change of speed.

    Attributes:
        time_s: when it begins in the run. to_mps: the speed that it ends with.
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
) -> Iterator[str]:
    """Yield a sentence about each actor whose motion a player does not know.

    Args:
        actors: of the scene. trace: of the run.
        orders: their written changes of speed. led: those that keep to another actor, with what they do.
        turned: when those change lane that are told to, s.
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
            yield f"{actor.id} {led[actor.id]}: how, the player decides"
        elif far:
            where = ", ".join(f"{metres:.1f} m after {time_s:g} s" for time_s, metres in far.items())
            why = (
                "it changes lane by itself"
                if abs(aside[looks[-1]]) > _FAR_M
                else "it drives as traffic and bends allow"
            )
            yield f"{actor.id} is off this run in a player that keeps to what is written, by about {where}: {why}"


def _written(
    actor: PlacedActor, orders: Sequence[SpeedOrder], frames: int
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return how far an actor comes that does what is written and nothing else, m at each frame."""
    speed, along, found = actor.speed_mps, 0.0, [0.0]
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
        found.append(along)
    return np.array(found)


def _aside(actor: PlacedActor, states: NDArray[np.float64], turned: Sequence[float]) -> NDArray[np.float64]:
    """Return how far to the side of its way an actor is, m at each frame, from its first lane change without an order
    on; 0 for one on a path."""
    zero = np.zeros(len(states))
    if actor.line is None or turned:
        return zero
    found, at = [], actor.line.origin_s
    for x, y in states:
        if math.isnan(x):
            found.append(0.0)
            continue
        at, beside = actor.line.project(float(x), float(y), at)
        found.append(beside)
    return np.array(found) - found[0]
