"""The others, tracked: smooth places, speeds and headings at the present moment, made of noisy and late object lists.

Each object has a filter of its own with the gains of a Kalman filter: heading with yaw rate, speed with acceleration,
and the place, which is carried along by both. Gains come from tables, by how often an object was seen: no covariance is
carried. All objects are moved on together, in arrays. What it knows is a function of the observations since `reset`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from itertools import chain
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.drivers.protocol import ActorClass, FloatArray, Observation, SeenActor
from foresee_dsl.kernels.compiling import CUBE, FLAG, FLAGS, FLOAT, FLOATS, HYPERCUBE, INTS, TABLE, compiled, inner

COAST_S = 1.5
"""Ours: an object that is not seen any more is carried on for this long. The sensors give back its number within 1 s;
in the rest of the time a new number may be the same object."""
STANDING_COAST_S = 4.0
"""Ours: the same for what stood when it was seen last, such as a parked car behind a passing lorry."""
DOUBT_MPS = 0.2
"""Ours: by how much a second each side of a moving object grows while it is not seen; what a constant acceleration of
0.3 m/s^2 adds to its way in 1.5 s."""
STANDS_MPS = 0.25
"""Ours: slower than this after smoothing is standing still; over three times the noise of a smoothed speed."""

SPEED_NOISE_MPS = 0.15
HEADING_NOISE_RAD = math.radians(2.0)
WALKER_HEADING_NOISE_RAD = math.radians(10.0)
PLACE_NOISE_M = 0.1
PLACE_NOISE_PER_M = 0.003
"""Standard deviations that the filters reckon with, about those of the standard sensors (`simulate/sensing`)."""
JERK_MPS3 = 4.0
"""Ours: how fast accelerations change, as a standard deviation of each step; of 2, 3, 4 and 8 this has the least error
over driving on, setting off and braking with 6 m/s^2."""
START_ACCELERATION_MPS2 = 1.0
"""Ours: spread of accelerations in town, which an object is taken to have before it was seen to change its speed."""
YAW_CHANGE_RAD_S2 = 0.7
"""Ours: how fast yaw rates change; entering a turn with 7 m radius at 5 m/s in 1.5 s."""
START_YAW_RAD_S = 0.1
"""Ours: spread of yaw rates at first sight; nearly everybody goes straight."""
DRIFT_MPS = 0.4
"""Ours: by how much the true motion of the centre differs from the filtered speed along the filtered heading."""
STANDING_DRIFT_MPS = 0.02
"""Ours: the same while it stands, so that places of parked cars settle."""
STANDING_TURN_RAD_S = 0.03
"""Ours: who stands hardly turns."""
WALKER_TURN_RAD_S = 0.7
"""Ours: how fast somebody on foot strays from a heading; a quick turn, of over 60 degrees, is a jump."""
SIZE_GAIN = 0.05
"""Ours: sizes do not change, but what is seen of something may, as more of it comes into view."""
JUMP = 6.0
"""Ours: who is this many standard deviations (of one measurement) off where it was expected has begun something new,
and its filter starts again. Two of them are the noise of the prediction; noise alone hardly ever does that."""
SAME_PLACE_M = 1.5
SAME_PLACE_MPS = 1.5
"""Ours: a new number is an object that was lost if it is within this (and this much more a second that it was lost) of
where that should be: under the distance between two cars in a queue."""
SAME_SIZE = 0.3
"""Ours: and if its length differs by less than this share; ten times the noise."""
FADES_S = 0.5
"""Ours: acceleration and yaw rate of what is not seen fade with this time constant."""

X, Y, HEADING, SPEED, LENGTH, WIDTH, ACCELERATION, YAW_RATE = range(8)
"""Columns of a tracker's state [A, 8]; the first six are measured."""
MEASURED = 6
LOST_S = 8
"""Row of `Tracks.table`, after those."""
DRIVES, STANDS, WALKS = range(3)
"""How somebody moves, as far as the gains go."""
SAME_TIME_S = 1e-6

_LONG = 60
"""Gains have settled after so many measurements, 3 s."""
_BIN_M = 20.0
_BINS = 5
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
_read = attrgetter("x", "y", "heading_rad", "speed_mps", "length_m", "width_m")


