"""Samples of recorded actors while a file is read, and the tracks that they become.

A file may be of any size and have any mistakes: samples outside the request are skipped at once, only numbers are kept,
and what is left out or derived is counted.
"""

from __future__ import annotations

import math
from array import array
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.limits import most, raised_by
from foresee_dsl.report.safe_text import counted
from foresee_recordings.maps.roads_file import roads_of_file
from foresee_recordings.readers.classes import Shape, have
from foresee_recordings.reading import Request
from foresee_recordings.recording import FloatArray, RecordedMap, Recording, RecordingError, SignalTrack, Track
from foresee_recordings.sources import digest, name_of

_ACTOR_SAMPLES = 10
"""Number of samples whose memory a further actor takes, for the limit `recording`. Ours: some 300 bytes for its id and
its buffer, 40 for a sample."""
GAP_S = 1.0
"""An actor that is absent for longer becomes a second track, s. Ours: interpolating over more would invent its motion;
data sets fill shorter gaps."""
_GAP_STEPS = 2.5
"""Number of usual (median) steps of an actor that a gap has at least: recordings of SUMO have a step of 1 s. Ours."""
FASTEST_MPS = 100.0
"""Two samples that are farther apart than this speed allows are a jump, m/s. Ours: 360 km/h."""
JUMP_M = 5.0
"""Shorter displacements are never jumps, m. Ours: at 25 Hz a noise of 4 m would already be 100 m/s."""
_JUMPING_SHARE, _JUMPS = 0.2, 5
"""Share of steps that are jumps from which on the unit of the positions or times must be wrong, and the number of jumps
that this needs. Ours."""
_MOVING_MPS, _STEP_M = 1.0, 0.05
"""Speed from which on the unit of speeds is checked, m/s, and the displacement that shows a direction of motion, m.
Ours: more than the noise of recorded positions (data sets state some centimetres)."""
_UNIT_FACTOR, _DOUBTFUL_FACTOR = 5.0, 1.5
"""Ratio of speeds in the file and speeds of the positions that is an error of a unit, and the one that is noted. Ours:
km/h differ by 3.6 and are noted, milliseconds, degrees and pixels differ by more."""
_CHECKED_STEPS = 50
"""Number of moving steps that the check of units needs. Ours."""
_WINDOW_S, _CHECKED_WINDOWS = 1.0, 3
"""Length of the windows in which an actor's motion is compared with its recorded speeds, s, and the number of them in
which it must move. Ours: in 1 s a noise of 7 cm is 0.07 m/s, far below `_MOVING_MPS`; from step to step at 25 Hz it
would be 2 m/s."""
_TURNED_RAD = math.radians(30)
"""Median angle between an actor's recorded headings and the direction of its motion from which on they disagree, rad.
Ours: a noise of 5 cm is 4 degrees over 1 m, and a reference point at the bumper deviates by 30 degrees only in tight
turns; headings in degrees, against the sense or from north differ by more for most directions.
"""
_WALKING = ("pedestrian", "obstacle")
"""Kinds whose headings are not checked: they need not face where they move."""
_NAMED = 5
"""Number of actors that a note names. Ours."""
_LARGEST_M, _LATEST_S = 1e8, 1e11
"""Places and times beyond these are damaged, m and s. Ours: UTM's northings reach 1e7 m, and 1e11 s are 3,000 years."""
_SAME_M = 0.01
"""Two samples at one time that are nearer than this are the same, m. Ours: the last digit of most files."""
_ROUNDING_S = 1e-6
"""Times that differ by less are equal, s. Ours: data sets write milliseconds or nanoseconds."""


