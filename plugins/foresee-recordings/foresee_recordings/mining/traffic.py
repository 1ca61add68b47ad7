"""A recording at the frames of a run: the states of all actors in one table, and the way that each actor drove."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.kernels.lines import feet_on_path
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.triggers.ways import BEHIND_M, BEYOND_M
from foresee_recordings.recording import FloatArray, Recording, RecordingError, Track

IntArray = NDArray[np.int64]
X, Y, HEADING, SPEED, ACCELERATION = range(5)
"""Columns of `Traffic.states`: m, m, rad, m/s, m/s^2 (along the heading)."""
SLOPE_S = 0.3
"""Half the time over which an acceleration is computed from recorded speeds, s. Ours: over 0.6 s, an error of the speed
of 0.2 m/s changes the acceleration by less than 0.7 m/s^2, and a full braking, which builds up in 0.3 s, keeps 90 %."""
WAY_STEP_M = 1.0
"""Distance between the points of a way, m: that of the core's lines (`compile.roads.polyline.STEP_M`). An actor that
stands does not add points, however its recorded position trembles."""
LONGEST_ROWS = 20_000_000
"""Largest number of states of a recording (actors times frames). Ours: 2.3 GB of memory while they are computed."""


@dataclass(frozen=True)
class DrivenWay:
    """The way that an actor drove, continued straight at both ends.

    Attributes:
        points: [M, 2] m. along: [M] length from the first point, m. heading: [M] rad, continuous.
        own_s: [N] position of the actor's centre along the way at each of its frames, m.
    """

    points: FloatArray
    along: FloatArray
    heading: FloatArray
    own_s: FloatArray

    def project(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the positions along the way, and the distances to its left, of points [K, 2], m."""
        count = len(xy)
        gaps, nearest, shares = np.empty(count), np.empty(count, np.int64), np.empty(count)
        feet_on_path(np.ascontiguousarray(xy), self.points, gaps, nearest, shares)
        low = np.where(nearest == 0, -np.inf, 0.0)
        high = np.where(nearest == len(self.points) - 2, np.inf, 1.0)
        shares = np.clip(shares, low, high)
        first = self.points[nearest]
        segment = self.points[nearest + 1] - first
        away = xy - first
        left = segment[:, 0] * away[:, 1] - segment[:, 1] * away[:, 0]
        foot = away - shares[:, None] * segment
        s = self.along[nearest] + shares * np.hypot(segment[:, 0], segment[:, 1])
        return s, np.copysign(np.hypot(foot[:, 0], foot[:, 1]), left)

    def heading_at(self, s: FloatArray) -> FloatArray:
        """Return the heading at positions along the way, rad."""
        headings: FloatArray = np.interp(s, self.along, self.heading)
        return headings


