"""Our operators (timing, delay, head start, line, style), which the paper does not have; and the paper's heavy
weather (RQ5).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.random import Generator

from foresee_dsl.compile.bundle import STYLES, DrivingStyle
from foresee_dsl.compile.placement.paths import LINE_OVER_M
from foresee_dsl.compile.roads.polyline import Polyline
from foresee_dsl.derive.operators.situation import (
    ActorsRun,
    BuiltIn,
    Numeric,
    Situation,
    is_free,
    multiples,
)
from foresee_dsl.derive.presets import HeadStartSettings, MutationPreset
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.kernels.sumo_traffic import SIDEWAYS_MPS, SIDEWAYS_SHARE
from foresee_dsl.language.model import Change, Quantity, Style
from foresee_dsl.language.model.derived import USUAL
from foresee_dsl.simulate.trace import SPEED, STEP_S


class Shift(Numeric):
    """An operator that keeps an actor's recorded track but changes when it passes each place, or that moves the track
    to one side.
    """

    @abstractmethod
    def tracks(self, boxes: FloatArray, shifts: FloatArray, run: ActorsRun) -> FloatArray:
        """Return a recorded track ([T, 5] footprints) with each of N shifts (see `shifts`), without a simulation:
        [N, T, 5]."""

    def rolled_out(self, boxes: FloatArray, change: Change, run: ActorsRun) -> FloatArray:
        """Return the track with a change of the property."""
        if not isinstance(change.now, Quantity) or not isinstance(change.was, Quantity):
            raise TypeError(f"the value of {change.actor}.{change.property} must be a quantity")
        rolled: FloatArray = self.tracks(boxes, self.shifts(np.array([change.now.si]), change.was.si), run)[0]
        return rolled

    def shifts(self, values: FloatArray, was: float) -> FloatArray:
        """Return what new values (SI) of the property change in a track that was recorded with the value `was`."""
        return values - was


class TimingShift(Shift):
    """Scales an actor's speed along its own path; the actor still stops where it must."""

    name = property = "timing"

    def values(self, situation: Situation, target: str, preset: MutationPreset) -> Sequence[float]:
        """Return the factors at which the model does not exceed its maximum speed."""
        settings = preset.timing
        if situation.driven_m(target) < settings.least_way_m:
            return ()
        fastest = float(np.nanmax(situation.trace.states[:, situation.columns[target], SPEED]))
        high = min(settings.high, situation.spec(target).max_speed_mps / max(fastest, STANDS_MPS))
        return multiples(settings.low, high, settings.step, centre=1.0, dead=settings.least_change)

    def tracks(self, boxes: FloatArray, shifts: FloatArray, run: ActorsRun) -> FloatArray:
        """Return the recorded track, followed faster or slower."""
        del run
        return retimed(boxes, factor=shifts)

    def shifts(self, values: FloatArray, was: float) -> FloatArray:
        """Return the factors by which the recorded track is followed faster."""
        return values / was


class DelayShift(Shift):
    """Makes a path-follower stand longer, or less long, before it moves.

    It is only for actors that can stop at once: pedestrians, and cyclists that stand at the clip's beginning.
    """

    name = property = "delay"

    def values(self, situation: Situation, target: str, preset: MutationPreset) -> Sequence[float]:
        """Return the allowed delays, which lie around the present delay."""
        settings, was = preset.delay, situation.present_value(target, self.property)
        stops = situation.speed_mps(target, 0) <= STANDS_MPS or situation.kind(target) == "pedestrian"
        if was is None or not stops or not _moves_on_path(situation, target, preset):
            return ()
        shifts = multiples(-was.si, settings.high_s, settings.step_s, centre=0.0, dead=settings.low_s)
        return [was.si + shift for shift in shifts]

    def tracks(self, boxes: FloatArray, shifts: FloatArray, run: ActorsRun) -> FloatArray:
        """Return the recorded track, followed later."""
        del run
        return retimed(boxes, delay_s=shifts)


