"""Reads the recorded tracks of actors from the file that `use tracks` names, and interpolates them."""

from __future__ import annotations

import math
from array import array
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from functools import cached_property, lru_cache
from pathlib import Path
from typing import NamedTuple

from foresee_dsl.compile.roads.polyline import XY, Points, distance, wrap
from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import open_outside
from foresee_dsl.language.units import ROUNDING_S

FIRST_LINE = "# foresee tracks 1"
COLUMNS = ("time_s", "actor", "x_m", "y_m", "heading_deg", "speed_mps")
_LONGEST_LINE = 1000
"""Largest length of a line, in bytes. Ours: six columns take 60, and a comment may name a long file."""
_LARGEST = {"time_s": 86_400.0, "x_m": 1e7, "y_m": 1e7, "heading_deg": 1e5, "speed_mps": 150.0}
"""Largest size of a number of each column. Ours: a day; the earth's quarter, the extent of UTM's coordinates; headings
that were summed up over many turns; more than the speed of any vehicle on a road."""
WAY_EVERY_M = 1.0
"""Distance between the points of the line along a track, m. Ours: on a bend with a radius of 10 m the line is 1 cm off.
"""
_SHORTEST_WAY_M = 0.1
"""The line along the track of an actor that never moves is this long, m. Ours: it only gives the actor a direction."""


class TracksError(ForeseeError):
    """Raised for a file that is not a file of tracks; the message names the line."""


class TrackState(NamedTuple):
    """A recorded state: middle of the footprint, m; heading, rad (-pi..pi); speed, m/s; length along the track, m."""

    x: float
    y: float
    heading_rad: float
    speed_mps: float
    along_m: float


class FileTrack:
    """The recorded track of an actor.

    Args:
        name: its name in the file.

    Attributes:
        time_s: times of the samples, s, rising. x, y: middle of the footprint, m. heading_rad: heading, continuous (it
            may leave -pi..pi). speed_mps: m/s. All have one value per sample.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.time_s, self.x, self.y = array("d"), array("d"), array("d")
        self.heading_rad, self.speed_mps = array("d"), array("d")

    def add(self, time_s: float, x: float, y: float, heading_rad: float, speed_mps: float) -> None:
        """Append a sample; between two samples the actor turns the shorter way."""
        before = self.heading_rad[-1] if self.heading_rad else 0.0
        self.time_s.append(time_s)
        self.x.append(x)
        self.y.append(y)
        self.heading_rad.append(before + math.remainder(heading_rad - before, math.tau))
        self.speed_mps.append(speed_mps)

    @property
    def begin_s(self) -> float:
        """Time of the first sample, s."""
        return self.time_s[0]

    @property
    def end_s(self) -> float:
        """Time of the last sample, s."""
        return self.time_s[-1]

    def covers(self, time_s: float) -> bool:
        """Return whether a time lies between the first and the last sample."""
        return self.begin_s - ROUNDING_S <= time_s <= self.end_s + ROUNDING_S

    def at(self, time_s: float) -> TrackState:
        """Return the state at a time, linear between samples; before the first and after the last sample, that
        sample's."""
        times = self.time_s
        k = min(max(bisect_right(times, time_s) - 1, 0), max(len(times) - 2, 0))
        after = min(k + 1, len(times) - 1)
        span = times[after] - times[k]
        share = min(max((time_s - times[k]) / span, 0.0), 1.0) if span > 0 else 0.0
        columns = (self.x, self.y, self.heading_rad, self.speed_mps, self._marks)
        x, y, heading, speed, along = (values[k] + share * (values[after] - values[k]) for values in columns)
        return TrackState(x, y, wrap(heading), speed, along)

    @property
    def way(self) -> Points:
        """The line along the track, whose points are samples at least `WAY_EVERY_M` apart, and the last one."""
        return self._way[0]

    @property
    def _marks(self) -> array[float]:
        """The length along the line at each sample, m."""
        return self._way[1]

    @cached_property
    def _way(self) -> tuple[Points, array[float]]:
        points: list[XY] = [(self.x[0], self.y[0])]
        marks, passed_m = array("d"), 0.0
        for x, y in zip(self.x, self.y, strict=True):
            ahead_m = distance(points[-1], (x, y))
            if ahead_m >= WAY_EVERY_M:
                points.append((x, y))
                passed_m, ahead_m = passed_m + ahead_m, 0.0
            marks.append(passed_m + ahead_m)
        last = self.x[-1], self.y[-1]
        if distance(points[-1], last) >= _SHORTEST_WAY_M:
            points.append(last)
        if len(points) == 1:
            heading = self.heading_rad[0]
            x, y = points[0]
            points.append((x + _SHORTEST_WAY_M * math.cos(heading), y + _SHORTEST_WAY_M * math.sin(heading)))
        return tuple(points), marks


