"""Signals and right of way: the length along the route that the front bumper may not pass, if any."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from foresee_dsl.drivers import pdm_settings as cfg
from foresee_dsl.drivers.compiled import FLOAT, FLOATS, compiled
from foresee_dsl.drivers.pdm_prediction import FoeMatches
from foresee_dsl.drivers.pdm_route import GRID_M, FoePath, Route
from foresee_dsl.drivers.pdm_situation import BoolArray, EgoOnRoute, Situation
from foresee_dsl.drivers.protocol import FloatArray, JunctionPassage, SignalColour

PROFILE_STEP_M = 0.5
STANDS_MPS = 0.5


@dataclass(frozen=True)
class Zone:
    """A conflict with somebody who has priority.

    Attributes:
        index: of the foe among the matches. first_s, until_s: m along the route. wait_s: where it waits for it, so that
            it stands in no other; last_wait_s: right before it, where it is past the other place.
    """

    index: int
    foe: FoePath
    first_s: float
    until_s: float
    wait_s: float
    last_wait_s: float


def near_junctions(situation: Situation) -> tuple[int, ...]:
    """Return the indices of the junctions that the ego is in or comes to."""
    return situation.near_junctions


def wall(situation: Situation, matches: FoeMatches, can_pass: BoolArray) -> float | None:
    """Return where the front bumper must stop, the nearest of all reasons; None when the way is free.

    Args:
        situation: what is seen.
        matches: who is on which foe's path, of the junctions that are near.
        can_pass: [A], what stands for good and can be passed (so that it is no queue).
    """
    route, ego = situation.route, situation.ego
    queue_end_s = _queue_end(situation, can_pass)
    walls: list[float] = []
    for k in situation.near_junctions:
        passage = route.junctions[k]
        stop = _signal_wall(passage, ego, situation.signals)
        if stop is None:
            stop = _queue_wall(passage, ego, queue_end_s)
        if stop is not None:
            walls.append(stop)
            break  # what lies behind does not matter now
        foes = [i for i, f in enumerate(matches.foes) if f.passage == k and f.foe.has_priority]
        walls.extend(_yield_walls(situation, matches, foes))
    return min(walls, default=None)


def signal_braking(passage: JunctionPassage, ego: EgoOnRoute, signals: Mapping[str, SignalColour]) -> float | None:
    """Return the braking up to which it stops at a junction's line, m/s^2; None where its signal lets it go.

    A signal that should be there and is not seen is approached ready to stop.
    """
    if passage.signal is None:
        return None
    colour = signals.get(passage.signal)
    if colour == "red":
        return ego.strongest_braking_mps2
    if colour == "amber":
        return cfg.AMBER_BRAKING_MPS2
    return cfg.UNSEEN_BRAKING_MPS2 if colour is None else None


def _signal_wall(passage: JunctionPassage, ego: EgoOnRoute, signals: Mapping[str, SignalColour]) -> float | None:
    braking = signal_braking(passage, ego, signals)
    if braking is None or ego.front_s > passage.stop_s + cfg.STOP_MARGIN_M:
        return None
    if ego.front_s > passage.stop_s - cfg.STOP_MARGIN_M and ego.state.speed_mps < STANDS_MPS:
        return ego.front_s  # it stands at (or a hand's breadth over) the line, and stays
    return passage.stop_s - cfg.STOP_MARGIN_M if ego.stops_within(passage.stop_s, braking) else None


def _queue_end(situation: Situation, can_pass: BoolArray) -> float:
    """Return the rear of the nearest slow vehicle ahead in the lane, infinite where there is none."""
    actors, nearest = situation.actors, math.inf
    for a in np.flatnonzero(situation.own).tolist():
        rear = float(situation.now.s[a]) - float(actors.half_length[a])
        if not can_pass[a] and actors.speed[a] < cfg.QUEUE_MPS and situation.ego.front_s - 1.0 < rear < nearest:
            nearest = rear
    return nearest


def _queue_wall(passage: JunctionPassage, ego: EgoOnRoute, queue_end_s: float) -> float | None:
    """Stay before the line while the queue behind the junction leaves no room for the ego."""
    stop = passage.stop_s - cfg.STOP_MARGIN_M
    length = ego.front_s - ego.rear_s
    crossed = any(not f.pedestrian for f in passage.foes)
    full = passage.stop_s < queue_end_s < passage.exit_s + length + cfg.MINIMUM_GAP_M
    if crossed and full and ego.front_s <= passage.stop_s and ego.stops_within(stop, cfg.BRAKING_MPS2):
        return stop
    return None


def _yield_walls(situation: Situation, matches: FoeMatches, foes: list[int]) -> Iterator[float]:
    """Yield the waiting places of one junction that it must stop at."""
    route, ego = situation.route, situation.ego
    ahead = [i for i in foes if ego.front_s < matches.foes[i].foe.conflict_s[0] + cfg.STOP_MARGIN_M]
    if not matches.on[:, ahead].any():
        return
    arrival = _Arrival(route, ego, max(matches.foes[i].foe.conflict_s[1] for i in ahead))
    for zone in _zones(matches, ahead, ego.front_s - ego.rear_s):
        if not _must_wait(situation, matches, zone, arrival):
            continue
        braking = ego.strongest_braking_mps2 if zone.foe.foe.pedestrian else cfg.YIELD_BRAKING_MPS2
        for place in (zone.wait_s, zone.last_wait_s):
            if ego.front_s <= place + cfg.STOP_MARGIN_M and ego.stops_within(place + cfg.STOP_MARGIN_M, braking):
                yield max(place, ego.front_s) if ego.state.speed_mps < STANDS_MPS else place
                break


def _zones(matches: FoeMatches, which: list[int], length_m: float) -> list[Zone]:
    """Order the conflicts along the route; those without room to stand in between share the first's waiting place."""
    zones: list[Zone] = []
    wait, last = -np.inf, -np.inf
    for i in sorted(which, key=lambda k: matches.foes[k].foe.conflict_s):
        first, until = matches.foes[i].foe.conflict_s
        if first - last > length_m + cfg.YIELD_MARGIN_M:
            wait = first - cfg.YIELD_MARGIN_M
        last = max(last, until)
        zones.append(Zone(i, matches.foes[i], first, until, wait, first - cfg.YIELD_MARGIN_M))
    return zones