class HeadStart(Shift):
    """Puts a moving path-follower further along its path at the beginning, as if it had started earlier.

    The actor begins at a place where it was a little later in the unmutated run, so never beyond a place where it
    waits.
    """

    name, property = "head_start", "moving"

    def values(self, situation: Situation, target: str, preset: MutationPreset) -> Sequence[float]:
        """Return the places on the target's path where it touches no other actor at the beginning, m."""
        was = situation.present_value(target, self.property)
        moves = situation.speed_mps(target, 0) > STANDS_MPS
        if was is None or not moves or not _moves_on_path(situation, target, preset):
            return ()
        places, settings = situation.head_starts, preset.head_start
        if (target, settings) not in places:  # a view that is shared by all draws, which do not change it
            places[target, settings] = tuple(self._places(situation, target, was.si, settings))
        return places[target, settings]

    def tracks(self, boxes: FloatArray, shifts: FloatArray, run: ActorsRun) -> FloatArray:
        """Return the recorded track, begun further along."""
        del run
        return retimed(boxes, ahead_m=shifts)

    @staticmethod
    def _places(situation: Situation, target: str, along_m: float, settings: HeadStartSettings) -> list[float]:
        """Return the target's later places on its path, m, without those that another actor occupies at the
        beginning."""
        trace, column = situation.trace, situation.columns[target]
        info = trace.actors[column]
        line = Polyline.of(info.path)
        places: list[float] = []
        for frame in range(round(settings.low_s / STEP_S), min(round(settings.high_s / STEP_S) + 1, trace.frames)):
            along = trace.along[frame, column]
            if np.isnan(along):  # the actor has left by then
                continue
            place = Quantity.of(float(along), "length", 2).si
            box = np.array([*line.at(place), info.length_m, info.width_m])
            if place - along_m >= settings.least_m and is_free(trace, column, 0, box) and place not in places:
                places.append(place)
        return places


class LineShift(Shift):
    """Moves a path-follower or a bicycle to a line beside its own.

    It is not for cars and larger vehicles, which nearly fill their lanes; `steer` takes them out of the lane.
    """

    name = property = "line"

    def values(self, situation: Situation, target: str, preset: MutationPreset) -> Sequence[float]:
        """Return the allowed offsets to the left of the target's own line, m (negative: to the right)."""
        settings, was = preset.line, situation.present_value(target, self.property)
        rides = situation.kind(target) == "bicycle" and situation.on_lanes(target)
        if was is None or not (situation.follows_path(target) or rides):
            return ()
        if situation.driven_m(target) < preset.timing.least_way_m:
            return ()
        shifts = multiples(-settings.high_m, settings.high_m, settings.step_m, centre=0.0, dead=settings.least_m)
        return [was.si + shift for shift in shifts]

    def tracks(self, boxes: FloatArray, shifts: FloatArray, run: ActorsRun) -> FloatArray:
        """Return the track, moved sideways as the simulation does it: on a path over some metres, on a lane at a fixed
        rate.
        """
        left_m, speed = shifts[:, None], np.nan_to_num(run.trace.states[:, run.actor, SPEED])
        if run.trace.actors[run.actor].path:
            share = np.cumsum(speed) * STEP_S / LINE_OVER_M
        else:
            sideways = np.cumsum(np.minimum(SIDEWAYS_MPS, SIDEWAYS_SHARE * speed)) * STEP_S
            share = sideways / np.abs(np.where(left_m == 0, 1.0, left_m))
        left = left_m * np.minimum(share, 1.0)
        changed = np.repeat(boxes[None], len(shifts), axis=0)
        changed[:, :, 0] -= left * np.sin(boxes[:, 2])
        changed[:, :, 1] += left * np.cos(boxes[:, 2])
        return changed