def read_tracks(file: Path) -> Mapping[str, FileTrack]:
    """Return the tracks of a file, by name; a file that has not changed is read once.

    Raises:
        TracksError: it cannot be read, or a line is wrong.
    """
    try:
        status = file.stat()
        return _tracks_of(file, status.st_mtime_ns, status.st_size)
    except OSError as err:
        raise TracksError(f"{file.name} cannot be read: {err.strerror}") from err


@lru_cache(maxsize=4)
def _tracks_of(file: Path, modified_ns: int, size: int) -> Mapping[str, FileTrack]:
    del modified_ns, size  # they are parts of the cache's key
    tracks: dict[str, FileTrack] = {}
    lines = _lines_of(file)
    _check_head(lines, file)
    now_s = -math.inf
    for number, line in lines:
        cells = line.split(",")
        if len(cells) != len(COLUMNS):
            raise _wrong(file, number, f"it has {len(cells)} values, not {len(COLUMNS)}")
        values = [_number(file, number, COLUMNS[k], cells[k]) for k in (0, 2, 3, 4, 5)]
        time_s, name = values[0], cells[1]
        if not name or '"' in name or not name.isprintable():
            raise _wrong(file, number, "the actor's name is empty, or has quotes or invisible characters")
        if not 0 <= time_s >= now_s:
            reason = "is below 0" if time_s < 0 else f"is earlier than that of the line before, {now_s:g}"
            raise _wrong(file, number, f"time_s {time_s:g} {reason}")
        now_s = time_s
        track = tracks.setdefault(name, FileTrack(name))
        if track.time_s and time_s <= track.end_s:
            raise _wrong(file, number, f"actor {_short(name)} has a second line for time_s {time_s:g}")
        track.add(time_s, values[1], values[2], math.radians(values[3]), values[4])
    return tracks


def _lines_of(file: Path) -> Iterator[tuple[int, str]]:
    """Yield the lines of a file with their numbers, without line ends; only one line is in memory at a time."""
    with open_outside(file) as opened:
        number = 0
        while line := opened.readline(_LONGEST_LINE + 1):
            number += 1
            if len(line) > _LONGEST_LINE:
                raise _wrong(file, number, f"it is longer than {_LONGEST_LINE} bytes")
            try:
                yield number, line.decode("utf-8").rstrip("\r\n")
            except UnicodeDecodeError:
                raise _wrong(file, number, "it is not UTF-8") from None


def _check_head(lines: Iterator[tuple[int, str]], file: Path) -> None:
    """Read the lines up to the one with the columns' names."""
    number, line = next(lines, (1, ""))
    if line != FIRST_LINE:
        raise _wrong(file, number, f"it is not `{FIRST_LINE}`")
    for number, line in lines:  # noqa: B007 - the number of the last line is used
        if not line.startswith("#"):
            break
    if line != ",".join(COLUMNS):
        missing = [name for name in COLUMNS if name not in line.split(",")]
        what = f"without {', '.join(missing)}" if missing else "in another order, or with more columns"
        raise _wrong(file, number, f"the columns are not {','.join(COLUMNS)}: it is {what}")


def _number(file: Path, line: int, column: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise _wrong(file, line, f"{column} is {_short(text)}, not a number") from None
    if not abs(value) <= _LARGEST[column]:  # true for NaN, too
        most = _LARGEST[column]
        raise _wrong(file, line, f"{column} is {_short(text)}, not a number from {-most:g} to {most:g}")
    return value


def _wrong(file: Path, line: int, what: str) -> TracksError:
    return TracksError(f"line {line} of {file.name}: {what}")


def _short(text: str) -> str:
    return repr(text if len(text) <= 30 else f"{text[:30]}...")
