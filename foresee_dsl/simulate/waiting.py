"""What an ego waits for: whether there is anything, and in words: an actor in its way, a signal, a junction.

This judges the run, so that it depends on where all actors are, not on what the driver sees.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foresee_dsl.simulate.actors.moved_actors import STANDS_MPS, PathActor
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import Actor
from foresee_dsl.simulate.recorder import Recorder

AHEAD_M = 30.0
"""A signal or an actor that is farther along the ego's route is nothing to wait for. Ours: a stopped queue of four cars
and the gap before it; those behind have another in front."""
CLOSE_AHEAD_M = 15.0
"""An actor in front that is this near is something to wait for, also beside the route. Ours: two car lengths and a
crossing's width."""
BESIDE_M = 0.8
"""A footprint this far beside the ego's is in its way all the same. Ours: what drivers leave to a pedestrian."""
JUNCTION_M = 10.0
"""A junction this near is what an ego that stands before it waits at. Ours: two cars' lengths."""


class _Ahead(NamedTuple):
    gap_m: float
    actor: Actor


def may_wait(simulation: Simulation) -> bool:
    """Return whether there is something to wait for: a signal that is not green, or an actor (no static object) in
    front."""
    ego = simulation.ego
    if ego.speed >= STANDS_MPS:
        return True  # it does not wait, so the question does not arise
    if _signal(simulation) is not None:
        return True
    cos, sin = np.cos(ego.heading), np.sin(ego.heading)
    return any(
        other.placed.control != "static"
        and np.hypot(other.x - ego.x, other.y - ego.y) <= CLOSE_AHEAD_M
        and (other.x - ego.x) * cos + (other.y - ego.y) * sin > 0
        for other in simulation.others(ego)
    )


def waits_for(simulation: Simulation, recorder: Recorder) -> str:
    """Return a clause such as `it stands since 9.10 s, 41 m before its goal, 3.1 m behind walker (pedestrian), ...`."""
    ego = simulation.ego
    goal_m = simulation.scene.goal_s - simulation.progress.of(ego, simulation.frame)[0]
    before = f", {goal_m:.0f} m before its goal" if goal_m > 0 else ""
    if ego.speed >= STANDS_MPS:
        moves = f"the ego still drives at {ego.speed * 3.6:.0f} km/h{before}"
        ahead = _ahead(simulation)
        return moves + (f", {_behind(simulation, recorder, ahead)}" if ahead is not None else "")
    since_s = recorder.stands_since(0, STANDS_MPS)
    stands = f"the ego stands since {since_s:.2f} s{before}"
    ahead = _ahead(simulation)
    signal = _signal(simulation)
    if signal is not None and (ahead is None or signal[0] <= ahead.gap_m):
        return f"{stands}, before the {signal[1]} signal of {signal[2]}"
    if ahead is not None:
        return f"{stands}, {_behind(simulation, recorder, ahead)}"
    for passage, room in simulation.progress.ahead(ego, simulation.frame, JUNCTION_M):
        where = "inside junction" if room < 0 else f"{room:.1f} m before junction"
        near = _nearest(simulation)
        return f"{stands}, {where} {passage.junction}{f'; nearest to it is {near}' if near else ''}"
    return f"{stands}, and nobody is ahead of it on its route"


def _behind(simulation: Simulation, recorder: Recorder, ahead: _Ahead) -> str:
    """Say who is ahead, and why that one does not go on."""
    actor = ahead.actor
    name = f"{max(ahead.gap_m, 0.0):.1f} m behind {actor.id} ({actor.placed.model.kind})"
    if actor.placed.control == "static":
        return f"{name}, which the scenario parks there"
    if actor.speed >= STANDS_MPS:
        return f"{name}, which moves at {actor.speed * 3.6:.0f} km/h"
    since_s = recorder.stands_since(simulation.actors.index(actor), STANDS_MPS)
    if isinstance(actor, PathActor) and actor.follower.arrived:
        return (
            f"{name}, which came to the end of its path in the ego's way after {since_s:.2f} s and stays there: "
            "let the scenario's path go on beyond the lane"
        )
    return f"{name}, which stands since {since_s:.2f} s"


def _ahead(simulation: Simulation) -> _Ahead | None:
    """Return the nearest actor in the way along the ego's route."""
    ego, line = simulation.ego, simulation.ego.placed.line
    if line is None:
        return None
    here_m, aside_m = simulation.progress.of(ego, simulation.frame)
    found = []
    for other in simulation.others(ego):
        s, lateral = line.project(other.x, other.y)
        gap_m = s - here_m - (ego.length + other.length) / 2
        if s > here_m and gap_m <= AHEAD_M and abs(lateral - aside_m) <= (ego.width + other.width) / 2 + BESIDE_M:
            found.append(_Ahead(gap_m, other))
    return min(found, key=lambda one: (one.gap_m, one.actor.id), default=None)


def _signal(simulation: Simulation) -> tuple[float, str, str] | None:
    """Return the next signal on the route that is not green: how far it is, its colour, its junction."""
    for passage, room in simulation.progress.ahead(simulation.ego, simulation.frame, AHEAD_M):
        tls, link = passage.movement.tls, passage.movement.link
        if room >= 0 and tls is not None and link >= 0:
            colour = simulation.world.signals.colour(tls, link)
            return (room, colour, passage.junction) if colour in ("red", "amber") else None
    return None


def _nearest(simulation: Simulation) -> str:
    """Name the nearest actor that is no static object."""
    ego = simulation.ego
    apart = [
        (((other.x - ego.x) ** 2 + (other.y - ego.y) ** 2) ** 0.5, other)
        for other in simulation.others(ego)
        if other.placed.control != "static"
    ]
    if not apart:
        return ""
    metres, other = min(apart, key=lambda one: (one[0], one[1].id))
    return f"{other.id} ({other.placed.model.kind}), {metres:.0f} m away at {other.speed * 3.6:.0f} km/h"
