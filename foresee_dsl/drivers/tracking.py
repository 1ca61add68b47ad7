"""The memory of drivers: smooth tracks of the others from noisy and late object lists, and the colours of signals.

Each object has a filter with the gains of a Kalman filter for heading and yaw rate, for speed and acceleration, and for
the position, which the first four advance. The gains come from tables, by the number of measurements of the object: no
covariance is stored. All objects are advanced together, in arrays. Tracks depend only on the observations since
`reset`.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from functools import cache, lru_cache
from itertools import chain
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers.protocol import ActorClass, FloatArray, Observation, SeenActor, SignalColour
from foresee_dsl.kernels import tracks as kernel
from foresee_dsl.kernels.arrays import IntArray, Records

COAST_S = 1.5
"""Time for which an object that is no longer seen is predicted, s. Ours: within 1 s the sensors give it its old number
again; later a new number may be the same object."""
STANDING_COAST_S = 4.0
"""Time for which an object that stood when it was last seen is kept, s, such as a parked car behind a passing lorry.
Ours."""
JERK_MPS3 = 4.0
"""Standard deviation of the rate of change of accelerations, m/s^3. Ours: of the values 2, 3, 4 and 8, it has the least
error over driving at constant speed, setting off, and braking with 6 m/s^2.
"""
START_ACCELERATION_MPS2 = 1.0
"""Standard deviation of an object's acceleration at its first measurement, m/s^2. Ours: that of traffic in town."""
YAW_CHANGE_RAD_S2 = 0.7
"""Rate of change of yaw rates, rad/s^2. Ours: entering a turn with a radius of 7 m at 5 m/s in 1.5 s."""
START_YAW_RAD_S = 0.1
"""Standard deviation of yaw rates at the first measurement, rad/s. Ours: nearly all objects move straight."""
DRIFT_MPS = 0.4
"""Difference between the true velocity of the centre and the filtered speed along the filtered heading, m/s. Ours."""
STANDING_DRIFT_MPS = 0.02
"""As `DRIFT_MPS`, for a standing object, m/s. Ours: it is so small that the positions of parked cars settle."""
STANDING_TURN_RAD_S = 0.03
"""Turning rate of a standing object, rad/s. Ours."""
WALKER_TURN_RAD_S = 0.7
"""Turning rate of pedestrians, rad/s. Ours: a quick turn by more than 60 degrees makes the filter start again."""
SIZE_GAIN = 0.05
"""Smallest gain with which sizes are corrected. Ours: sizes do not change, but the visible part of an object may."""
SAME_OBJECT_M = 1.5
SAME_OBJECT_MPS = 1.5
"""An object with a new number is taken for a lost object if its distance from the predicted place of that object is at
most 1.5 m plus 1.5 m/s times the time since it was lost. Ours: less than the distance between two cars in a queue.
"""
SAME_SIZE = 0.3
"""Two objects with lengths that differ by less than this share may be the same object. Ours: ten times the noise."""
FADES_S = 0.5
"""Time constant with which acceleration and yaw rate of unseen objects decay, s. Ours."""

SAME_FRAME_S = 1e-6
COLOUR_KEPT_S = 1.0
"""Time for which a colour is used after its last sighting, s. Ours: a third of the shortest amber time (3 s), so that
no driver relies on a green light that has become red."""

_PACES = 256
"""Number of times between object lists for which values are kept. Ours: rounding makes some twenty of each."""

_SCAN = struct.Struct("6d")
"""The layout of a `kernel.Scan`: packing one takes a third of the time of an assignment to the record."""
_MEASURED = attrgetter("x", "y", "heading_rad", "speed_mps", "length_m", "width_m")
KINDS = {"bicycle": kernel.BICYCLE, "pedestrian": kernel.PEDESTRIAN, "obstacle": kernel.OBSTACLE}
"""The classes that kernels distinguish; all others are `OTHER`."""


class ObjectTable(NamedTuple):
    """An object list as arrays, in its order.

    Attributes:
        numbers: the objects' track numbers. kinds: their classes.
        measured: [N, >=6] x, y, heading, speed, length, width, m, rad, m/s.
    """

    numbers: Sequence[int]
    kinds: Sequence[ActorClass]
    measured: FloatArray