class Samples:
    """The samples of a recording that are within the request.

    Attributes:
        left_out: counts of what the file has and the recording has not, by description.
        notes: what was guessed, a sentence each, without repetition.
        heading_unit: the unit of the headings that were added, rad; a reader that sees it only at the end sets it then.
    """

    def __init__(self, request: Request) -> None:
        self._request = request
        self._begins_s, self._ends_s = request.begins_s - _ROUNDING_S, request.ends_s + _ROUNDING_S
        self._actors = request.actors
        self._buffers: dict[str, array[float]] = {}
        self._limit = round(most("recording"))
        self._room = self._limit
        self._first_s, self._last_s = math.inf, -math.inf
        self._steps, self._jumps = 0, 0
        self._derived: Counter[str] = Counter()
        self._splits: Counter[tuple[str, str]] = Counter()
        self.left_out: Counter[str] = Counter()
        self.notes: dict[str, None] = {}
        self.heading_unit = 1.0

    def wants(self, actor: str, time_s: float) -> bool:
        """Return whether a sample is within the request."""
        if not self._first_s <= time_s <= self._last_s:
            self._first_s, self._last_s = min(self._first_s, time_s), max(self._last_s, time_s)
        if self._begins_s <= time_s <= self._ends_s:
            return not self._actors or actor in self._actors
        if math.isnan(time_s):
            self.left_out["samples with a number that is not finite"] += 1
        return False

    def covers(self, time_s: float) -> bool:
        """Return whether a time is within the request."""
        return self._begins_s <= time_s <= self._ends_s

    def is_over(self, time_s: float) -> bool:
        """Return whether a time is after the request's end, so that a file in the order of time is read no further."""
        return time_s > self._ends_s

    def add(
        self, actor: str, time_s: float, x: float, y: float, heading: float = math.nan, speed: float = math.nan
    ) -> bool:
        """Keep a sample (s, m, rad counter-clockwise from east, m/s); a heading or speed of NaN is derived later.

        Returns:
            Whether it was kept: its time and place are finite numbers.

        Raises:
            RecordingError: there are more samples than the limit `recording` allows.
        """
        if not (-_LARGEST_M < x < _LARGEST_M and -_LARGEST_M < y < _LARGEST_M and -_LATEST_S < time_s < _LATEST_S):
            finite = math.isfinite(x) and math.isfinite(y) and math.isfinite(time_s)
            what = "a place or time that is far too large" if finite else "a number that is not finite"
            self.left_out[f"samples with {what}"] += 1
            return False
        buffer = self._buffers.get(actor)
        if buffer is None:
            buffer = self._buffers[actor] = array("d")
            self.take_room()
        self.take_room(1)
        buffer.extend((time_s, x, y, heading, speed))
        return True

    def take_room(self, samples: int = _ACTOR_SAMPLES) -> None:
        """Count the memory of something that is kept, such as the class of a further actor, as that of samples.

        Raises:
            RecordingError: it is more than the limit `recording` allows.
        """
        self._room -= samples
        if self._room < 0:
            raise RecordingError(
                f"{self._request.path}: it has more than {self._limit:,} samples to keep (an actor counts as "
                f"{_ACTOR_SAMPLES}): read a part of it with --from and --to, or {raised_by('recording')}"
            )

    def check_actors(self, listed: Collection[str], what: str) -> None:
        """Count the actors that have samples and are not among those that are listed in `what`."""
        if count := sum(actor not in listed for actor in self._buffers):
            self.left_out[f"actors that are not in {what}"] += count

    def note(self, sentence: str) -> None:
        """Add a sentence to the notes, once."""
        self.notes[sentence] = None

    def recording(
        self,
        format_: str,
        shapes: Mapping[str, Shape],
        *,
        offset_m: Callable[[str, Shape], tuple[float, float]] | None = None,
        source: Path | None = None,
        signals: tuple[SignalTrack, ...] = (),
        roads: RecordedMap | None = None,
        origin_m: tuple[float, float] = (0.0, 0.0),
    ) -> Recording:
        """Return the recording, and release the samples.

        Args:
            shapes: the class and size of each actor; others are left out (the caller counts them).
            offset_m: the footprint's centre seen from a sample's position, ahead and left, m; None: the same place.
            source: the file that was read, if the request names a folder.
            roads: the map in or beside the file; a map of the request is used instead.
            origin_m: the origin of the positions in UTM, m, if the file has it.

        Raises:
            RecordingError: no sample is left, or the positions, times or speeds are in another unit.
        """
        path = source or self._request.path
        tracks: list[Track] = []
        motions = {actor: list(self._motions(actor)) for actor in list(self._buffers)}
        windows = {actor: _windows(parts, self.heading_unit) for actor, parts in motions.items()}
        self._check_units(path, motions, windows)
        self._check_headings(
            path,
            {
                actor: windows[actor]
                for actor, shape in shapes.items()
                if actor in windows and shape.kind not in _WALKING
            },
        )
        names = set(motions)
        for actor, parts in motions.items():
            form = shapes.get(actor)
            if form is None or not parts:
                continue
            offset = (0.0, 0.0) if offset_m is None else offset_m(actor, form)
            for name, motion in zip(_part_names(actor, len(parts), names), parts, strict=True):
                tracks.append(self._track(name, form, motion, offset))
        if not tracks:
            raise RecordingError(f"{path}: {self._nothing()}")
        for (noun, size), count in self._splits.items():
            if count:
                self.note(f"{counted(count, noun)} {size}: after it, an actor goes on as another.")
        for what, count in self._derived.items():
            self.note(f"{have(count)} {what}.")
        if self._request.map_file is not None:
            roads = roads_of_file(self._request.map_file, origin_m=origin_m)
        return Recording(
            name_of(path), path, digest(path), format_, tuple(tracks), signals, roads, +self.left_out, tuple(self.notes)
        )

    def _nothing(self) -> str:
        """Return why no track is left."""
        if self._last_s < self._first_s:
            return "it has no samples"
        actors = f" of {', '.join(sorted(self._actors)[:5])}" if self._actors else ""
        first_s, last_s = max(self._request.begins_s, self._first_s), min(self._request.ends_s, self._last_s)
        times = f"its samples are from {self._first_s:g} s to {self._last_s:g} s"
        if first_s > last_s:
            return f"it has no samples in the seconds that are requested; {times}"
        return f"no actor{actors} has two usable samples from {first_s:g} s to {last_s:g} s; {times}"

    def _motions(self, actor: str) -> Iterator[FloatArray]:
        """Yield the parts of an actor's motion without gaps and jumps, each [N, 5]: time, x, y, heading, speed."""
        rows = np.frombuffer(self._buffers.pop(actor), dtype=np.float64).reshape(-1, 5)
        rows = self._without_outliers(self._without_repetitions(self._in_order(rows)))
        steps = np.diff(rows[:, 0])
        longest_s = max(GAP_S, _GAP_STEPS * float(np.median(steps))) + _ROUNDING_S if len(steps) else GAP_S
        gaps, jumps = steps > longest_s, _jumps(rows)
        self._steps += len(steps)
        self._jumps += int(jumps.sum())
        self._splits["gap", f"of more than {GAP_S:g} s and {_GAP_STEPS:g} usual steps"] += int((gaps & ~jumps).sum())
        self._splits["jump", f"of more than {JUMP_M:g} m and {FASTEST_MPS:g} m/s"] += int(jumps.sum())
        for part in np.split(rows, np.flatnonzero(gaps | jumps) + 1):
            if len(part) > 1:
                yield part
            else:
                self.left_out["single samples without others of their actor beside them"] += len(part)

    def _in_order(self, rows: FloatArray) -> FloatArray:
        backwards = int((np.diff(rows[:, 0]) < 0).sum())
        if not backwards:
            return rows
        self.note("Samples of an actor are not in the order of their times, and were sorted.")
        return rows[np.argsort(rows[:, 0], kind="stable")]

    def _without_repetitions(self, rows: FloatArray) -> FloatArray:
        again = np.concatenate(([False], np.diff(rows[:, 0]) < _ROUNDING_S))
        if not again.any():
            return rows
        first = rows[np.maximum.accumulate(np.where(again, 0, np.arange(len(rows))))]
        apart = np.hypot(*(rows[again, 1:3] - first[again, 1:3]).T) > _SAME_M
        self.left_out["samples at the time of an earlier one of their actor, at another place"] += int(apart.sum())
        self.left_out["samples that repeat an earlier one of their actor"] += int((~apart).sum())
        return rows[~again]

    def _without_outliers(self, rows: FloatArray) -> FloatArray:
        """Return the rows without single samples that jump away from their neighbours and back."""
        jumps = _jumps(rows)
        if jumps.sum() < 2:
            return rows
        away = np.flatnonzero(jumps[:-1] & jumps[1:]) + 1
        outliers = [k for k in away.tolist() if not _jumps(rows[[k - 1, k + 1]]).any()]
        self.left_out["samples far away from those before and after them"] += len(outliers)
        return np.delete(rows, outliers, axis=0)

    def speed_ratio(self) -> float | None:
        """Return the median of the speeds of the positions in relation to the speeds that were added; None if too few
        actors move."""
        rows = (np.frombuffer(buffer, dtype=np.float64).reshape(-1, 5) for buffer in self._buffers.values())
        return _speed_ratio(list(rows))

    def move(self, change: Callable[[FloatArray], FloatArray]) -> None:
        """Replace all places by others: `change` gets an actor's, [N, 2] m or degrees, and returns them in m."""
        for actor in self._buffers:
            rows = np.frombuffer(self._buffers[actor], dtype=np.float64).reshape(-1, 5).copy()
            rows[:, 1:3] = change(rows[:, 1:3])
            self._buffers[actor] = array("d", rows.ravel().tobytes())

    def first_place(self) -> FloatArray:
        """Return the place of the first sample, [2]; NaN without samples."""
        buffer = next(iter(self._buffers.values()), None)
        return np.full(2, math.nan) if buffer is None else np.array(buffer[1:3])

    def _check_units(
        self, path: Path, motions: Mapping[str, list[FloatArray]], windows: Mapping[str, FloatArray]
    ) -> None:
        """Raise if the positions cannot be in metres, the times in seconds or the speeds in m/s; note speeds that
        differ."""
        if self._jumps >= max(_JUMPING_SHARE * self._steps, _JUMPS):
            raise RecordingError(
                f"{path}: {self._jumps:,} of {self._steps:,} steps between samples are faster than {FASTEST_MPS:g} "
                "m/s, so the positions are not in metres, or the times not in seconds (pixels, milliseconds)"
            )
        ratio = _speed_ratio([motion for parts in motions.values() for motion in parts])
        if ratio is not None and not 1 / _UNIT_FACTOR < ratio < _UNIT_FACTOR:
            raise RecordingError(
                f"{path}: the positions move with {ratio:.2g} times the recorded speeds, so they are not in metres, or "
                "the times not in seconds (geographic coordinates, pixels, milliseconds)"
            )
        ratios = {actor: own for actor, rows in windows.items() if (own := _signed_ratio(rows)) is not None}
        if opposed := [actor for actor, own in ratios.items() if own < 0 or own > _UNIT_FACTOR]:
            moved, recorded = np.nanmedian(windows[opposed[0]][:, :2], axis=0)
            which = f"the positions of {_some(opposed)} move, but their recorded speeds are negative or near 0"
            example = f"{opposed[0]}: {moved:.1f} m/s by its positions, {recorded:.1f} m/s recorded"
            if len(opposed) > len(ratios) / 2:
                raise RecordingError(
                    f"{path}: {which} ({example}); correct the speeds, or leave them out: then those of the "
                    "positions are used"
                )
            self.note(f"{which[0].upper()}{which[1:]} ({example}).")
        doubtful = [actor for actor, own in ratios.items() if 0 < own <= _UNIT_FACTOR and _is_doubtful(own)]
        if doubtful and len(doubtful) <= len(ratios) / 2:
            own = float(np.median([ratios[actor] for actor in doubtful]))
            self.note(
                f"The positions of {_some(doubtful)} move with {own:.2f} times their recorded speeds, which may be in "
                "another unit."
            )
        elif ratio is not None and _is_doubtful(ratio):
            self.note(f"The positions move with {ratio:.2f} times the recorded speeds, which may be in another unit.")

    def _check_headings(self, path: Path, windows: Mapping[str, FloatArray]) -> None:
        """Raise if most moving vehicles have headings that are not the directions of their motion; note single ones.

        A vehicle may reverse, so a single one is not an error.
        """
        angles = {actor: angle for actor, rows in windows.items() if (angle := _turned_rad(rows)) is not None}
        turned = [actor for actor, angle in angles.items() if angle > _TURNED_RAD]
        if not turned:
            return
        degrees = math.degrees(float(np.median([angles[actor] for actor in turned])))
        which = f"the headings of {_some(turned)} differ by {degrees:.0f} degrees from the directions of their motion"
        if len(turned) > max(len(angles) / 2, 1):
            raise RecordingError(
                f"{path}: {which}, so they are in another unit, or not counter-clockwise from east (a table's columns "
                "are heading_rad or heading_deg); correct the headings, or leave them out: then those of the motion "
                "are used"
            )
        self.note(f"{which[0].upper()}{which[1:]}: reversing, or wrong headings.")

    def _track(self, name: str, form: Shape, rows: FloatArray, offset: tuple[float, float]) -> Track:
        """Return the track of a motion, with the headings and speeds that the file has not."""
        states = rows[:, 1:].copy()
        states[:, 2] *= self.heading_unit
        absent = ~np.isfinite(states)
        too_fast = np.abs(states[:, 3]) > FASTEST_MPS
        if too_fast.any():
            self.left_out[f"speeds above {FASTEST_MPS:g} m/s, replaced by those of the positions"] += int(
                too_fast.sum()
            )
            absent[too_fast, 3] = True
        if absent[:, 2].any():
            self._derived[f"no headings{_where(absent[:, 2])}: those of their motion are used"] += 1
            states[absent[:, 2], 2] = _directions(rows)[absent[:, 2]]
        if absent[:, 3].any():
            if (missing := absent[:, 3] & ~too_fast).any():
                self._derived[f"no speeds{_where(missing)}: those of their positions are used"] += 1
            velocity = np.gradient(rows[:, 1:3], rows[:, 0], axis=0)
            states[absent[:, 3], 3] = np.hypot(*velocity.T)[absent[:, 3]]
        states[:, 2] = np.remainder(states[:, 2] + np.pi, 2 * np.pi) - np.pi
        (ahead, left), c, s = offset, np.cos(states[:, 2]), np.sin(states[:, 2])
        states[:, 0] += ahead * c - left * s
        states[:, 1] += ahead * s + left * c
        return Track(name, form.kind, form.length_m, form.width_m, rows[:, 0].copy(), states, form.sized)


