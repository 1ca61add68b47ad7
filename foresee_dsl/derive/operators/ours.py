"""Our own operators: when an actor is where (pace, later start, head start), and beside which line."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from foresee_dsl.compile.roads.polyline import Polyline
from foresee_dsl.derive.operators.situation import OwnOperator, Situation, drawn
from foresee_dsl.derive.presets import HeadStartSettings, Preset
from foresee_dsl.derive.validity import touches_nobody
from foresee_dsl.language.model import Change, Delay, Line, Quantity, Timing, Walked
from foresee_dsl.simulate.actors.moved_actors import STANDS_MPS
from foresee_dsl.simulate.trace import SPEED, STEP_S


class TimingShift(OwnOperator):
    """Ours: the speed along one's own path, scaled; the actor still stops where it must."""

    name = "timing"

    def changes(self, situation: Situation, target: str, preset: Preset, rng: Generator) -> tuple[Change, ...]:
        """Draw a factor, within what the model can drive."""
        settings = preset.timing
        if situation.way_m(target) < settings.least_way_m:
            return ()
        column = situation.columns[target]
        fastest = float(np.nanmax(situation.trace.states[:, column, SPEED]))
        high = min(settings.high, situation.spec(target).max_speed_mps / max(fastest, STANDS_MPS))
        value = drawn(rng, settings.low, high, settings.step, centre=1.0, dead=settings.least_change)
        if value is None:
            return ()
        timing = situation.stated(target, Timing)
        was = timing.factor if timing and isinstance(timing.factor, Quantity) else Quantity.of(1.0, "ratio", 2)
        return (Change(actor=target, property="timing", was=was, now=Quantity.of(value, "ratio", 2)),)


class DelayShift(OwnOperator):
    """Ours: a path-follower stands longer before it moves, or less long where it was to stand.

    Only for those that can stop on the spot: pedestrians, and cyclists that stand at the clip's beginning.
    """

    name = "delay"

    def changes(self, situation: Situation, target: str, preset: Preset, rng: Generator) -> tuple[Change, ...]:
        """Draw a change of the delay that it has."""
        settings = preset.delay
        stands = situation.speed_mps(target, 0) <= STANDS_MPS
        walks = situation.kind(target) == "pedestrian"
        if not situation.follows_path(target) or not (stands or walks):
            return ()
        if situation.way_m(target) < preset.timing.least_way_m:
            return ()
        delay = situation.stated(target, Delay)
        was = delay.time if delay and isinstance(delay.time, Quantity) else Quantity.of(0.0, "time", 2)
        value = drawn(rng, -was.si, settings.high_s, settings.step_s, centre=0.0, dead=settings.low_s)
        if value is None:
            return ()
        return (Change(actor=target, property="delay", was=was, now=Quantity.of(was.si + value, "time", 2)),)


class HeadStart(OwnOperator):
    """Ours: a path-follower that moves is further along its path at the beginning, as if it had set out earlier.

    It begins where it was a little later in the unmutated run, so never beyond where it waits.
    """

    name = "head_start"

    def changes(self, situation: Situation, target: str, preset: Preset, rng: Generator) -> tuple[Change, ...]:
        """Draw a place on its path at which it touches nobody at the beginning."""
        walked = situation.stated(target, Walked)
        if walked is None or not isinstance(walked.along, Quantity) or not situation.follows_path(target):
            return ()
        if situation.speed_mps(target, 0) <= STANDS_MPS or situation.way_m(target) < preset.timing.least_way_m:
            return ()
        places = self._places(situation, target, walked.along.si, preset.head_start)
        if not places:
            return ()
        return (Change(actor=target, property="moving", was=walked.along, now=places[int(rng.integers(len(places)))]),)

    @staticmethod
    def _places(situation: Situation, target: str, along_m: float, settings: HeadStartSettings) -> list[Quantity]:
        """Return where it is a little later, without the places where somebody else is at the beginning."""
        trace, column = situation.trace, situation.columns[target]
        info = trace.actors[column]
        line = Polyline.of(info.path)
        found = []
        for frame in range(round(settings.low_s / STEP_S), min(round(settings.high_s / STEP_S) + 1, trace.frames)):
            place = Quantity.of(float(trace.along[frame, column]), "length", 2)
            if not place.si - along_m >= settings.least_m:  # NaN: it has gone by then
                continue
            box = np.array([*line.at(place.si), info.length_m, info.width_m])
            if touches_nobody(trace, column, 0, box) and place not in found:
                found.append(place)
        return found


class LineShift(OwnOperator):
    """An actor on a path or a bicycle goes over to a line beside its own.

    Not for cars and the like: in their lanes they have a hand's breadth, and what leaves the lane is `steer`.
    """

    name = "line"

    def changes(self, situation: Situation, target: str, preset: Preset, rng: Generator) -> tuple[Change, ...]:
        """Draw how far to the left of its own way (negative: to the right)."""
        settings = preset.line
        rides = situation.kind(target) == "bicycle" and situation.on_lanes(target)
        if not (situation.follows_path(target) or rides) or situation.way_m(target) < preset.timing.least_way_m:
            return ()
        value = drawn(rng, -settings.high_m, settings.high_m, settings.step_m, centre=0.0, dead=settings.least_m)
        if value is None:
            return ()
        line = situation.stated(target, Line)
        was = line.left if line and isinstance(line.left, Quantity) else Quantity.of(0.0, "length", 2)
        return (Change(actor=target, property="line", was=was, now=Quantity.of(was.si + value, "length", 2)),)
