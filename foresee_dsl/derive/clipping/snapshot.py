"""A run at one frame: which actors are there, where, and the rest of their routes."""

from __future__ import annotations

import math

from foresee_dsl.simulate.trace import HEADING, Trace, X, Y


def present(trace: Trace, frame: int) -> tuple[int, ...]:
    """Return the columns of the actors that are in the world at a frame; the ego is first."""
    return tuple(k for k in range(len(trace.actors)) if not math.isnan(trace.states[frame, k, X]))


def front(trace: Trace, actor: int, frame: int) -> tuple[float, float]:
    """Return the middle of an actor's front, m (the trace holds the middle of the footprint)."""
    state, ahead = trace.states[frame, actor], trace.actors[actor].front_m
    return float(state[X] + ahead * math.cos(state[HEADING])), float(state[Y] + ahead * math.sin(state[HEADING]))


def remaining_route(trace: Trace, actor: int, frame: int, given: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Return the edges that an actor has still to drive, the first being the one it is on.

    On a junction (or off the lanes) that is the edge it came from, as SUMO wants it. The ego's begins as far back as it
    does not come to the same edge twice: the line that it follows depends on where it came from. `given`: the route
    that it has now, if not the one that it began with.
    """
    route = given or trace.actors[actor].route
    at = 0
    for edge in edges_driven(trace, actor, frame):
        ahead = [k for k in range(at, len(route)) if route[k] == edge]
        at = ahead[0] if ahead else at
    while actor == 0 and at and route[at - 1] not in route[at:]:
        at -= 1
    return route[at:]


def edges_driven(trace: Trace, actor: int, frame: int) -> list[str]:
    """Return the edges that an actor was on up to a frame, in order, each change once; junctions' begin with `:`."""
    edges: list[str] = []
    for lane in trace.lanes[: frame + 1, actor]:
        edge = trace.lane_ids[lane].rpartition("_")[0] if lane >= 0 else ""
        if edge and (not edges or edges[-1] != edge):
            edges.append(edge)
    return edges


def has_passed(trace: Trace, actor: int, junction: str, frame: int) -> bool:
    """Say whether an actor has been on a junction and left it again before a frame."""
    on = [_junction_of(edge) == junction for edge in edges_driven(trace, actor, frame)]
    return any(on) and not on[-1]


def _junction_of(edge: str) -> str:
    """`:j4_3` lies in junction `j4`."""
    return edge[1:].rpartition("_")[0] if edge.startswith(":") else ""
