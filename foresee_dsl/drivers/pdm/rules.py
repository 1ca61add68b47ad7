"""Signals and right of way: the length along the route that the front bumper may not pass, if any."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from foresee_dsl.drivers.pdm import settings as cfg
from foresee_dsl.drivers.pdm.foes import (
    CROSSED,
    EXIT_S,
    HAS_PRIORITY,
    LEAVES_S,
    MEETS_S,
    OWN_S,
    OWN_UNTIL_S,
    STOP_S,
    FoeTable,
)
from foresee_dsl.drivers.pdm.route import GRID_M, PROFILE, IntArray, Projection, Route
from foresee_dsl.drivers.pdm.situation import (
    A_SPEED,
    HALF_LENGTH,
    Actors,
    BoolArray,
    EgoOnRoute,
    near_junctions,
    stops_within,
)
from foresee_dsl.drivers.protocol import FloatArray, JunctionPassage, SignalColour
from foresee_dsl.kernels.compiling import inner

PROFILE_STEP_M = 0.5
STANDS_MPS = 0.5


class Zone(NamedTuple):
    """A conflict with somebody who has priority.

    Attributes:
        foe: its index on the route. column: among the matches. wait_s: m along the route, where the ego waits for it,
            so that it stands in no other; last_wait_s: right before it, where it is past the other place.
    """

    foe: int
    column: int
    wait_s: float
    last_wait_s: float


class Arrival(NamedTuple):
    """When the ego's front bumper would be where, if nothing held it up: comfortable acceleration, the speed profile.

    Attributes:
        times: s, at places from `first_s` on, `PROFILE_STEP_M` apart. limit_mps: the most that the profile allows.
    """

    times: FloatArray
    first_s: float
    limit_mps: float


def signal_brakings(route: Route, strongest_mps2: float, signals: Mapping[str, SignalColour]) -> FloatArray:
    """Return `signal_braking` of each junction, negative where it may go: [J]."""
    braking = [-1.0] * len(route.junctions)
    for k, _ in route.signals:
        wish = signal_braking(route.junctions[k], strongest_mps2, signals)
        if wish is not None:
            braking[k] = wish
    return np.array(braking)


def signal_braking(
    passage: JunctionPassage, strongest_mps2: float, signals: Mapping[str, SignalColour]
) -> float | None:
    """Return the braking up to which it stops at a junction's line, m/s^2; None where its signal lets it go.

    A signal that should be there and is not seen is approached ready to stop.
    """
    if passage.signal is None:
        return None
    colour = signals.get(passage.signal)
    if colour == "red":
        return strongest_mps2
    if colour == "amber":
        return cfg.AMBER_BRAKING_MPS2
    return cfg.UNSEEN_BRAKING_MPS2 if colour is None else None


@inner
def find_wall(
    actors: Actors,
    now: Projection,
    own: BoolArray,
    can_pass: BoolArray,
    which: IntArray,
    on: BoolArray,
    found: FloatArray,
    foes: FoeTable,
    braking: FloatArray,
    route: FloatArray,
    origin_s: float,
    ego: EgoOnRoute,
) -> float:
    """Return where the front bumper must stop, infinite for nowhere.

    `which`, `on` and `found` are the matches of foes; `braking` [J] is what signals ask for, negative for nothing.
    """
    queue_end_s = _queue_end(actors, now, own, can_pass, ego)
    near = near_junctions(ego.front_s, ego.rear_s, foes.junctions)
    nearest = np.inf
    for n in range(len(near)):
        k = near[n]
        stop = _signal_wall(foes.junctions[k, STOP_S], braking[k], ego)
        if stop == np.inf:
            stop = _queue_wall(foes.junctions[k], ego, queue_end_s)
        if stop < np.inf:
            return min(nearest, stop)  # what lies behind does not matter now
        nearest = min(nearest, _yield_wall(k, actors, which, on, found, foes, route, origin_s, ego))
    return nearest


@inner
def _signal_wall(stop_s: float, braking: float, ego: EgoOnRoute) -> float:
    """Return where it stops for a signal, infinite for nowhere."""
    if braking < 0.0 or ego.front_s > stop_s + cfg.STOP_MARGIN_M:
        return np.inf
    if ego.front_s > stop_s - cfg.STOP_MARGIN_M and ego.speed_mps < STANDS_MPS:
        return ego.front_s  # it stands at (or a hand's breadth over) the line, and stays
    return stop_s - cfg.STOP_MARGIN_M if stops_within(ego, stop_s, braking) else np.inf


@inner
def _queue_end(actors: Actors, now: Projection, own: BoolArray, can_pass: BoolArray, ego: EgoOnRoute) -> float:
    """Return the rear of the nearest slow vehicle ahead in the lane, infinite where there is none."""
    nearest = np.inf
    for a in range(len(own)):
        if own[a] and not can_pass[a] and actors.table[A_SPEED, a] < cfg.QUEUE_MPS:
            rear = now.s[a] - actors.table[HALF_LENGTH, a]
            if ego.front_s - 1.0 < rear < nearest:
                nearest = rear
    return nearest


@inner
def _queue_wall(junction: FloatArray, ego: EgoOnRoute, queue_end_s: float) -> float:
    """Stay before the line while the queue behind the junction leaves no room for the ego; infinite: it may go."""
    stop_s: float = junction[STOP_S]
    stop, length = stop_s - cfg.STOP_MARGIN_M, ego.front_s - ego.rear_s
    full = stop_s < queue_end_s < junction[EXIT_S] + length + cfg.MINIMUM_GAP_M
    if junction[CROSSED] > 0 and full and ego.front_s <= stop_s and stops_within(ego, stop, cfg.BRAKING_MPS2):
        return stop
    return np.inf


@inner
def _yield_wall(
    k: int,
    actors: Actors,
    which: IntArray,
    on: BoolArray,
    found: FloatArray,
    foes: FoeTable,
    route: FloatArray,
    origin_s: float,
    ego: EgoOnRoute,
) -> float:
    """Return the first waiting place of a junction that it must stop at, infinite for none."""
    ahead, until_s, anybody = _ahead(k, which, on, foes, ego)
    if not anybody:
        return np.inf
    nearest, length = np.inf, ego.front_s - ego.rear_s
    arrival = arrivals(route, origin_s, ego, until_s)
    wait, last = -np.inf, -np.inf
    for n in range(len(ahead)):  # those without room to stand in between share the first's waiting place
        f = which[ahead[n]]
        first, until = foes.numbers[f, OWN_S], foes.numbers[f, OWN_UNTIL_S]
        if first - last > length + cfg.YIELD_MARGIN_M:
            wait = first - cfg.YIELD_MARGIN_M
        last = max(last, until)
        zone = Zone(f, ahead[n], wait, first - cfg.YIELD_MARGIN_M)
        if not _must_wait(zone, actors, on, found, foes, arrival, ego):
            continue
        braking = ego.strongest_braking_mps2 if foes.walking[f] else cfg.YIELD_BRAKING_MPS2
        for place in (zone.wait_s, zone.last_wait_s):
            if ego.front_s <= place + cfg.STOP_MARGIN_M and stops_within(ego, place + cfg.STOP_MARGIN_M, braking):
                nearest = min(nearest, max(place, ego.front_s) if ego.speed_mps < STANDS_MPS else place)
                break
    return nearest


@inner
def _ahead(k: int, which: IntArray, on: BoolArray, foes: FoeTable, ego: EgoOnRoute) -> tuple[IntArray, float, bool]:
    """Return which matches are of a junction's foes with priority whose conflict is ahead, in their order along the
    route, where the last of them ends, and whether anybody is on one of their paths."""
    found, count, until_s, anybody = np.empty(len(which), dtype=np.int64), 0, -np.inf, False
    for i in range(len(which)):
        f = which[i]
        if not foes.first_of[k] <= f < foes.first_of[k + 1] or foes.numbers[f, HAS_PRIORITY] == 0:
            continue
        first, until = foes.numbers[f, OWN_S], foes.numbers[f, OWN_UNTIL_S]
        if not ego.front_s < first + cfg.STOP_MARGIN_M:
            continue
        until_s = max(until_s, until)
        for a in range(on.shape[0]):
            anybody |= on[a, i]
        n = count
        while n > 0:
            before = which[found[n - 1]]
            start, end = foes.numbers[before, OWN_S], foes.numbers[before, OWN_UNTIL_S]
            if start < first or (start == first and end <= until):
                break
            found[n] = found[n - 1]
            n -= 1
        found[n] = i
        count += 1
    return found[:count], until_s, anybody


@inner
def _must_wait(
    zone: Zone,
    actors: Actors,
    on: BoolArray,
    found: FloatArray,
    foes: FoeTable,
    arrival: Arrival,
    ego: EgoOnRoute,
) -> bool:
    """Tell whether somebody with priority is, or will be, in the conflict zone when the ego would be."""
    numbers, i = foes.numbers[zone.foe], zone.column
    enters = arrives(arrival, numbers[OWN_S])
    leaves = arrives(arrival, numbers[OWN_UNTIL_S] + ego.front_s - ego.rear_s)
    starting = zone.wait_s - ego.front_s > cfg.AT_WAIT_M
    for a in range(on.shape[0]):
        if not on[a, i]:
            continue
        s, speed, half = found[0, a, i], found[1, a, i], actors.table[HALF_LENGTH, a]
        if foes.walking[zone.foe]:
            begins, ends = _walker_window(numbers, s, speed)
        else:
            begins, ends = _vehicle_window(numbers, s - half, s + half, speed, starting, arrival.limit_mps)
        if leaves + cfg.YIELD_BEFORE_S > begins and enters < ends + cfg.YIELD_AFTER_S:
            return True
    return False


@inner
def _walker_window(numbers: FloatArray, s: float, speed: float) -> tuple[float, float]:
    """Return when somebody on a crossing is on (or about to step on) the ego's lane; (inf, -inf) for never."""
    first, last = numbers[MEETS_S] - cfg.PEDESTRIAN_AIR_M, numbers[LEAVES_S] + cfg.PEDESTRIAN_AIR_M
    if speed < 0:  # walking against the path's direction: mirror
        s, first, last, speed = -s, -last, -first, -speed
    if s >= last:
        return np.inf, -np.inf
    if speed < cfg.COAST_MPS:
        on_lane = first + cfg.PEDESTRIAN_AIR_M < s < last - cfg.PEDESTRIAN_AIR_M
        return (0.0, np.inf) if on_lane else (np.inf, -np.inf)
    return max(first - s, 0.0) / speed, (last - s) / speed