def _speed_ratio(motions: list[FloatArray]) -> float | None:
    """Return the median speed of the positions in relation to the recorded speeds; None for too few steps.

    Steps and not windows of a second as in `_signed_ratio`: with times in minutes, or in an excerpt of a second, no
    actor has a window.
    """
    ratios: list[FloatArray] = []
    for rows in motions:
        steps = np.diff(rows[:, :3], axis=0)
        speeds = (rows[1:, 4] + rows[:-1, 4]) / 2
        moving = np.isfinite(speeds) & (np.abs(speeds) > _MOVING_MPS) & (steps[:, 0] > 0)
        ratios.append(np.hypot(steps[moving, 1], steps[moving, 2]) / steps[moving, 0] / np.abs(speeds[moving]))
    checked = np.concatenate(ratios) if ratios else np.empty(0)
    return float(np.median(checked)) if len(checked) >= _CHECKED_STEPS else None


def _where(absent: NDArray[np.bool_]) -> str:
    return "" if absent.all() else " in some samples"


def _is_doubtful(ratio: float) -> bool:
    return not 1 / _DOUBTFUL_FACTOR < ratio < _DOUBTFUL_FACTOR


def _windows(parts: list[FloatArray], heading_unit: float) -> FloatArray:
    """Return the motion of an actor in windows of a second in which it moves or has a speed, [N, 4]: speed of its
    positions and mean recorded speed (m/s), direction of motion and recorded heading (rad; NaN without)."""
    windows = [np.empty((0, 4))]
    for rows in parts:
        window = np.floor((rows[:, 0] - rows[0, 0] + _ROUNDING_S) / _WINDOW_S)
        ends = np.flatnonzero(np.diff(window, prepend=-1))  # the first sample of each
        if len(ends) < 2:
            continue
        heading, speed = np.where(np.isfinite(rows[:, 3:]), rows[:, 3:], math.nan).T
        lasts_s, *way = np.diff(rows[ends, :3], axis=0).T
        steps_m = np.diff(rows[:, 0]) * (speed[1:] + speed[:-1]) / 2
        recorded = np.add.reduceat(steps_m[: ends[-1]], ends[:-1]) / lasts_s
        moved = np.hypot(*way) / lasts_s
        headings = heading[(ends[:-1] + ends[1:]) // 2] * heading_unit
        moving = (moved > _MOVING_MPS) | (np.abs(recorded) > _MOVING_MPS)
        windows.append(np.column_stack((moved, recorded, np.arctan2(way[1], way[0]), headings))[moving])
    return np.concatenate(windows)


def _signed_ratio(windows: FloatArray) -> float | None:
    """Return the median speed of an actor's positions in relation to its recorded speed: infinite if that is 0,
    negative if it is below 0 although the actor moves ahead; None for too few windows."""
    finite = windows[np.isfinite(windows[:, 1])]
    if len(finite) < _CHECKED_WINDOWS:
        return None
    moved, recorded, direction, heading = finite.T
    backwards = np.cos(heading - direction) < 0  # False without a heading: then it is that of the motion
    speeds = np.where(backwards, np.abs(recorded), recorded)
    ratios = np.divide(moved, speeds, out=np.full(len(finite), math.inf), where=speeds != 0)
    return float(np.median(ratios))


def _turned_rad(windows: FloatArray) -> float | None:
    """Return the median angle between an actor's headings and the directions of its motion, rad, from 0 to pi; None for
    too few windows. With a negative speed, it should move against its heading."""
    moved, recorded, direction, heading = windows[(windows[:, 0] > _MOVING_MPS) & np.isfinite(windows[:, 3])].T
    if len(moved) < _CHECKED_WINDOWS:
        return None
    ahead = heading + np.where(recorded < 0, math.pi, 0.0)
    return float(np.median(np.abs(np.remainder(ahead - direction + math.pi, 2 * math.pi) - math.pi)))


def _some(actors: list[str]) -> str:
    """Return the names of actors for a note, the first ones of many."""
    more = len(actors) - _NAMED
    return ", ".join(actors[:_NAMED]) + (f" and {more} more" if more > 0 else "")


def _directions(rows: FloatArray) -> FloatArray:
    """Return the direction of motion at each sample, rad ([N]); where an actor stands, that of its nearest motion
    before, otherwise after; 0 if it never moves."""
    places = np.concatenate((rows[:1, 1:3], rows[:, 1:3], rows[-1:, 1:3]))
    way = places[2:] - places[:-2]
    moving = np.hypot(way[:, 0], way[:, 1]) > _STEP_M
    if not moving.any():
        whole = rows[-1, 1:3] - rows[0, 1:3]
        return np.full(len(rows), math.atan2(whole[1], whole[0]) if np.hypot(*whole) > _STEP_M else 0.0)
    index = np.maximum.accumulate(np.where(moving, np.arange(len(rows)), -1))
    index[index < 0] = np.argmax(moving)
    directions: FloatArray = np.arctan2(way[index, 1], way[index, 0])
    return directions


def _part_names(actor: str, count: int, names: Collection[str]) -> list[str]:
    """Return the ids of an actor's tracks: its own, and `ID_part2`, ... for those after gaps."""
    parts = [actor]
    number = 2
    while len(parts) < count:
        if (name := f"{actor}_part{number}") not in names:
            parts.append(name)
        number += 1
    return parts


def _jumps(rows: FloatArray) -> NDArray[np.bool_]:
    """Return which steps no vehicle can take ([N - 1] bool)."""
    steps = np.diff(rows[:, :3], axis=0)
    ways = np.hypot(steps[:, 1], steps[:, 2])
    jumps: NDArray[np.bool_] = (ways > FASTEST_MPS * steps[:, 0]) & (ways > JUMP_M)
    return jumps