def object_table(observation: Observation) -> ObjectTable:
    """Return the object list of an observation as arrays; the simulator's observations provide them directly."""
    own: Callable[[], ObjectTable | None] | None = getattr(observation, "object_table", None)
    if own is not None and (table := own()) is not None:
        return table
    seen = observation.actors
    values = np.fromiter(chain.from_iterable(map(_MEASURED, seen)), float, kernel.MEASURED * len(seen))
    numbers, kinds = [actor.track for actor in seen], [actor.kind for actor in seen]
    return ObjectTable(numbers, kinds, values.reshape(-1, kernel.MEASURED))


class Tracks(NamedTuple):
    """The tracked road users at the current time; every array is [A].

    Attributes:
        table: [A] `foresee_dsl.kernels.tracks.TrackedObject`s. numbers: their numbers in the object list. kinds: their
            classes.
        x, y, heading, speed, length, width, acceleration, yaw_rate, lost_s: the columns of `table`.
    """

    table: Records
    numbers: tuple[int, ...]
    kinds: tuple[ActorClass, ...]

    def __getattr__(self, column: str) -> FloatArray:
        """Return a column of the table."""
        try:
            values: FloatArray = self.table[column]
        except ValueError as err:
            raise AttributeError(column) from err
        return values

    def seen(self) -> tuple[SeenActor, ...]:
        """Return the tracks as an observation's actors."""
        columns = (self.x, self.y, self.heading, self.speed, self.length, self.width)
        return tuple(map(SeenActor, self.numbers, self.kinds, *(column.tolist() for column in columns)))


