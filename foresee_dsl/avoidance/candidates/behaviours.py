"""The changed behaviours that are tried on an actor of a run (candidates), with the bounds of their strength.

A candidate is one actor of a run with one changed behaviour. Strengths stay within observed human behaviour. One is
drawn from each of several equal parts of the range, so that a few candidates cover it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import assert_never

import numpy as np
from numpy.random import Generator

from foresee_dsl.avoidance.candidates.recorded import RecordedRun
from foresee_dsl.forecast.settings import VEHICLE_KINDS
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.constants import COMFORTABLE_MPS2, GRAVITY_MPS2
from foresee_dsl.kernels.what_if import WhatIf
from foresee_dsl.simulate.results.criticality import SAME_WAY_RAD
from foresee_dsl.simulate.trace import SPEED, STEP_S, YAW_RATE, ActorInfo


class Kind(StrEnum):
    """The kinds of changed behaviour, each with its name in a mutant's `origin`."""

    LATE = "late_start"
    EARLY = "early_start"
    PACE = "pace"
    HESITATES = "hesitates"
    BRAKES = "hard_braking"
    HALTS = "stops_after_turn"
    DRIFTS = "drifts"
    CUTS_IN = "cuts_in"
    SWERVES = "swerves"
    RUNS_LIGHT = "runs_light"
    TAKES_WAY = "takes_right_of_way"


@dataclass(frozen=True, slots=True)
class CarefulSettings:
    """Bounds of the behaviours, and limits of the moments and actors that are examined.

    Attributes:
        late_s: how much later it starts. A pedestrian's start-up time is 1.9 s in the mean and 3.1 s for 15 % (younger;
            older people 2.5 s and 3.8 s), Knoblauch et al. 1996, Transportation Research Record 1538.
        early_s: how much earlier it starts. Ours: the range of the operator `head_start`.
        walker_pace: walking speed as a ratio. 15 % of older people walk 0.97 m/s, younger ones 1.5 m/s in the mean
            (Knoblauch et al. 1996); people can walk with 2.5 m/s.
        vehicle_pace: speed of vehicles and bicycles as a ratio. Ours: the range of the operator `timing`.
        hesitates_mps2, hesitates_s: how a walker slows down on the way, and for how long. Ours: from 1.4 m/s to a
            stand within one or two paces, and as long as a start-up time.
        brakes_mps2: braking of a vehicle. From the 3.4 m/s^2 that most drivers are comfortable with (AASHTO, A
            Policy on Geometric Design, 3.2.2) to 0.75 g; near-crashes of the 100-car study begin at 0.5 to 0.6 g
            (Dingus et al. 2006, DOT HS 810 593).
        brakes_s: how long it brakes. Ours: from 30 km/h until it crawls, or until it has stood for a moment.
        halts_mps2, halts_s: braking and standing time of a stop after a turn (a driver looks for a place to park).
            Ours: comfortable braking.
        turned_rad: change of heading within `turned_s` that counts as a turn. Ours: 40 deg.
        drifts_m: how far it drifts off its line. Ours: from half of a bicycle's width to half a car's width beyond a
            lane of 3.3 m; in-lane wandering has a standard deviation of 0.2 m to 0.35 m.
        drifts_mps: lateral speed. Ours. drifts_for_s: how long it stays there. Ours.
        cuts_in_m: lateral distance to the ego's way of an actor that can cut in. Ours: a lane's width.
            cuts_in_share: share of that distance that it covers. Ours. cuts_in_mps: lateral speed; lane changes take 3
                s to 6 s; hurried ones 2 s.
        swerve_g, swerve_s, swerve_least_mps: largest lateral acceleration, duration and least speed of a swerve. Ours:
            the values of the operator `steer` in the preset `focused`.
        yields_share, drives_share: an actor yields if it falls below the first share of its cruise speed; it begins to
            yield when it was last above the second share of its speed. Ours.
        late_light_s: longest time from the beginning of braking for a light to running it. Ours: red lights are run
            within 2 s of their beginning by 85 % (33,547 citations in Virginia, Virginia Transportation Research
            Council 2005) to 95 % (Bonneson and Zimmerman 2004); amber lasts 3 s, of which it has seen some.
        ahead_m: distance within which an actor ahead in its lane would hold it up. Ours.
        onset_s, onsets: longest time from the onset of a timed behaviour to the moment of the point; number of onsets.
        draws: number of strengths per behaviour.
        reach_m: smallest distance to the ego in the window above which an actor is not examined. Ours: the stopping
            distance from 50 km/h, 28 m (R157's braking after a second), and a little.
    """

    late_s: tuple[float, float] = (0.2, 3.0)
    early_s: tuple[float, float] = (0.2, 1.0)
    walker_pace: tuple[float, float] = (0.6, 1.5)
    vehicle_pace: tuple[float, float] = (0.6, 1.4)
    hesitates_mps2: tuple[float, float] = (1.0, 2.0)
    hesitates_s: tuple[float, float] = (1.0, 3.0)
    brakes_mps2: tuple[float, float] = (COMFORTABLE_MPS2, 7.4)
    brakes_s: tuple[float, float] = (1.0, 3.0)
    halts_mps2: tuple[float, float] = (2.0, 3.5)
    halts_s: tuple[float, float] = (3.0, 6.0)
    turned_rad: float = math.radians(40)
    turned_s: float = 5.0
    drifts_m: tuple[float, float] = (0.3, 1.0)
    drifts_mps: float = 0.6
    drifts_for_s: float = 3.0
    cuts_in_m: tuple[float, float] = (2.0, 4.5)
    cuts_in_share: tuple[float, float] = (0.7, 1.0)
    cuts_in_mps: float = 1.0
    swerve_g: float = 0.3
    swerve_s: float = 1.0
    swerve_least_mps: float = 2.0
    yields_share: float = 0.3
    drives_share: float = 0.9
    late_light_s: float = 4.0
    ahead_m: float = 15.0
    onset_s: float = 4.0
    onsets: int = 6
    draws: int = 10
    reach_m: float = 30.0


