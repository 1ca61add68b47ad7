"""Faults of the sensors: actors that are not seen, seen late, or seen at a wrong position."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import Any, ClassVar, TypeVar

from foresee_dsl.drivers.parts import DriverPart
from foresee_dsl.drivers.protocol import Mission, Observation, VehicleLimits
from foresee_dsl.kernels.constants import STEP_S
from foresee_dsl.language.model_classes import CLASSES
from foresee_faults.fault import Actors, Fault, Signals, away, moved, relative

T = TypeVar("T")


class Late(Fault):
    """A part of the observation is old."""

    def begin(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Forget the queue."""
        super().begin(mission, vehicle, seed)
        self._queue: deque[tuple[float, Any]] = deque()

    def late(self, part: T, time_s: float, delay_s: float) -> T:
        """Return the newest part that is old enough; without one, the oldest."""
        self._queue.append((time_s, part))
        while len(self._queue) > 1 and self._queue[1][0] <= time_s - delay_s + STEP_S / 2:
            self._queue.popleft()
        old: T = self._queue[0][1]
        return old


class LateObjects(Late):
    """Reacts late: its object list is old, but has a new time stamp."""

    part = DriverPart.PERCEPTION
    cause = "a queue between perception and planning fills up, and time stamps are set when a message is read"
    scale = "0 to 1.2 s"

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Return an old list."""
        return self.late(actors, observation.time_s, self.between(0.0, 1.2))


class LateSignals(Late):
    """Sees a signal's new colour late."""

    part = DriverPart.RULES
    cause = "a filter against flicker votes over too many pictures"
    scale = "0 to 3 s"

    def change_signals(self, signals: Signals, observation: Observation) -> Signals:
        """Return earlier colours; a signal that was not in view then has its current colour."""
        old = self.late(signals, observation.time_s, self.between(0.0, 3.0))
        return {key: old.get(key, colour) for key, colour in signals.items()}


class Blind(Fault):
    """Actors of some classes are seen only when they are near."""

    part = DriverPart.PERCEPTION
    kinds: ClassVar[frozenset[str]]
    range_m: ClassVar[float]
    least_m: ClassVar[float]

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Leave out actors that are too far away."""
        range_m = self.shrinking(self.range_m, self.least_m)
        return tuple(a for a in actors if a.kind not in self.kinds or away(a, observation.ego) <= range_m)


class BlindToWalkers(Blind):
    """Sees pedestrians only when they are near."""

    cause = "the classifier was trained with few of them"
    scale = "within 55 m to 4 m"
    source = "NTSB HAR-19/03 (Tempe: a pedestrian with a bicycle, classified late)"
    kinds, range_m, least_m = frozenset({"pedestrian"}), 55.0, 4.0


class BlindToBicycles(Blind):
    """Sees cyclists only when they are near."""

    cause = "few of them in the training data, or no class of their own"
    scale = "within 60 m to 4 m"
    kinds, range_m, least_m = frozenset({"bicycle"}), 60.0, 4.0


class BlindToMotorcycles(Blind):
    """Sees motorcyclists only when they are near."""

    cause = "narrow: one beam of a radar, few pixels"
    scale = "within 65 m to 4 m"
    kinds, range_m, least_m = frozenset({"motorcycle"}), 65.0, 4.0


class BlindToLorries(Blind):
    """Sees buses and lorries only when they are near."""

    cause = "a long side without contours is taken for background"
    scale = "within 100 m to 6 m (centre to centre)"
    source = "NTSB HWY16FH018 (Williston: the side of a crossing lorry)"
    kinds, range_m, least_m = frozenset({"bus", "truck"}), 100.0, 6.0


class MissesObstacles(Blind):
    """Sees obstacles on the road only when they are near."""

    cause = "what does not move and has no class is filtered out as clutter"
    scale = "within 50 m to 3 m"
    source = "NTSB HWY18FH011 (Mountain View: a crash attenuator)"
    kinds, range_m, least_m = frozenset({"obstacle"}), 50.0, 3.0


class MissesSmall(Fault):
    """Misses actors that appear small: pedestrians and cyclists far away, cars farther away."""

    part = DriverPart.PERCEPTION
    cause = "the detector needs more pixels than the object has"
    scale = "smallest angle at which an actor is seen, 0 to 8 degrees of the larger of length and width"

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Leave out actors that cover too small an angle."""
        least = math.radians(self.between(0.0, 8.0))
        return tuple(a for a in actors if max(a.length_m, a.width_m) >= least * away(a, observation.ego))


