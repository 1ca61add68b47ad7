"""The model of a recording: what every reader returns, and all that mining and the writing of test cases know of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.model_classes import CLASSES

FloatArray = NDArray[np.float64]
STATES = ("x", "y", "heading", "speed")
"""Columns of `Track.states`: m, m, rad (counter-clockwise from east), m/s."""
KINDS: tuple[str, ...] = CLASSES
"""The classes of recorded actors, those of models."""


class RecordingError(ForeseeError):
    """Raised if a recording cannot be read; the message names the file, the place in it, and what to write instead."""


@dataclass(frozen=True)
class Track:
    """One recorded actor.

    Attributes:
        id: its id in the file.
        kind: one of `KINDS`.
        length_m, width_m: size of its footprint, m; `sized` is False if the file has none and a usual size of the class
            stands for it.
        time_s: [N] float64, s, rising; in the recording's time.
        states: [N, 4] float64, columns `STATES`; x, y is the centre of the footprint.
    """

    id: str
    kind: str
    length_m: float
    width_m: float
    time_s: FloatArray
    states: FloatArray
    sized: bool = True

    def at(self, time_s: float) -> FloatArray | None:
        """Return the state at a time, interpolated between samples ([4], `STATES`); None outside the track's times."""
        times = self.time_s
        if not times[0] - _ROUNDING_S <= time_s <= times[-1] + _ROUNDING_S:
            return None
        return np.array([np.interp(time_s, times, column) for column in self._unwrapped.T])

    @cached_property
    def _unwrapped(self) -> FloatArray:
        """The states with headings that do not jump by a full turn."""
        states = self.states.copy()
        states[:, 2] = np.unwrap(states[:, 2])
        return states


_ROUNDING_S = 1e-6
"""Times that differ by less are equal, s. Ours: data sets write milliseconds or nanoseconds."""


@dataclass(frozen=True)
class SignalTrack:
    """The recorded colours of one signal: `colours[k]` (`red`, `amber`, `green`, `off`) from `time_s[k]` on.

    `place` is the position of its stop line, m, if known.
    """

    id: str
    time_s: tuple[float, ...]
    colours: tuple[str, ...]
    place: tuple[float, float] | None = None


@dataclass(frozen=True)
class RecordedMap:
    """The roads of a recording: a file that a scenario can use as its network.

    Attributes:
        text: the file's content. suffix: `.net.xml`, `.xodr` or `.foresee`.
        offset: x and y to add to the recording's positions to get the network's, m.
        notes: what was guessed or left out, a sentence each.
    """

    text: str
    suffix: str
    offset: tuple[float, float] = (0.0, 0.0)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Recording:
    """Recorded traffic.

    Attributes:
        name: a name for files, from the source's name, in snake_case.
        source: the file that was read. sha256: the hash of its bytes, hexadecimal.
        format: the reader's name.
        tracks: the actors, in the file's order.
        signals: recorded signals.
        roads: its map; None if the format or the user gives none.
        left_out: counts of what the file has and the recording has not, by description.
        notes: what was guessed, a sentence each.
    """

    name: str
    source: Path
    sha256: str
    format: str
    tracks: tuple[Track, ...]
    signals: tuple[SignalTrack, ...] = ()
    roads: RecordedMap | None = None
    left_out: Mapping[str, int] = field(default_factory=Counter)
    notes: tuple[str, ...] = ()

    @property
    def begins_s(self) -> float:
        """The time of the first sample, s."""
        return min(float(track.time_s[0]) for track in self.tracks)

    @property
    def ends_s(self) -> float:
        """The time of the last sample, s."""
        return max(float(track.time_s[-1]) for track in self.tracks)

    def track(self, id_: str) -> Track:
        """Return the track of an id; raises `RecordingError` without such a track."""
        for track in self.tracks:
            if track.id == id_:
                return track
        raise RecordingError(f"{self.source.name} has no actor {id_!r}")