class _Arrival:
    """When its front bumper would be where, if nothing held it up: comfortable acceleration, the speed profile."""

    def __init__(self, route: Route, ego: EgoOnRoute, last_s: float) -> None:
        self._first_s, length = ego.front_s, ego.front_s - ego.rear_s
        end_s = last_s + length + 2 * PROFILE_STEP_M
        speed, top = ego.state.speed_mps, cfg.ACCELERATION_MPS2
        profile, origin_s = route.profile, route.origin_s
        self._times, self.limit_mps = _arrivals(profile, origin_s, GRID_M, ego.front_s, end_s, length / 2, speed, top)

    def at(self, s: float) -> float:
        """Return the time until the front is at `s`."""
        return _arrives(self._times, self._first_s, s)


def _must_wait(situation: Situation, matches: FoeMatches, zone: Zone, arrival: _Arrival) -> bool:
    """Tell whether somebody with priority is, or will be, in the conflict zone when the ego would be."""
    ego, half_length = situation.ego, situation.actors.half_length
    who = np.flatnonzero(matches.on[:, zone.index]).tolist()
    if not who:
        return False
    enters, leaves = arrival.at(zone.first_s), arrival.at(zone.until_s + ego.front_s - ego.rear_s)
    starting = zone.wait_s - ego.front_s > cfg.AT_WAIT_M
    for a in who:
        s, speed, half = matches.s.item(a, zone.index), matches.speed.item(a, zone.index), half_length.item(a)
        if zone.foe.foe.pedestrian:
            window = _walker_window(zone.foe, s, speed)
        else:
            window = _vehicle_window(
                zone.foe, s - half, s + half, speed, starting=starting, limit_mps=arrival.limit_mps
            )
        if window is None:
            continue
        if leaves + cfg.YIELD_BEFORE_S > window[0] and enters < window[1] + cfg.YIELD_AFTER_S:
            return True
    return False