class StyleChange(BuiltIn):
    """Another driving style of a vehicle or bicycle that SUMO drives along lanes; it obeys all rules, as before.

    The roll-out models only the slower acceleration of `creeps`, because the effect of any other style depends on the
    ego.
    """

    name = property = "style"

    def changes(self, situation: Situation, target: str, preset: MutationPreset, rng: Generator) -> tuple[Change, ...]:
        """Draw one of the other styles."""
        if not situation.on_lanes(target) or situation.driven_m(target) < preset.timing.least_way_m:
            return ()
        body = situation.actors[target].body
        was = next((item.manner for item in body if isinstance(item, Style)), USUAL)
        others = [name for name in (USUAL, *STYLES) if name != was]
        now = others[int(rng.integers(len(others)))]
        return (Change(actor=target, property=self.property, was=was, now=now),)

    def rolled_out(self, boxes: FloatArray, change: Change, run: ActorsRun) -> FloatArray:
        """Let an actor that creeps fall behind on its track wherever it accelerated more."""
        style = STYLES.get(str(change.now), DrivingStyle())
        if style.acceleration_mps2 is None:
            return boxes
        track = boxes[~np.isnan(boxes[:, 0])]
        if len(track) < 2:
            return boxes
        slower = np.nan_to_num(run.trace.states[:, run.actor, SPEED])
        for frame in range(1, len(slower)):
            slower[frame] = min(slower[frame], slower[frame - 1] + style.acceleration_mps2 * STEP_S)
        rolled: FloatArray = _at(track, _along(track), np.r_[0.0, np.cumsum(slower[1:]) * STEP_S][None])[0]
        return rolled


def _moves_on_path(situation: Situation, target: str, preset: MutationPreset) -> bool:
    return situation.follows_path(target) and situation.driven_m(target) >= preset.timing.least_way_m


_NO, _ONCE = np.zeros(1), np.ones(1)


def retimed(
    boxes: FloatArray, *, factor: FloatArray = _ONCE, delay_s: FloatArray = _NO, ahead_m: FloatArray = _NO
) -> FloatArray:
    """Return a track that is followed `factor` times as fast, `delay_s` later and `ahead_m` further on; it continues
    straight at its end.

    One of the arguments has N values, one per change; the result is [N, T, 5].
    """
    track = boxes[~np.isnan(boxes[:, 0])]
    count = max(len(factor), len(delay_s), len(ahead_m))
    if len(track) < 2:
        return np.repeat(boxes[None], count, axis=0)
    along = _along(track)
    time_s = np.arange(len(boxes)) * STEP_S
    later_s = np.maximum(time_s - delay_s[:, None], 0.0)
    present_s = time_s[~np.isnan(boxes[:, 0])]
    return _at(track, along, ahead_m[:, None] + factor[:, None] * np.interp(later_s, present_s, along))


def _along(track: FloatArray) -> FloatArray:
    """Return the length along a track ([T, 5]) at each frame, m."""
    along: FloatArray = np.r_[0.0, np.cumsum(np.hypot(*np.diff(track[:, :2], axis=0).T))]
    return along


def _at(track: FloatArray, along: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the footprints at lengths along a track: `wanted` is [N, T], m; the result [N, T, 5]."""
    track[:, 2] = np.unwrap(track[:, 2])
    # np.interp needs increasing places. An actor that stands repeats its place, so a little is added at each step.
    marks = along + np.arange(len(along)) * 1e-9
    beyond = np.maximum(wanted - along[-1], 0.0)
    changed = np.stack([np.interp(wanted, marks, column) for column in track.T], axis=2)
    changed[:, :, 0] += beyond * np.cos(changed[:, :, 2])
    changed[:, :, 1] += beyond * np.sin(changed[:, :, 2])
    return changed


HEAVY: Mapping[str, float] = MappingProxyType({"rain": 1.0, "fog": 0.5, "wetness": 1.0})
"""The values of heavy weather. The paper names high fog density, wetness and precipitation, and a sun at 45 degrees,
which does not dazzle. Ours: the largest rain and wetness, and fog with a visibility of 100 m."""


class HeavyWeather(BuiltIn):
    """Sets the largest rain and wetness, and fog; nothing is drawn at random."""

    name, property = "heavy_weather", "weather"

    def changes(self, situation: Situation, target: str, preset: MutationPreset, rng: Generator) -> tuple[Change, ...]:
        """Return the changes of rain, fog and wetness that are below `HEAVY`."""
        del target, preset, rng
        return tuple(
            Change(actor="weather", property=name, was=situation.weather[name], now=Quantity.of(value, "ratio", 2))
            for name, value in HEAVY.items()
            if situation.weather[name].si < value
        )

    def letter_target(self, situation: Situation) -> str:
        """Return `weather`, which is not an actor."""
        del situation
        return "weather"

    def rolled_out(self, boxes: FloatArray, change: Change, run: ActorsRun) -> FloatArray:
        """Return the track unchanged: the roll-out does not model weather."""
        del change, run
        return boxes