class ShortRange(Blind):
    """Sees all actors only when they are near."""

    cause = "dirt or rime on the sensors, a threshold that is too high"
    scale = "within 100 m to 6 m"
    source = "ISO 21448, triggering conditions of sensors"
    kinds = frozenset(CLASSES)
    range_m, least_m = 100.0, 6.0


class BlindSector(Fault):
    """No actor is seen in a sector."""

    part = DriverPart.PERCEPTION
    middle_rad: ClassVar[float]
    half_rad: ClassVar[float] = math.radians(40)

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Leave out actors whose centre is in the sector."""
        half = self.half_rad * self.strength**1.5

        def hidden(ahead_m: float, left_m: float) -> bool:
            return abs(math.remainder(math.atan2(left_m, ahead_m) - self.middle_rad, math.tau)) < half

        return tuple(a for a in actors if not hidden(*relative(a, observation.ego)))


class BlindLeft(BlindSector):
    """Sees no actor in a sector at the front left."""

    cause = "a pillar, a dirty or a failed sensor"
    scale = "0 to 80 degrees wide (with the power 1.5), around 50 degrees left of ahead"
    middle_rad = math.radians(50)


class BlindRight(BlindSector):
    """Sees no actor in a sector at the front right."""

    cause = "a pillar, a dirty or a failed sensor"
    scale = "0 to 80 degrees wide (with the power 1.5), around 50 degrees right of ahead"
    middle_rad = math.radians(-50)


class Misaligned(Fault):
    """Sees all actors rotated to the right around the ego."""

    part = DriverPart.PERCEPTION
    cause = "a sensor was calibrated badly after a repair"
    scale = "0 to 8 degrees"

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Turn all positions clockwise around the ego."""
        angle, ego = -math.radians(self.between(0.0, 8.0)), observation.ego
        if angle == 0:
            return actors
        cos, sin = math.cos(angle), math.sin(angle)

        def place(dx: float, dy: float) -> dict[str, float]:
            return {"x": ego.x + dx * cos - dy * sin, "y": ego.y + dx * sin + dy * cos}

        return tuple(replace(a, heading_rad=a.heading_rad + angle, **place(a.x - ego.x, a.y - ego.y)) for a in actors)


class TooFar(Fault):
    """Sees all actors farther away than they are."""

    part = DriverPart.PERCEPTION
    cause = "distance from the height in the picture, with a wrong pitch or a sloping road"
    scale = "0 to 25 % farther, at most 5 m"

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Move all actors away from the ego."""
        share, ego = self.between(0.0, 0.25), observation.ego
        return tuple(
            moved(a, min(share * away(a, ego), 5.0 * self.strength), math.atan2(a.y - ego.y, a.x - ego.x))
            for a in actors
        )


class LosesInRain(Fault):
    """Loses single objects for seconds, when it rains."""

    part = DriverPart.PERCEPTION
    cause = "spray and drops on the lens"
    scale = "the share of time that each is lost, 0 to 90 %, in pieces of 3 s"
    source = "ISO 21448, triggering conditions of weather"
    piece_s: ClassVar[float] = 3.0

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Leave out actors that are lost now."""
        if self.vehicle.friction >= 0.85:
            return actors
        share, piece = self.between(0.0, 0.9), int(observation.time_s / self.piece_s)
        return tuple(a for a in actors if self.random(a.track, piece).random() >= share)