def _walker_window(foe: FoePath, s: float, speed: float) -> tuple[float, float] | None:
    """Return when somebody on a crossing is on (or about to step on) the ego's lane; None for never."""
    first, last = foe.foe.conflict_path_s
    first, last = first - cfg.PEDESTRIAN_AIR_M, last + cfg.PEDESTRIAN_AIR_M
    if speed < 0:  # walking against the path's direction: mirror
        s, first, last, speed = -s, -last, -first, -speed
    if s >= last:
        return None
    if speed < cfg.COAST_MPS:
        on_lane = first + cfg.PEDESTRIAN_AIR_M < s < last - cfg.PEDESTRIAN_AIR_M
        return (0.0, np.inf) if on_lane else None
    return max(first - s, 0.0) / speed, (last - s) / speed


def _vehicle_window(
    foe: FoePath, rear_s: float, front_s: float, speed: float, *, starting: bool, limit_mps: float
) -> tuple[float, float] | None:
    """Return when a vehicle is in the conflict zone; None for never.

    Arrival is reckoned with acceleration to the limit where it is slower; leaving with its present speed.
    """
    first, last = foe.foe.conflict_path_s
    if rear_s >= last:
        return None
    room = max(first - front_s, 0.0)
    if speed < STANDS_MPS:
        return (math.sqrt(2 * room / cfg.FOE_ACCELERATION_MPS2), np.inf) if starting else None
    top = max(speed, limit_mps)
    reach_top_s = (top - speed) / cfg.FOE_ACCELERATION_MPS2
    reach_top_m = (top + speed) / 2 * reach_top_s
    if room > reach_top_m:
        arrives = reach_top_s + (room - reach_top_m) / top
    else:
        arrives = (math.sqrt(speed**2 + 2 * cfg.FOE_ACCELERATION_MPS2 * room) - speed) / cfg.FOE_ACCELERATION_MPS2
    return float(arrives), (last - rear_s) / speed


@compiled(FLOATS, *(FLOAT,) * 7)
def _arrivals(
    profile: FloatArray,
    origin_s: float,
    grid_m: float,
    first_s: float,
    end_s: float,
    back_m: float,
    speed: float,
    top_mps2: float,
) -> tuple[FloatArray, float]:
    """Return the times at places from `first_s` on, `PROFILE_STEP_M` apart, and the most that the profile allows.

    The profile counts for the middle of the car, `back_m` behind its front.
    """
    step = (first_s + PROFILE_STEP_M) - first_s  # as numpy's arange has it
    times = np.zeros(int(np.ceil((end_s - first_s) / PROFILE_STEP_M)))
    limit, last = 0.0, 0.0
    for i in range(len(times)):
        s = first_s + i * step
        place = min(max((s - back_m - origin_s) * (1.0 / grid_m), 0.0), len(profile) - 1.001)
        k = max(int(place), 0)
        most = profile[k] + (place - k) * (profile[k + 1] - profile[k])
        v = min(most, math.sqrt(speed**2 + 2 * top_mps2 * (s - first_s)))
        limit = max(limit, most)
        if i > 0:
            times[i] = times[i - 1] + 2 * PROFILE_STEP_M / max(v + last, 1e-3)
        last = v
    return times, limit


@compiled(FLOATS, FLOAT, FLOAT)
def _arrives(times: FloatArray, first_s: float, s: float) -> float:
    """Interpolate between times at places from `first_s` on."""
    step = (first_s + PROFILE_STEP_M) - first_s
    k = min(max(int((s - first_s) / step), 0), len(times) - 2)
    here = first_s + k * step
    slope = (times[k + 1] - times[k]) / (first_s + (k + 1) * step - here)
    time_s: float = min(max(slope * (s - here) + times[k], 0.0), times[-1])
    return time_s