class Tracker:
    """Tracks the objects of an object list from step to step."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._state = np.empty((0, 8))
        self._sightings = np.empty(0, kernel.SIGHTING)
        self._scan = np.empty(1, kernel.SCAN)
        self._scan_memory = self._scan.view(np.float64).data
        self._numbers: list[int] = []
        self._kinds: list[ActorClass] = []
        self._named: tuple[tuple[int, ...], tuple[ActorClass, ...]] = (), ()
        self._places: dict[int, int] = {}
        self._listed: list[int] | None = None
        """Numbers of the last object list, if `_which` has their rows."""
        self._which: IntArray = np.empty(0, np.int64)
        self._measured_s: float | None = None
        self._some_lost = False

    def update(self, observation: Observation) -> Tracks:
        """Process an observation, and return all tracks at its `time_s`.

        An object list with the time of the last one is ignored; an earlier time means a new run, which resets the
        tracker.
        """
        time_s = observation.time_s
        measured_s = time_s if observation.measured_s is None else observation.measured_s
        passed_s = math.inf if self._measured_s is None else measured_s - self._measured_s
        if passed_s < -SAME_FRAME_S:
            self.reset()
            passed_s = math.inf
        if passed_s <= SAME_FRAME_S:
            return self._present(time_s, measured_s)
        self._measured_s = measured_s
        seen, ego = object_table(observation), observation.ego
        if seen.numbers != self._listed:  # usually a list has the same objects as the one before it
            rows = [self._places.get(number, -1) for number in seen.numbers]
            if -1 in rows:
                return self._with_new(rows, seen, observation, passed_s, measured_s)
            self._listed, self._which = list(seen.numbers), np.array(rows, dtype=np.int64)
        which = self._which
        self._some_lost = len(which) < len(self._numbers)
        if not self._numbers:
            return self._present(time_s, measured_s)
        # The usual case, a list without new objects, takes one call of a kernel.
        gains, fades = _pace(passed_s)
        _SCAN.pack_into(self._scan_memory, 0, ego.x, ego.y, measured_s, passed_s, time_s, fades)
        table, lost_s = kernel.follow(self._state, self._sightings, which, seen.measured, self._scan, gains)
        if lost_s <= COAST_S:
            return Tracks(table, *self._named)
        self._drop(measured_s)
        return self._present(time_s, measured_s)

    def _present(self, time_s: float, measured_s: float) -> Tracks:
        table = kernel.present(self._state, self._sightings, time_s, measured_s, self._some_lost)
        return Tracks(table, *self._named)

    def _with_new(
        self, rows: list[int], seen: ObjectTable, observation: Observation, passed_s: float, measured_s: float
    ) -> Tracks:
        """Process an object list with new numbers; `rows`: rows of the tracked objects, -1 for new numbers."""
        had_tracks, ego, time_s = bool(self._numbers), observation.ego, observation.time_s
        self._listed = None
        if had_tracks:
            kernel.move(self._state, passed_s)
        rows = self._begin(seen, rows, measured_s)
        if had_tracks:
            gains, fades = _pace(passed_s)
            _SCAN.pack_into(self._scan_memory, 0, ego.x, ego.y, measured_s, passed_s, time_s, fades)
            which = np.array(rows, dtype=np.int64)
            kernel.correct(self._state, self._sightings, which, seen.measured, self._scan, gains)
        self._some_lost = len(rows) < len(self._numbers)
        if self._some_lost and kernel.fade(self._state, self._sightings, self._scan) > COAST_S:
            self._drop(measured_s)
        return self._present(time_s, measured_s)

    def _begin(self, seen: ObjectTable, rows: list[int], measured_s: float) -> list[int]:
        """Assign a row to each new number: the row of an object that was lost at this place; if there is none, a new
        row.
        """
        taken, fresh = set(rows), []
        for k, number in enumerate(seen.numbers):
            if rows[k] >= 0:
                continue
            place = self._lost_there(seen, k, taken, measured_s)
            if place < 0:
                place = len(self._numbers)
                self._numbers.append(number)
                self._kinds.append(seen.kinds[k])
                fresh.append(k)
            else:
                self._places.pop(self._numbers[place], None)
                self._numbers[place] = number
                taken.add(place)
            rows[k] = self._places[number] = place
        if fresh:
            more = np.zeros((len(fresh), 8))
            more[:, : kernel.MEASURED] = seen.measured[fresh, : kernel.MEASURED]
            self._state = np.concatenate([self._state, more])
            # np.concatenate would create a new dtype object each time, which numba 0.68.1 would analyse again.
            sightings = np.empty(len(self._numbers), kernel.SIGHTING)
            sightings[: -len(fresh)] = self._sightings
            sightings[-len(fresh) :] = [(1, measured_s, KINDS.get(seen.kinds[k], kernel.OTHER)) for k in fresh]
            self._sightings = sightings
        self._named = tuple(self._numbers), tuple(self._kinds)
        return rows

    def _lost_there(self, seen: ObjectTable, new: int, taken: set[int], measured_s: float) -> int:
        """Return the row of the nearest lost object with the same class and about the same size as a new object; -1 if
        there is none.
        """
        best, nearest, kind = -1, math.inf, seen.kinds[new]
        new_x, new_y, new_length = seen.measured[new, [kernel.X, kernel.Y, kernel.LENGTH]].tolist()
        for k in range(len(self._state)):
            if k in taken or self._kinds[k] != kind:
                continue
            x, y, length = (float(v) for v in self._state[k, [kernel.X, kernel.Y, kernel.LENGTH]])
            away, lost_s = math.hypot(x - new_x, y - new_y), measured_s - float(self._sightings["last_s"][k])
            near = away < min(SAME_OBJECT_M + SAME_OBJECT_MPS * lost_s, nearest)
            if near and abs(new_length - length) < SAME_SIZE * length:
                best, nearest = k, away
        return best

    def _drop(self, measured_s: float) -> None:
        """Drop the objects that have not been seen for too long."""
        self._listed = None
        lost_s = measured_s - self._sightings["last_s"]
        keep = lost_s <= np.where(self._state[:, kernel.SPEED] < kernel.SMOOTHED_STANDS_MPS, STANDING_COAST_S, COAST_S)
        self._state, self._sightings = self._state[keep], self._sightings[keep]
        rows = np.flatnonzero(keep).tolist()
        self._numbers, self._kinds = [self._numbers[k] for k in rows], [self._kinds[k] for k in rows]
        self._places = {number: k for k, number in enumerate(self._numbers)}
        self._named = tuple(self._numbers), tuple(self._kinds)


class SignalMemory:
    """The colours of the signals, remembered for `COLOUR_KEPT_S` while a lorry or a bend hides a signal."""

    def __init__(self) -> None:
        self._colours: dict[str, tuple[float, SignalColour]] = {}

    def update(self, observation: Observation) -> Mapping[str, SignalColour]:
        """Process an observation; return the colours, by signal, that are seen now or were seen at most `COLOUR_KEPT_S`
        ago.
        """
        now_s, seen, colours = observation.time_s, observation.signals, self._colours
        for signal, colour in seen.items():
            colours[signal] = now_s, colour
        if len(colours) > len(seen):
            self._colours = {k: last for k, last in colours.items() if 0.0 <= now_s - last[0] <= COLOUR_KEPT_S}
            return {signal: colour for signal, (_, colour) in self._colours.items()}
        return seen


@lru_cache(maxsize=_PACES)
def _pace(passed_s: float) -> tuple[FloatArray, float]:
    """Return the gains, and the share that missing objects keep of their acceleration and yaw rate (`Scan.fades`), for
    an object list that is this much later than the last one.
    """
    return _gains(round(passed_s, 3)), math.exp(-passed_s / FADES_S)


@cache
def _gains(dt: float) -> FloatArray:
    """Return the gains for measurements `dt` (s) apart, [mode, bins, count, row]: the gains of an object's state are
    beside each other in memory.

    `count`: number of earlier measurements of the object. A rate, which is not measured, is corrected by the
    measurement of its value.
    """
    table = np.empty((8, 3, kernel.BINS, kernel.SETTLED))
    pace = _pair_gains(kernel.SPEED_NOISE_MPS, 0.0, START_ACCELERATION_MPS2, JERK_MPS3 * dt, dt)
    table[kernel.SPEED], table[kernel.ACCELERATION] = pace[:, 0], pace[:, 1]
    table[kernel.LENGTH], table[kernel.WIDTH] = (np.maximum(1.0 / np.arange(1, kernel.SETTLED + 1), SIZE_GAIN),) * 2
    turns = {
        kernel.DRIVES: _pair_gains(kernel.HEADING_NOISE_RAD, 0.0, START_YAW_RAD_S, YAW_CHANGE_RAD_S2 * dt, dt),
        kernel.STANDS: _pair_gains(kernel.HEADING_NOISE_RAD, STANDING_TURN_RAD_S * dt, 0.0, 0.0, dt),
        kernel.WALKS: _pair_gains(kernel.WALKER_HEADING_NOISE_RAD, WALKER_TURN_RAD_S * dt, 0.0, 0.0, dt),
    }
    drifts = {kernel.DRIVES: DRIFT_MPS, kernel.STANDS: STANDING_DRIFT_MPS, kernel.WALKS: DRIFT_MPS}
    for mode, turn in turns.items():
        table[kernel.HEADING, mode], table[kernel.YAW_RATE, mode] = turn[:, 0], turn[:, 1]
        for k, noise in enumerate(kernel.PLACE_NOISES_M.tolist()):
            table[kernel.X : kernel.Y + 1, mode, k] = _pair_gains(noise, drifts[mode] * dt, 0.0, 0.0, dt)[:, 0]
    return np.ascontiguousarray(np.moveaxis(table, 0, -1))


def _pair_gains(noise: float, drift: float, start_rate: float, rate_change: float, dt: float) -> FloatArray:
    """Return the gains of a Kalman filter of a value and its rate, by the number of earlier measurements, [count, 2].

    Args:
        noise: standard deviation of a measurement of the value. drift: additional drift of the value in a step.
        start_rate: standard deviation of the rate at the beginning. rate_change: standard deviation of the change of
            the rate in a step. dt: duration of a step, s.
    """
    value, both, rate = noise * noise, 0.0, start_rate * start_rate  # the value after the first measurement
    gains = [(1.0, 0.0)]
    for _ in range(kernel.SETTLED - 1):
        value += 2 * dt * both + dt * dt * rate + drift * drift + (rate_change * dt / 2) ** 2
        both += dt * rate + rate_change * rate_change * dt / 2
        rate += rate_change * rate_change
        first, second = value / (value + noise * noise), both / (value + noise * noise)
        gains.append((first, second))
        value, both, rate = (1 - first) * value, (1 - first) * both, rate - second * both
    return np.array(gains)
