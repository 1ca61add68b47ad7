"""Restates, at a clip's beginning, the actors that follow recorded tracks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from foresee_dsl.compile.catalogue import spec_of
from foresee_dsl.compile.placement.statements import item, playback_of, track_of
from foresee_dsl.compile.tracks import read_tracks
from foresee_dsl.language import model as m
from foresee_dsl.language.project.document import TestCase
from foresee_dsl.language.traversal import si_of
from foresee_dsl.simulate.actors.track_followers import TrackClock
from foresee_dsl.simulate.trace import Trace, X

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
        items: list[m.ActorItem] = [] if track is None else [track_from(track, self.clock.time_s)]
        items += [] if joins is None else [joins]
        if self.clock.is_slow:
            items.append(m.StartSpeed(speed=m.Quantity.of(abs(self.clock.speed_mps), "speed", _DIGITS)))
        if line is not None:
            items.append(m.Line(left=line.left, start=_time(self.over_s - self.clock.time_s)))
        return tuple(items)


def track_from(track: m.Track, time_s: float) -> m.Track:
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
    return None if track is None else track_from(track, (0.0 if track.start is None else si_of(track.start)) + now_s)


def _time(time_s: float) -> m.Quantity:
    exact = math.isclose(time_s, round(time_s, _FEW_DIGITS), abs_tol=10.0**-_DIGITS / 2)
    return m.Quantity.of(time_s, "time", _FEW_DIGITS if exact else _DIGITS)