@dataclass(frozen=True, slots=True)
class Candidate:
    """One actor with one changed behaviour.

    Attributes:
        what: the change for the kernel's roll-out. strength: in the unit of the kind. at_s, for_s: onset since the
            window's beginning, and duration, of a timed behaviour.
    """

    kind: Kind
    actor: str
    strength: float
    what: WhatIf
    at_s: float | None = None
    for_s: float | None = None

    def is_like(self, other: Candidate) -> bool:
        """Return whether another candidate concerns the same actor and has the same kind."""
        return self.actor == other.actor and self.kind is other.kind

    @property
    def sentence(self) -> str:
        """The behaviour in words."""
        value = self.strength
        match self.kind:
            case Kind.LATE:
                what = f"starts {value:.1f} s later"
            case Kind.EARLY:
                what = f"is {value:.1f} m further on its way"
            case Kind.PACE:
                what = f"is {value:.2f} times as fast"
            case Kind.HESITATES:
                what = f"hesitates for {self.for_s:.1f} s"
            case Kind.BRAKES:
                what = f"brakes with {value:.1f} m/s^2"
            case Kind.HALTS:
                what = "stops after the turn"
            case Kind.DRIFTS:
                what = f"drifts {abs(value):.1f} m to the {_side(value)}"
            case Kind.CUTS_IN:
                what = f"cuts in from the {_side(-value)}"
            case Kind.SWERVES:
                what = f"swerves to the {_side(value)}"
            case Kind.RUNS_LIGHT:
                what = "runs the light"
            case Kind.TAKES_WAY:
                what = "takes the right of way"
            case _:
                assert_never(self.kind)
        return f"{self.actor} {what}"


def _side(left: float) -> str:
    return "left" if left > 0 else "right"