class Tracks(NamedTuple):
    """The others at `time_s`; every array is [A].

    Attributes:
        table: [9, A] a row each: x, y, heading, speed, length, width, acceleration, yaw rate, time since it was seen.
        numbers: the object list's numbers. kinds: their classes.
    """

    table: FloatArray
    numbers: tuple[int, ...]
    kinds: tuple[ActorClass, ...]

    @property
    def x(self) -> FloatArray:
        """East, m."""
        row: FloatArray = self.table[X]
        return row

    @property
    def y(self) -> FloatArray:
        """North, m."""
        row: FloatArray = self.table[Y]
        return row

    @property
    def heading(self) -> FloatArray:
        """Rad."""
        row: FloatArray = self.table[HEADING]
        return row

    @property
    def speed(self) -> FloatArray:
        """Along the heading, m/s, never negative."""
        row: FloatArray = self.table[SPEED]
        return row

    @property
    def acceleration(self) -> FloatArray:
        """Along the heading, m/s^2."""
        row: FloatArray = self.table[ACCELERATION]
        return row

    @property
    def length(self) -> FloatArray:
        """M, grown by doubt where it is not seen."""
        row: FloatArray = self.table[LENGTH]
        return row

    @property
    def width(self) -> FloatArray:
        """The same."""
        row: FloatArray = self.table[WIDTH]
        return row

    @property
    def lost_s(self) -> FloatArray:
        """How long it has not been seen, s."""
        row: FloatArray = self.table[LOST_S]
        return row

    def seen(self) -> tuple[SeenActor, ...]:
        """Return them as an observation has them."""
        columns = (self.x, self.y, self.heading, self.speed, self.length, self.width)
        return tuple(map(SeenActor, self.numbers, self.kinds, *(column.tolist() for column in columns)))


class Tracker:
    """Follows the objects of an object list from step to step."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._state = np.empty((0, 8))
        self._times_seen = np.empty(0, dtype=np.int64)
        self._seen_s = np.empty(0)
        self._walks = np.empty(0, dtype=bool)
        self._numbers: list[int] = []
        self._kinds: list[ActorClass] = []
        self._places: dict[int, int] = {}
        self._measured_s: float | None = None
        self._some_lost = False

    def update(self, observation: Observation) -> Tracks:
        """Take in an observation, and return everybody at its `time_s`.

        An object list that was measured when the last one was says nothing new. One from before it means that time
        began anew: everything is forgotten.
        """
        measured_s = observation.time_s if observation.measured_s is None else observation.measured_s
        passed_s = math.inf if self._measured_s is None else measured_s - self._measured_s
        if passed_s < -SAME_TIME_S:
            self.reset()
            passed_s = math.inf
        if passed_s > SAME_TIME_S:
            self._measured_s = measured_s
            if self._numbers:
                _move(self._state, passed_s)
            self._take_in(observation, passed_s, measured_s)
        table = np.empty((9, len(self._state)))
        _present(self._state, self._seen_s, observation.time_s, measured_s, self._some_lost, table)
        return Tracks(table, tuple(self._numbers), tuple(self._kinds))

    def _take_in(self, observation: Observation, passed_s: float, measured_s: float) -> None:
        """Begin with those that are new, correct the predictions of the others by what was measured, and forget who has
        not been seen for too long."""
        seen, places, knew = observation.actors, self._places, bool(self._numbers)
        measured = np.fromiter(chain.from_iterable(map(_read, seen)), float, MEASURED * len(seen)).reshape(-1, MEASURED)
        found = [places.get(actor.track, -1) for actor in seen]
        if -1 in found:
            found = self._begin(seen, found, measured, measured_s)
        own = self._state, self._times_seen, self._seen_s, self._walks
        if knew and found:
            where, gains, ego = np.array(found, dtype=np.int64), _gains(round(passed_s, 3)), observation.ego
            times = measured_s, passed_s, self._some_lost
            _correct(*own, where, measured, ego.x, ego.y, *times, _JUMPS, gains)
        self._some_lost = len(found) < len(self._numbers)
        if self._some_lost and _fade(self._state, self._seen_s, measured_s, math.exp(-passed_s / FADES_S)) > COAST_S:
            self._drop(measured_s)

    def _begin(self, seen: Sequence[SeenActor], found: list[int], measured: FloatArray, measured_s: float) -> list[int]:
        """Give a place to each number that is new: that of an object that was lost there, else one at the end."""
        taken, fresh = set(found), []
        for k, actor in enumerate(seen):
            if found[k] >= 0:
                continue
            place = self._lost_there(actor, taken, measured_s)
            if place < 0:
                place = len(self._numbers)
                self._numbers.append(actor.track)
                self._kinds.append(actor.kind)
                fresh.append(k)
            else:
                self._places.pop(self._numbers[place], None)
                self._numbers[place] = actor.track
                taken.add(place)
            found[k] = self._places[actor.track] = place
        if fresh:
            more = np.zeros((len(fresh), 8))
            more[:, :MEASURED] = measured[fresh]
            self._state = np.concatenate([self._state, more])
            self._times_seen = np.concatenate([self._times_seen, np.ones(len(fresh), dtype=np.int64)])
            self._seen_s = np.concatenate([self._seen_s, np.full(len(fresh), measured_s)])
            self._walks = np.array([kind == "pedestrian" for kind in self._kinds], dtype=bool)
        return found

    def _lost_there(self, actor: SeenActor, taken: set[int], measured_s: float) -> int:
        """Return the nearest lost object of the same class and about the same size at an actor's place, or -1."""
        best, nearest = -1, math.inf
        for k in range(len(self._state)):
            if k in taken or self._kinds[k] != actor.kind:
                continue
            x, y, length = (float(v) for v in self._state[k, [X, Y, LENGTH]])
            away, lost_s = math.hypot(x - actor.x, y - actor.y), measured_s - float(self._seen_s[k])
            near = away < min(SAME_PLACE_M + SAME_PLACE_MPS * lost_s, nearest)
            if near and abs(actor.length_m - length) < SAME_SIZE * length:
                best, nearest = k, away
        return best

    def _drop(self, measured_s: float) -> None:
        """Forget who has not been seen for too long."""
        lost_s = measured_s - self._seen_s
        keep = lost_s <= np.where(self._state[:, SPEED] < STANDS_MPS, STANDING_COAST_S, COAST_S)
        self._state, self._times_seen = self._state[keep], self._times_seen[keep]
        self._seen_s, self._walks = self._seen_s[keep], self._walks[keep]
        kept = np.flatnonzero(keep).tolist()
        self._numbers, self._kinds = [self._numbers[k] for k in kept], [self._kinds[k] for k in kept]
        self._places = {number: k for k, number in enumerate(self._numbers)}


