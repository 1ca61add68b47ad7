"""Signals and right of way: finds the length along the route that the front bumper may not pass (the wall)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foresee_dsl.kernels.arrays import FloatArray, IntArray, Records
from foresee_dsl.kernels.compiling import FLOATS, compiled, inner
from foresee_dsl.kernels.pdm import records as r
from foresee_dsl.kernels.pdm import settings as cfg
from foresee_dsl.kernels.pdm.route import near_junctions, profile_at, stops_before

PROFILE_STEP_M = 0.5


class Arrival(NamedTuple):
    """Times at which the ego's front bumper would reach each place without hindrance: with comfortable acceleration up
    to the speed profile.

    Attributes:
        times: s, at places from `first_s` on, `PROFILE_STEP_M` apart. limit_mps: maximum of the profile.
    """

    times: FloatArray
    first_s: float
    limit_mps: float


@inner
def _signal_wall(egos: Records, stop_s: float, braking: float) -> float:
    """Return the length along the route at which the ego stops for a signal; infinite if it does not stop."""
    front_s = egos[0]["front_s"]
    if braking < 0.0 or front_s > stop_s + cfg.STOP_MARGIN_M:
        return np.inf
    if front_s > stop_s - cfg.STOP_MARGIN_M and egos[0]["speed"] < cfg.SENSED_STANDS_MPS:
        return float(front_s)  # the ego stands at the line or just beyond it, and stays there
    return stop_s - cfg.STOP_MARGIN_M if stops_before(egos, stop_s, braking) else np.inf


@inner
def _queue_end(ego: np.void, actors: Records) -> float:
    """Return the length along the route at which the rear of the nearest slow vehicle ahead in the lane is; infinite if
    there is no such vehicle."""
    nearest = np.inf
    for a in range(len(actors)):
        actor = actors[a]
        if actor["own_lane"] and not actor["passable"] and actor["speed"] < cfg.QUEUE_MPS:
            rear = actor["s"] - actor["half_length"]
            if ego["front_s"] - 1.0 < rear < nearest:
                nearest = rear
    return nearest


@inner
def _queue_wall(egos: Records, junction: np.void, queue_end_s: float) -> float:
    """Return the place along the route, m, at which the ego stops before the junction because a queue beyond it leaves
    the ego no room; infinite if the ego may go on.
    """
    ego, stop_s = egos[0], float(junction["stop_s"])
    stop, length = stop_s - cfg.STOP_MARGIN_M, ego["front_s"] - ego["rear_s"]
    full = stop_s < queue_end_s < junction["exit_s"] + length + cfg.MINIMUM_GAP_M
    if junction["crossed"] and full and ego["front_s"] <= stop_s and stops_before(egos, stop, cfg.BRAKING_MPS2):
        return stop
    return np.inf


@inner
def _yield_wall(
    junction: int, egos: Records, actors: Records, foes: Records, matches: Records, route: Records
) -> float:
    """Return the first length along the route at which the ego must wait at a junction for streams with priority;
    infinite if it need not wait."""
    ego = egos[0]
    ahead, until_s, any_actor = _ahead(junction, ego, foes, matches)
    if not any_actor:
        return np.inf
    nearest, length = np.inf, ego["front_s"] - ego["rear_s"]
    arrival = arrivals(ego, route, until_s)
    wait, last = -np.inf, -np.inf
    # Conflicts that have no room for the ego between them share the waiting place of the first one.
    for n in range(len(ahead)):
        f = ahead[n]
        first, until = foes[f]["own_s"], foes[f]["own_until_s"]
        if first - last > length + cfg.YIELD_MARGIN_M:
            wait = first - cfg.YIELD_MARGIN_M
        last = max(last, until)
        if not _must_wait(ego, actors, foes[f], matches[:, f], arrival, wait):
            continue
        braking = ego["strongest"] if foes[f]["walking"] else cfg.YIELD_BRAKING_MPS2
        # At `wait` the ego blocks no other conflict; if it is beyond `wait`, it waits right before this conflict.
        for place in (wait, first - cfg.YIELD_MARGIN_M):
            margin_s = place + cfg.STOP_MARGIN_M
            if ego["front_s"] <= margin_s and stops_before(egos, margin_s, braking):
                nearest = min(nearest, max(place, ego["front_s"]) if ego["speed"] < cfg.SENSED_STANDS_MPS else place)
                break
    return nearest


@inner
def _ahead(junction: int, ego: np.void, foes: Records, matches: Records) -> tuple[IntArray, float, bool]:
    """Return the streams of a junction with priority and a conflict ahead, in their order along the route.

    The other two values are the end of the last conflict, and whether an actor is on the path of one of these streams.
    """
    ahead, count, until_s, any_actor = np.empty(len(foes), dtype=np.int64), 0, -np.inf, False
    for f in range(len(foes)):
        if foes[f]["junction"] != junction or not foes[f]["has_priority"]:
            continue
        first, until = foes[f]["own_s"], foes[f]["own_until_s"]
        if not ego["front_s"] < first + cfg.STOP_MARGIN_M:
            continue
        until_s = max(until_s, until)
        for a in range(len(matches)):
            any_actor |= matches[a, f]["on"]
        n = count
        while n > 0:
            before = foes[ahead[n - 1]]
            start, end = before["own_s"], before["own_until_s"]
            if start < first or (start == first and end <= until):
                break
            ahead[n] = ahead[n - 1]
            n -= 1
        ahead[n] = f
        count += 1
    return ahead[:count], until_s, any_actor


@inner
def _must_wait(ego: np.void, actors: Records, foe: np.void, matches: Records, arrival: Arrival, wait_s: float) -> bool:
    """Return whether an actor with priority is, or will be, in the conflict zone at the same time as the ego.

    `matches`: [A] the actors' matches with the stream that has priority. `wait_s`: length at which the ego would wait.
    """
    enters = arrives(arrival, foe["own_s"])
    leaves = arrives(arrival, foe["own_until_s"] + ego["front_s"] - ego["rear_s"])
    starting = wait_s - ego["front_s"] > cfg.AT_WAIT_M
    for a in range(len(matches)):
        if not matches[a]["on"]:
            continue
        s, speed, half = matches[a]["s"], matches[a]["speed"], actors[a]["half_length"]
        if foe["walking"]:
            begins, ends = _walker_window(foe, s, speed)
        else:
            begins, ends = _vehicle_window(foe, s - half, s + half, speed, starting, arrival.limit_mps)
        if leaves + cfg.YIELD_BEFORE_S > begins and enters < ends + cfg.YIELD_AFTER_S:
            return True
    return False


@inner
def _walker_window(foe: np.void, s: float, speed: float) -> tuple[float, float]:
    """Return the interval of time in which a pedestrian is on (or about to step on) the ego's lane, s; (inf, -inf) if
    never.
    """
    first, last = foe["meets"] - cfg.PEDESTRIAN_AIR_M, foe["leaves"] + cfg.PEDESTRIAN_AIR_M
    if speed < 0:  # the pedestrian walks against the path's direction: mirror
        s, first, last, speed = -s, -last, -first, -speed
    if s >= last:
        return np.inf, -np.inf
    if speed < cfg.COAST_MPS:
        on_lane = first + cfg.PEDESTRIAN_AIR_M < s < last - cfg.PEDESTRIAN_AIR_M
        return (0.0, np.inf) if on_lane else (np.inf, -np.inf)
    return max(first - s, 0.0) / speed, (last - s) / speed


@inner
def _vehicle_window(
    foe: np.void, rear_s: float, front_s: float, speed: float, starting: bool, limit_mps: float
) -> tuple[float, float]:
    """Return the interval of time in which a vehicle is in the conflict zone, s; (inf, -inf) if never.

    It is assumed to accelerate up to the limit until it arrives, and to leave with its current speed.
    """
    first, last = foe["meets"], foe["leaves"]
    if rear_s >= last:
        return np.inf, -np.inf
    room = max(first - front_s, 0.0)
    if speed < cfg.SENSED_STANDS_MPS:
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
def arrivals(ego: np.void, route: Records, last_s: float) -> Arrival:
    """Return the times at which the ego could reach places up to `last_s` plus its own length.

    The profile applies to the middle of the car.
    """
    first_s, length = ego["front_s"], ego["front_s"] - ego["rear_s"]
    end_s = last_s + length + 2 * PROFILE_STEP_M
    step = (first_s + PROFILE_STEP_M) - first_s  # the step that numpy's arange uses
    times = np.zeros(max(int(np.ceil((end_s - first_s) / PROFILE_STEP_M)), 2))
    limit, last = 0.0, 0.0
    for i in range(len(times)):
        s = first_s + i * step
        most = profile_at(route, s - length / 2)
        v = min(most, math.sqrt(ego["speed"] ** 2 + 2 * cfg.ACCELERATION_MPS2 * (s - first_s)))
        limit = max(limit, most)
        if i > 0:
            times[i] = times[i - 1] + 2 * PROFILE_STEP_M / max(v + last, 1e-3)
        last = v
    return Arrival(times, first_s, limit)


@inner
def arrives(arrival: Arrival, s: float) -> float:
    """Return the time until the front bumper reaches `s`, s."""
    times, first_s = arrival.times, arrival.first_s
    step = (first_s + PROFILE_STEP_M) - first_s
    k = min(max(int((s - first_s) / step), 0), len(times) - 2)
    here = first_s + k * step
    slope = (times[k + 1] - times[k]) / (first_s + (k + 1) * step - here)
    time_s: float = min(max(slope * (s - here) + times[k], 0.0), times[-1])
    return time_s


@compiled(r.EGOS, r.ACTORS, r.FOES, r.MATCHES, r.JUNCTIONS, FLOATS, r.ROUTE)
def find_wall(
    egos: Records,
    actors: Records,
    foes: Records,
    matches: Records,
    junctions: Records,
    braking: FloatArray,
    route: Records,
) -> float:
    """Return the length along the route at which the front bumper must stop; infinite if it need not.

    `braking`: [J] braking for the signal of each junction, m/s^2, negative if the ego need not stop; `matches`: [A, F].
    """
    ego = egos[0]
    queue_end_s = _queue_end(ego, actors)
    near = near_junctions(ego, junctions)
    nearest = np.inf
    for n in range(len(near)):
        k = near[n]
        stop = _signal_wall(egos, junctions[k]["stop_s"], braking[k])
        if stop == np.inf:
            stop = _queue_wall(egos, junctions[k], queue_end_s)
        if stop < np.inf:
            return min(nearest, stop)  # junctions beyond the wall have no effect now
        nearest = min(nearest, _yield_wall(k, egos, actors, foes, matches, route))
    return nearest