class Traffic:
    """A recording at the frames of a run, 0.05 s apart.

    Attributes:
        recording: the recording. tracks: its actors. begins_s: time of frame 0.
        first: [A] first frame of each actor. start: [A + 1] its first row in `states`; the rows of an actor are its
            frames in order.
        states: [R, 5] see `X` to `ACCELERATION`. sizes: [R, 2] length and width, m.
    """

    def __init__(self, recording: Recording) -> None:
        """Resample a recording.

        Raises:
            RecordingError: it has no actors, or is too large.
        """
        if not recording.tracks:
            raise RecordingError(f"{recording.source.name} has no actors")
        self.recording, self.tracks, self.begins_s = recording, recording.tracks, recording.begins_s
        frames = [self._frames(track) for track in self.tracks]
        counts = [last - first + 1 for first, last in frames]
        if sum(counts) > LONGEST_ROWS:
            raise RecordingError(
                f"{recording.source.name} has {sum(counts):,} states at 0.05 s, more than {LONGEST_ROWS:,}; "
                "choose a part of it with --from and --to"
            )
        self.first: IntArray = np.array([first for first, _ in frames], dtype=np.int64)
        self.start: IntArray = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        self.states: FloatArray = np.concatenate(
            [self._resampled(track, *span) for track, span in zip(self.tracks, frames, strict=True)]
        )
        self.sizes: FloatArray = np.repeat([(t.length_m, t.width_m) for t in self.tracks], counts, axis=0)
        self._ways: dict[int, DrivenWay] = {}

    def __len__(self) -> int:
        """Return the number of actors."""
        return len(self.tracks)

    @cached_property
    def ids(self) -> dict[str, int]:
        """The number of each actor by its id."""
        return {track.id: k for k, track in enumerate(self.tracks)}

    @cached_property
    def last(self) -> IntArray:
        """The last frame of each actor, [A]."""
        return self.first + np.diff(self.start) - 1

    def time_s(self, frame: int) -> float:
        """Return the recording's time of a frame, s."""
        return float(self.begins_s + frame * STEP_S)

    def frame_at(self, time_s: float) -> int:
        """Return the frame nearest to a time of the recording."""
        return round((time_s - self.begins_s) / STEP_S)

    def rows(self, actor: int, frames: IntArray) -> IntArray:
        """Return the rows of an actor at some of its frames."""
        rows: IntArray = self.start[actor] + frames - self.first[actor]
        return rows

    def part(self, actor: int, first: int | None = None, last: int | None = None) -> FloatArray:
        """Return the states of an actor from one frame up to and including another, [N, 5]; by default all."""
        low = 0 if first is None else max(int(first - self.first[actor]), 0)
        high = None if last is None else max(int(last - self.first[actor]) + 1, 0)
        return self.states[self.start[actor] : self.start[actor + 1]][low:high]

    def boxes(self, rows: IntArray) -> FloatArray:
        """Return footprints, [N, 5]: x, y, heading, length, width."""
        return np.column_stack([self.states[rows][:, [X, Y, HEADING]], self.sizes[rows]])

    def way(self, actor: int) -> DrivenWay:
        """Return the way of an actor, computed once."""
        if actor not in self._ways:
            self._ways[actor] = way_of(self.part(actor))
        return self._ways[actor]

    def _frames(self, track: Track) -> tuple[int, int]:
        """Return the first and last frame within a track's times; at least one."""
        first = math.ceil((track.time_s[0] - self.begins_s) / STEP_S - 1e-3)
        last = math.floor((track.time_s[-1] - self.begins_s) / STEP_S + 1e-3)
        return first, max(first, last)

    def _resampled(self, track: Track, first: int, last: int) -> FloatArray:
        times = self.begins_s + np.arange(first, last + 1) * STEP_S
        out = np.empty((len(times), 5))
        states = track.states.copy()
        states[:, HEADING] = np.unwrap(states[:, HEADING])
        for column in (X, Y, HEADING, SPEED):
            out[:, column] = np.interp(times, track.time_s, states[:, column])
        early = np.maximum(times - SLOPE_S, track.time_s[0])
        late = np.minimum(times + SLOPE_S, track.time_s[-1])
        change = np.interp(late, track.time_s, states[:, SPEED]) - np.interp(early, track.time_s, states[:, SPEED])
        out[:, ACCELERATION] = change / np.maximum(late - early, STEP_S)
        return out


def way_of(states: FloatArray) -> DrivenWay:
    """Return the way of an actor with these states, [N, 5]."""
    at = spaced(states[:, [X, Y]])
    points = states[at][:, [X, Y]]
    ends = []
    for k, away_m in ((0, -BEHIND_M), (-1, BEYOND_M)):
        heading = states[at[k], HEADING]
        if len(points) > 1:
            step = points[1] - points[0] if k == 0 else points[-1] - points[-2]
            heading = math.atan2(step[1], step[0])
        ends.append(points[k] + away_m * np.array([math.cos(heading), math.sin(heading)]))
    line = np.vstack([ends[0], points, ends[1]])
    steps = np.diff(line, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    directions = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    heading_at_points = np.concatenate([directions[:1], (directions[:-1] + directions[1:]) / 2, directions[-1:]])
    own = np.searchsorted(at, np.arange(len(states)), side="right")  # the segment that begins at the last point passed
    own = np.clip(own, 1, len(line) - 2)
    share = ((states[:, [X, Y]] - line[own]) * steps[own]).sum(axis=1) / np.maximum(lengths[own] ** 2, 1e-12)
    return DrivenWay(np.ascontiguousarray(line), along, heading_at_points, along[own] + share * lengths[own])


def spaced(xy: FloatArray) -> IntArray:
    """Return the indices of points [N, 2] that are at least `WAY_STEP_M` from the one before, and the first."""
    places: Sequence[tuple[float, float]] = [(float(x), float(y)) for x, y in xy]
    chosen, (x, y) = [0], places[0]
    for k, (px, py) in enumerate(places):
        if (px - x) * (px - x) + (py - y) * (py - y) >= WAY_STEP_M * WAY_STEP_M:
            chosen.append(k)
            x, y = px, py
    return np.array(chosen, dtype=np.int64)