@inner
def _carry(state: FloatArray, dt: float) -> None:
    """Move everybody, [A, 8], on by `dt` along their arcs, in place; who is about to stand does not go backwards."""
    for a in range(len(state)):
        speed, turned = state[a, SPEED], state[a, YAW_RATE] * dt
        after = max(speed + state[a, ACCELERATION] * dt, 0.0)
        # The noise of a speed that cannot be negative would carry on who stands.
        way = 0.0 if speed < STANDS_MPS else (speed + after) * (dt / 2)
        middle = state[a, HEADING] + turned / 2
        state[a, X] += way * math.cos(middle)
        state[a, Y] += way * math.sin(middle)
        state[a, HEADING] += turned
        state[a, SPEED] = after


@compiled(TABLE, FLOAT)
def _move(state: FloatArray, dt: float) -> None:
    _carry(state, dt)


@compiled(TABLE, FLOATS, FLOAT, FLOAT, FLAG, TABLE)
def _present(
    state: FloatArray, seen_s: FloatArray, time_s: float, measured_s: float, some_lost: bool, table: FloatArray
) -> None:
    """Fill a table of tracks, [9, A], with a state [A, 8] of `measured_s`, carried on to `time_s`: who is lost has
    grown, who stands has no speed."""
    if time_s > measured_s:
        state = state.copy()
        _carry(state, time_s - measured_s)
    for a in range(len(state)):
        for row in range(8):
            table[row, a] = state[a, row]
        lost_s = time_s - seen_s[a] if some_lost and seen_s[a] < measured_s else 0.0
        table[LOST_S, a] = lost_s
        if table[SPEED, a] < STANDS_MPS:
            table[SPEED, a], table[ACCELERATION, a] = 0.0, 0.0
        else:
            table[LENGTH, a] += 2 * DOUBT_MPS * lost_s
            table[WIDTH, a] += 2 * DOUBT_MPS * lost_s


@compiled(TABLE, FLOATS, FLOAT, FLOAT)
def _fade(state: FloatArray, seen_s: FloatArray, measured_s: float, share: float) -> float:
    """Let acceleration and yaw rate fade of who is not seen, in place; return how long the longest is lost, s."""
    longest = 0.0
    for a in range(len(state)):
        if seen_s[a] < measured_s:
            state[a, ACCELERATION] *= share
            state[a, YAW_RATE] *= share
            longest = max(longest, measured_s - seen_s[a])
    return longest


