"""Reads one frame of a run: the actors that are present, their places, the rest of their routes, and the progress of
those that follow recorded tracks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.compile.placement.statements import item, playback_of, track_of
from foresee_dsl.compile.roads.topology import junction_of
from foresee_dsl.compile.tracks import read_tracks
from foresee_dsl.language import model as m
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.traversal import si_of
from foresee_dsl.simulate.actors.track_followers import TrackClock
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
    on = [junction_of(edge) == junction for edge in edges_driven(trace, actor, frame)]
    return any(on) and not on[-1]


_DIGITS = 6
"""Decimals of a track's time, s, and of a speed, m/s. Ours: at 50 m/s the place is off by 0.05 mm."""
_FEW_DIGITS = 2
"""Decimals of a time that is a multiple of 0.01 s, as it is without a `timing` and without braking."""


@dataclass(frozen=True)
class TrackProgress:
    """An actor that follows its track at the clip's beginning, or that is not there yet.

    Attributes:
        clock: the time of its track at that moment.
        leaves: whether it was told to leave its track, but has not left it yet.
        over_s: the time of the track at which it began to move to its line.
    """

    clock: TrackClock
    leaves: bool
    over_s: float

    def statements(self, actor: m.Actor) -> tuple[m.ActorItem, ...]:
        """Return the statements about its way: the track, the edges that it may join, and its line."""
        track, joins, line = track_of(actor), item(actor, m.Joins), item(actor, m.Line)
        items: list[m.ActorItem] = [] if track is None else [_track_from(track, self.clock.time_s)]
        items += [] if joins is None else [joins]
        if self.clock.is_slow:
            items.append(m.StartSpeed(speed=m.Quantity.of(abs(self.clock.speed_mps), "speed", _DIGITS)))
        if line is not None:
            items.append(m.Line(left=line.left, start=_time(self.over_s - self.clock.time_s)))
        return tuple(items)


def _track_from(track: m.Track, time_s: float) -> m.Track:
    """Return the statement for a track that begins at another time."""
    return track.model_copy(update={"start": _time(time_s)})


def track_progress(case: TestCase, trace: Trace, frame: int) -> Mapping[str, TrackProgress]:
    """Return the actors that follow a track at a frame of a run, or will be there later, by name.

    The clocks are computed again from the statements, because nothing else in a run changes them.
    """
    statements = [(actor, track) for actor in case.scenario.all(m.Actor) if (track := track_of(actor)) is not None]
    if not statements or case.tracks is None:
        return {}
    tracks, now_s = read_tracks(case.tracks), float(trace.time_s[frame]) + 1e-6
    orders = {(event.actor, event.what) for event in trace.events if event.time_s <= now_s}
    actors: dict[str, TrackProgress] = {}
    for actor, statement in statements:
        playback = playback_of(actor, tracks[statement.name], spec_of(case.models[str(actor.model)]))
        clock = TrackClock(playback)
        for _ in range(frame):
            clock.step()
        column = trace.index(actor.name)
        there = not math.isnan(trace.states[frame, column, X])
        waits = clock.time_s < playback.track.begin_s and (actor.name, "leaves") not in orders
        if waits if not there else not math.isnan(trace.along[frame, column]):
            leaves = (actor.name, "leaves_track") in orders
            actors[actor.name] = TrackProgress(clock, leaves, playback.moves_over_s)
    return actors


def ego_track(ego: m.Ego, now_s: float) -> m.Track | None:
    """Return the statement with the ego's track for a clip that begins at this time of the run, s."""
    track = track_of(ego)
    return None if track is None else _track_from(track, (0.0 if track.start is None else si_of(track.start)) + now_s)


def _time(time_s: float) -> m.Quantity:
    exact = math.isclose(time_s, round(time_s, _FEW_DIGITS), abs_tol=10.0**-_DIGITS / 2)
    return m.Quantity.of(time_s, "time", _FEW_DIGITS if exact else _DIGITS)
