"""Traces with known answers, made of straight tracks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.catalogue import USUAL_HEIGHTS_M
from foresee_dsl.simulate.sensing.sight import Bodies, Sight
from foresee_dsl.simulate.trace import STEP_S, ActorInfo, Event, Trace
from foresee_dsl.simulate.trigger_record import DirectorRecord

SIZES = {
    "car": ("car.compact", 4.0, 1.8, 2.5),
    "van": ("van.delivery", 6.0, 2.0, 3.6),
    "bicycle": ("bicycle.city", 1.8, 0.6, 1.1),
    "pedestrian": ("pedestrian.adult", 0.5, 0.5, 0.0),
    "obstacle": ("obstacle.barrier", 2.0, 0.5, 0.0),
}
EAST, NORTH, WEST, SOUTH = 0.0, math.pi / 2, math.pi, -math.pi / 2


@dataclass(frozen=True)
class Track:
    """One actor: its states [T, 7] and its description."""

    kind: str
    states: NDArray[np.float64]
    route: tuple[str, ...] = ()
    path: tuple[tuple[float, float], ...] = ()
    lanes: tuple[str, ...] = ()
    """The lane of each frame; one for all when there is one."""
    cruise_mps: float = 0.0


def straight(
    kind: str, x: float, y: float, heading: float, speed: float, *, seconds: float = 20.0, start_s: float = 0.0
) -> Track:
    """Drive straight on at one speed from `start_s` on (standing before), from the centre (x, y)."""
    time_s = np.arange(round(seconds / STEP_S) + 1) * STEP_S
    gone = speed * np.maximum(0.0, time_s - start_s)
    states = np.zeros((len(time_s), 7))
    states[:, 0] = x + gone * math.cos(heading)
    states[:, 1] = y + gone * math.sin(heading)
    states[:, 2] = heading
    states[:, 3] = np.where(time_s >= start_s, speed, 0.0)
    return Track(kind, states)


def until(track: Track, seconds: float) -> Track:
    """Take the actor out of the world after a time."""
    states = track.states.copy()
    states[round(seconds / STEP_S) + 1 :] = np.nan
    return replace(track, states=states)


def make_trace(
    tracks: Mapping[str, Track],
    *,
    events: Sequence[Event] = (),
    director: DirectorRecord | None = None,
    waypoints: NDArray[np.float64] | None = None,
    signals: Mapping[str, tuple[tuple[str, ...], int, float]] | None = None,
) -> Trace:
    """Put tracks together; the first is the ego. `signals`: name to stages, the one that shows, and since when (s)."""
    frames = len(next(iter(tracks.values())).states)
    lane_ids = sorted({lane for t in tracks.values() for lane in t.lanes if lane})
    lanes = np.full((frames, len(tracks)), -1, dtype=np.int32)
    along = np.full((frames, len(tracks)), np.nan)
    actors = []
    for k, (name, track) in enumerate(tracks.items()):
        model, length, width, wheelbase = SIZES[track.kind]
        actors.append(
            ActorInfo(name, track.kind, model, length, width, wheelbase, track.route, track.path, track.cruise_mps)
        )
        if track.lanes:
            each = track.lanes * frames if len(track.lanes) == 1 else track.lanes
            lanes[:, k] = [lane_ids.index(lane) if lane else -1 for lane in each[:frames]]
        if track.path:
            along[:, k] = np.hypot(*(track.states[:, :2] - track.path[0]).T)
    shown = signals or {}
    time_s = np.round(np.arange(frames) * STEP_S, 6)
    ego = next(iter(tracks.values())).states
    return Trace(
        time_s=time_s,
        states=np.stack([t.states for t in tracks.values()], axis=1),
        lanes=lanes,
        along=along,
        stages=np.array([[s[1] for s in shown.values()]] * frames, dtype=np.int16).reshape(frames, len(shown)),
        elapsed=np.array([[s[2] + t for s in shown.values()] for t in time_s]).reshape(frames, len(shown)),
        waypoints=ego[::4, :2].copy() if waypoints is None else waypoints,
        actors=tuple(actors),
        lane_ids=tuple(lane_ids),
        signals=tuple(shown),
        signal_stages=tuple(s[0] for s in shown.values()),
        events=tuple(events),
        director=director or DirectorRecord(),
    )


def clear_sight(trace: Trace) -> Sight:
    """The lines of sight from the ego of a trace: no buildings, clear air, and every actor as high as its class usually
    is.
    """
    others = trace.actors[1:]
    sizes = np.array([(info.length_m, info.width_m) for info in others], dtype=np.float64).reshape(-1, 2)
    kinds = tuple(info.kind for info in others)
    return Sight(Bodies(kinds, sizes, np.array([USUAL_HEIGHTS_M[kind] for kind in kinds])), ())