@compiled(TABLE, INTS, FLOATS, FLAGS, INTS, TABLE, FLOAT, FLOAT, FLOAT, FLOAT, FLAG, CUBE, HYPERCUBE)
def _correct(
    state: FloatArray,
    times_seen: IntArray,
    seen_s: FloatArray,
    walks: BoolArray,
    where: IntArray,
    measured: FloatArray,
    ego_x: float,
    ego_y: float,
    measured_s: float,
    passed_s: float,
    some_lost: bool,
    jumps: FloatArray,
    gains: FloatArray,
) -> None:
    """Correct the states of those at `where` [N] by what was measured, [N, 6], in place.

    It was measured at `measured_s`, `passed_s` after the last one; `some_lost`: somebody was not seen then.
    """
    off = np.empty(8)
    for n in range(len(where)):
        a = where[n]
        one, count = state[a], times_seen[a]
        for row in range(MEASURED):
            off[row] = measured[n, row] - one[row]
        off[HEADING] = (off[HEADING] + math.pi) % (2 * math.pi) - math.pi
        off[ACCELERATION], off[YAW_RATE] = off[SPEED], off[HEADING]
        if some_lost:
            # A filter that waited knows less: it goes on as one that has seen less.
            missed = int(np.rint((measured_s - seen_s[a]) * (1 / passed_s))) - 1
            count = max(count - 2 * max(missed, 0), 1)
        seen_s[a] = measured_s
        away = math.hypot(measured[n, X] - ego_x, measured[n, Y] - ego_y)
        place = max(min(int(away * (1 / _BIN_M)), _BINS - 1), 0)
        mode = WALKS if walks[a] else STANDS if one[SPEED] < STANDS_MPS else DRIVES
        for row in range(SPEED + 1):
            if abs(off[row]) > jumps[row, mode, place]:
                count = 0
        for row in range(8):
            one[row] += gains[row, mode, place, count] * off[row]
        one[SPEED] = max(one[SPEED], 0.0)
        if count == 0:
            one[ACCELERATION] = 0.0
        if count == 0 or mode != DRIVES:
            one[YAW_RATE] = 0.0
        times_seen[a] = min(count + 1, _LONG - 1)


_PLACE_NOISES_M = PLACE_NOISE_M + PLACE_NOISE_PER_M * _BIN_M * (np.arange(_BINS) + 0.5)
"""[bins] of places, by distance."""
_JUMPS = JUMP * np.array(
    [
        [_PLACE_NOISES_M] * 3,
        [_PLACE_NOISES_M] * 3,
        [[noise] * _BINS for noise in (HEADING_NOISE_RAD, HEADING_NOISE_RAD, WALKER_HEADING_NOISE_RAD)],
        [[SPEED_NOISE_MPS] * _BINS] * 3,
    ]
)
"""[4, mode, bins] differences of x, y, heading and speed from which on a filter starts again."""


@cache
def _gains(dt: float) -> FloatArray:
    """Return the gains of each row of the state for measurements `dt` apart, s: [row, mode, bins, count].

    `count` is how often the object was seen before. The rates get theirs from what was measured of their values.
    """
    table = np.empty((8, 3, _BINS, _LONG))
    pace = _pair_gains(SPEED_NOISE_MPS, 0.0, START_ACCELERATION_MPS2, JERK_MPS3 * dt, dt)
    table[SPEED], table[ACCELERATION] = pace[:, 0], pace[:, 1]
    table[LENGTH], table[WIDTH] = (np.maximum(1.0 / np.arange(1, _LONG + 1), SIZE_GAIN),) * 2
    turns = {
        DRIVES: _pair_gains(HEADING_NOISE_RAD, 0.0, START_YAW_RAD_S, YAW_CHANGE_RAD_S2 * dt, dt),
        STANDS: _pair_gains(HEADING_NOISE_RAD, STANDING_TURN_RAD_S * dt, 0.0, 0.0, dt),
        WALKS: _pair_gains(WALKER_HEADING_NOISE_RAD, WALKER_TURN_RAD_S * dt, 0.0, 0.0, dt),
    }
    drifts = {DRIVES: DRIFT_MPS, STANDS: STANDING_DRIFT_MPS, WALKS: DRIFT_MPS}
    for mode, turn in turns.items():
        table[HEADING, mode], table[YAW_RATE, mode] = turn[:, 0], turn[:, 1]
        for k, noise in enumerate(_PLACE_NOISES_M.tolist()):
            table[X : Y + 1, mode, k] = _pair_gains(noise, drifts[mode] * dt, 0.0, 0.0, dt)[:, 0]
    return table


def _pair_gains(noise: float, drift: float, start_rate: float, rate_change: float, dt: float) -> FloatArray:
    """Return the gains of a Kalman filter of a value and its rate, by how often it was measured before: [count, 2].

    Args:
        noise: standard deviation of a measurement of the value. drift: by which the value strays in a step besides.
        start_rate: of the rate before anything is known. rate_change: of the rate from step to step. dt: s.
    """
    value, both, rate = noise * noise, 0.0, start_rate * start_rate  # after the first measurement
    gains = [(1.0, 0.0)]
    for _ in range(_LONG - 1):
        value += 2 * dt * both + dt * dt * rate + drift * drift + (rate_change * dt / 2) ** 2
        both += dt * rate + rate_change * rate_change * dt / 2
        rate += rate_change * rate_change
        first, second = value / (value + noise * noise), both / (value + noise * noise)
        gains.append((first, second))
        value, both, rate = (1 - first) * value, (1 - first) * both, rate - second * both
    return np.array(gains)