@inner
def _vehicle_window(
    numbers: FloatArray, rear_s: float, front_s: float, speed: float, starting: bool, limit_mps: float
) -> tuple[float, float]:
    """Return when a vehicle is in the conflict zone; (inf, -inf) for never.

    Arrival is reckoned with acceleration to the limit where it is slower; leaving with its present speed.
    """
    first, last = numbers[MEETS_S], numbers[LEAVES_S]
    if rear_s >= last:
        return np.inf, -np.inf
    room = max(first - front_s, 0.0)
    if speed < STANDS_MPS:
        return (math.sqrt(2 * room / cfg.FOE_ACCELERATION_MPS2), np.inf) if starting else (np.inf, -np.inf)
    top = max(speed, limit_mps)
    reach_top_s = (top - speed) / cfg.FOE_ACCELERATION_MPS2
    reach_top_m = (top + speed) / 2 * reach_top_s
    if room > reach_top_m:
        comes = reach_top_s + (room - reach_top_m) / top
    else:
        comes = (math.sqrt(speed**2 + 2 * cfg.FOE_ACCELERATION_MPS2 * room) - speed) / cfg.FOE_ACCELERATION_MPS2
    return comes, (last - rear_s) / speed


@inner
def arrivals(route: FloatArray, origin_s: float, ego: EgoOnRoute, last_s: float) -> Arrival:
    """Return the times at which the ego could be at places up to `last_s` and its own length beyond it.

    The profile counts for the middle of the car.
    """
    first_s, length = ego.front_s, ego.front_s - ego.rear_s
    end_s = last_s + length + 2 * PROFILE_STEP_M
    step = (first_s + PROFILE_STEP_M) - first_s  # as numpy's arange has it
    times = np.zeros(max(int(np.ceil((end_s - first_s) / PROFILE_STEP_M)), 2))
    limit, last = 0.0, 0.0
    for i in range(len(times)):
        s = first_s + i * step
        place = min(max((s - length / 2 - origin_s) * (1.0 / GRID_M), 0.0), route.shape[0] - 1.001)
        k = max(int(place), 0)
        most = route[k, PROFILE] + (place - k) * (route[k + 1, PROFILE] - route[k, PROFILE])
        v = min(most, math.sqrt(ego.speed_mps**2 + 2 * cfg.ACCELERATION_MPS2 * (s - first_s)))
        limit = max(limit, most)
        if i > 0:
            times[i] = times[i - 1] + 2 * PROFILE_STEP_M / max(v + last, 1e-3)
        last = v
    return Arrival(times, first_s, limit)


@inner
def arrives(arrival: Arrival, s: float) -> float:
    """Return the time until the front is at `s`."""
    times, first_s = arrival.times, arrival.first_s
    step = (first_s + PROFILE_STEP_M) - first_s
    k = min(max(int((s - first_s) / step), 0), len(times) - 2)
    here = first_s + k * step
    slope = (times[k + 1] - times[k]) / (first_s + (k + 1) * step - here)
    time_s: float = min(max(slope * (s - here) + times[k], 0.0), times[-1])
    return time_s
