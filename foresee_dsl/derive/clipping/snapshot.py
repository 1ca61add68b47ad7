"""Reads one frame of a run: the actors that are present, their places, and the rest of their routes."""

from __future__ import annotations

import math

from foresee_dsl.simulate.trace import HEADING, Trace, X, Y


def present(trace: Trace, frame: int) -> tuple[int, ...]:
    """Return the columns of the actors that are in the world at a frame; the ego is first."""
    return tuple(k for k in range(len(trace.actors)) if not math.isnan(trace.states[frame, k, X]))


def front(trace: Trace, actor: int, frame: int) -> tuple[float, float]:
    """Return the middle of an actor's front, m; the trace itself contains the middle of the footprint."""
    state, ahead = trace.states[frame, actor], trace.actors[actor].front_m
    return float(state[X] + ahead * math.cos(state[HEADING])), float(state[Y] + ahead * math.sin(state[HEADING]))


def remaining_route(trace: Trace, actor: int, frame: int, current_route: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Return the edges that an actor still has to drive; the first is the edge that it is on.

    On a junction (or off the lanes) the first is the edge from which it came, as SUMO needs it. The ego's route begins
    as far back as possible without an edge occurring twice, because the line of the route depends on where the ego came
    from. `current_route`: the actor's present route, if it is not the one with which it began.
    """
    route = current_route or trace.actors[actor].route
    at = 0
    for edge in edges_driven(trace, actor, frame):
        ahead = [k for k in range(at, len(route)) if route[k] == edge]
        at = ahead[0] if ahead else at
    while actor == 0 and at and route[at - 1] not in route[at:]:
        at -= 1
    return route[at:]


def edges_driven(trace: Trace, actor: int, frame: int) -> list[str]:
    """Return the edges on which an actor was up to a frame, in order; ids of junctions' edges begin with `:`."""
    edges: list[str] = []
    for lane in trace.lanes[: frame + 1, actor]:
        edge = trace.lane_ids[lane].rpartition("_")[0] if lane >= 0 else ""
        if edge and (not edges or edges[-1] != edge):
            edges.append(edge)
    return edges


def has_passed(trace: Trace, actor: int, junction: str, frame: int) -> bool:
    """Return whether an actor was on a junction and has left it at a frame."""
    on = [_junction_of(edge) == junction for edge in edges_driven(trace, actor, frame)]
    return any(on) and not on[-1]


def _junction_of(edge: str) -> str:
    """Return the junction of an edge: `:j4_3` lies in junction `j4`."""
    return edge[1:].rpartition("_")[0] if edge.startswith(":") else ""