class Behaviours:
    """Makes the candidates of a window of a run.

    Args:
        frame: the moment of the risky point. rng: draws the strengths.
    """

    def __init__(
        self, run: RecordedRun, first: int, last: int, frame: int, settings: CarefulSettings, rng: Generator
    ) -> None:
        self._run, self._first, self._last, self._settings, self._rng = run, first, last, settings, rng
        self._moment_s = (frame - first) * STEP_S

    def of(self, actor: int) -> Iterator[Candidate]:
        """Yield the candidates (changed behaviours) of one actor."""
        info = self._run.trace.actors[actor]
        if info.path:
            yield from self._on_path(actor, info)
        elif info.kind in VEHICLE_KINDS and info.route:
            yield from self._on_lane(actor, info)

    def _on_path(self, actor: int, info: ActorInfo) -> Iterator[Candidate]:
        s, stands = self._settings, self._run.mps(actor, self._first) <= 0.1
        if stands or info.kind == "pedestrian":
            for late in self._draws(s.late_s):
                yield self._candidate(Kind.LATE, actor, late, delay=late)
        if not stands:
            along = self._run.trace.along[self._first : self._last, actor]
            for early in self._draws(s.early_s):
                frame = min(round(early / STEP_S), len(along) - 1)
                ahead = float(along[frame] - along[0])
                if ahead >= 0.2:
                    yield self._candidate(Kind.EARLY, actor, ahead, ahead=ahead)
        yield from self._paces(actor, info)
        if info.kind == "pedestrian":
            yield from self._slows(Kind.HESITATES, actor, (s.hesitates_mps2, s.hesitates_s), 0.5)
        elif info.id in self._run.trace.on_tracks and info.kind in VEHICLE_KINDS:
            yield from self._slows(Kind.BRAKES, actor, (s.brakes_mps2, s.brakes_s), s.swerve_least_mps)
        for left in self._either(s.drifts_m):
            yield self._candidate(Kind.DRIFTS, actor, left, left=left, left_at=0.0, left_for=math.inf, left_rate=1.0)

    def _slows(
        self, kind: Kind, actor: int, bounds: tuple[tuple[float, float], tuple[float, float]], least_mps: float
    ) -> Iterator[Candidate]:
        """Yield the candidates of an actor that slows down on its path. `bounds`: of its braking (m/s^2) and time (s);
        `least_mps`: the speed that it must have."""
        for at in self._onsets():
            for strength, long in zip(self._draws(bounds[0], 3), self._draws(bounds[1], 3), strict=True):
                if self._moves(actor, at, least_mps):
                    yield self._candidate(kind, actor, strength, at, long, braking=strength)

    def _on_lane(self, actor: int, info: ActorInfo) -> Iterator[Candidate]:
        s = self._settings
        yield from self._paces(actor, info)
        yield from self._goes(actor, info)
        for at in self._onsets():
            if not self._moves(actor, at, s.swerve_least_mps):
                continue
            turned = self._turned(actor, at)
            for strength, long in zip(self._draws(s.brakes_mps2, 3), self._draws(s.brakes_s, 3), strict=True):
                yield self._candidate(Kind.BRAKES, actor, strength, at, long, braking=strength)
            if turned:
                for strength, long in zip(self._draws(s.halts_mps2, 2), self._draws(s.halts_s, 2), strict=True):
                    yield self._candidate(Kind.HALTS, actor, strength, at, long, braking=strength)
            beside = self._beside(actor, at)
            for left in np.copysign(self._draws(s.drifts_m, 3), beside):
                yield self._candidate(Kind.DRIFTS, actor, left, at, s.drifts_for_s, left=left, left_at=at,
                                 left_for=s.drifts_for_s, left_rate=s.drifts_mps)  # fmt: skip
            if info.kind != "bicycle" and s.cuts_in_m[0] <= abs(beside) <= s.cuts_in_m[1] and self._along(actor, at):
                for left in np.round(beside * self._draws(s.cuts_in_share, 2), 2):
                    yield self._candidate(Kind.CUTS_IN, actor, left, at, 10.0, left=left, left_at=at, left_for=10.0,
                                     left_rate=s.cuts_in_mps)  # fmt: skip
            yield from self._swerves(actor, info, at)

    def _goes(self, actor: int, info: ActorInfo) -> Iterator[Candidate]:
        """Yield the candidate of an actor that drives on instead of slowing for a light or for others."""
        s, run = self._settings, self._run
        speeds = np.nan_to_num(run.trace.states[self._first : self._last + 1, actor, SPEED])
        slow = np.flatnonzero(speeds < s.yields_share * info.cruise_mps)
        if not len(slow) or slow[0] * STEP_S > self._moment_s + s.onset_s or not self._is_first(actor, int(slow[0])):
            return
        fast = np.flatnonzero(speeds[: slow[0]] >= s.drives_share * speeds[: slow[0]].max(initial=np.inf))
        if not len(fast) or speeds[fast[-1]] < s.swerve_least_mps:
            return
        junction = self._junction(actor, int(slow[0]))
        kind = Kind.RUNS_LIGHT if junction in run.trace.signals else Kind.TAKES_WAY
        if junction and (kind is Kind.TAKES_WAY or (slow[0] - fast[-1]) * STEP_S <= s.late_light_s):
            yield self._candidate(kind, actor, 0.0, goes_at=float(fast[-1] * STEP_S))

    def _is_first(self, actor: int, since: int) -> bool:
        """Return whether no other actor is ahead of this one in its lane within `ahead_m`."""
        run, frame = self._run, self._first + since
        x, y, heading, _ = run.tracks[actor, frame]
        away = run.tracks[1:, frame, :2] - (x, y)
        ahead = away[:, 0] * math.cos(heading) + away[:, 1] * math.sin(heading)
        aside = np.abs(away[:, 1] * math.cos(heading) - away[:, 0] * math.sin(heading))
        return not bool(((ahead > 0.5) & (ahead < self._settings.ahead_m) & (aside < 1.0)).any())

    def _junction(self, actor: int, since: int) -> str:
        """Return the next junction of an actor after a frame; if it has none, that of the ego; "" if the ego has none
        either.
        """
        trace = self._run.trace
        for column in (actor, 0):
            for lane in trace.lanes[self._first + since :, column]:
                name = trace.lane_ids[lane] if lane >= 0 else ""
                if name.startswith(":"):
                    return name[1:].rpartition("_")[0].rpartition("_")[0]
        return ""

    def _paces(self, actor: int, info: ActorInfo) -> Iterator[Candidate]:
        s = self._settings
        bounds = s.walker_pace if info.kind == "pedestrian" else s.vehicle_pace
        for pace in self._draws(bounds, 2 * s.draws):
            if abs(pace - 1) >= 0.05:
                yield self._candidate(Kind.PACE, actor, pace, pace=pace)

    def _swerves(self, actor: int, info: ActorInfo, at: float) -> Iterator[Candidate]:
        s, frame = self._settings, self._first + round(at / STEP_S)
        speed = self._run.mps(actor, frame)
        if info.wheelbase_m <= 0:
            return
        most = s.swerve_g * GRAVITY_MPS2 / speed**2
        for share in self._either((0.3, 1.0), 2):
            yield self._candidate(Kind.SWERVES, actor, share * most, at, s.swerve_s, turn=share * most, turn_at=at,
                             turn_for=s.swerve_s)  # fmt: skip

    def _candidate(
        self, kind: Kind, actor: int, strength: float, at: float | None = None, long: float | None = None,
        **changed: float,
    ) -> Candidate:  # fmt: skip
        info = self._run.trace.actors[actor]
        timed = {} if "braking" not in changed or at is None or long is None else {"brakes_at": at, "brakes_for": long}
        size = info.length_m, info.width_m
        what = WhatIf(actor, self._first, self._last, *size, info.cruise_mps, **changed | timed)
        return Candidate(kind, info.id, strength, what, at, long)

    def _draws(self, bounds: tuple[float, float], count: int | None = None) -> FloatArray:
        """Draw one strength from each of `count` equal parts of a range, with two decimals."""
        count = count or self._settings.draws
        shares = (np.arange(count) + self._rng.random(count)) / count
        return np.round(bounds[0] + shares * (bounds[1] - bounds[0]), 2)

    def _either(self, bounds: tuple[float, float], count: int | None = None) -> FloatArray:
        strengths = self._draws(bounds, count)
        return np.concatenate([strengths, -strengths])

    def _onsets(self) -> FloatArray:
        s = self._settings
        return np.round(np.unique(np.maximum(self._moment_s - self._draws((0.0, s.onset_s), s.onsets), 0.1)), 1)

    def _moves(self, actor: int, at: float, least: float = 0.5) -> bool:
        frame = self._first + round(at / STEP_S)
        return frame < self._run.trace.frames and self._run.mps(actor, frame) >= least

    def _beside(self, actor: int, at: float) -> float:
        """Return the lateral distance from an actor to the ego's path, m.

        Positive if the path is to the actor's left.
        """
        x, y, heading, _ = self._run.tracks[actor, self._first + round(at / STEP_S)]
        way = self._run.tracks[0, self._first : self._last + 1, :2] - (x, y)
        dx, dy = way[int(np.hypot(*way.T).argmin())]
        return float(dy * math.cos(heading) - dx * math.sin(heading))

    def _along(self, actor: int, at: float) -> bool:
        """Return whether an actor drives in the direction in which the ego passes it."""
        x, y, heading, _ = self._run.tracks[actor, self._first + round(at / STEP_S)]
        way = self._run.tracks[0, self._first : self._last + 1]
        passes = way[int(np.hypot(way[:, 0] - x, way[:, 1] - y).argmin()), 2]
        return math.cos(passes - heading) > math.cos(SAME_WAY_RAD)

    def _turned(self, actor: int, at: float) -> bool:
        """Return whether an actor has just completed a turn and drives straight on."""
        frame, s = self._first + round(at / STEP_S), self._settings
        since = max(0, frame - round(s.turned_s / STEP_S))
        track = self._run.tracks[actor]
        return bool(
            abs(track[frame, 2] - track[since, 2]) >= s.turned_rad
            and abs(np.nan_to_num(self._run.trace.states[frame, actor, YAW_RATE])) < 0.2
        )
