"""Faults of tracking and prediction."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar

import numpy as np

from foresee_dsl.drivers.parts import DriverPart
from foresee_dsl.drivers.protocol import FloatArray, Foe, Mission, Observation
from foresee_dsl.drivers.tracking import COAST_S, STANDING_COAST_S, Tracks
from foresee_dsl.kernels.pdm.settings import SENSED_STANDS_MPS
from foresee_faults.fault import Actors, DriverState, Fault, Remembering, relative, turned


class ForgetsHidden(Fault):
    """Forgets hidden actors."""

    part = DriverPart.TRACKING
    cause = "tracks are dropped with the first picture that does not show them"
    scale = "after 1.5 s (4 s of one that stood) to at once"
    source = "NTSB HAR-19/03 (Tempe: the track's history was dropped)"

    def settle(self, state: DriverState) -> None:
        """Give the driver a tracker that drops tracks early."""
        state.tracker = Remembering(self._reported_tracks)

    def _reported_tracks(self, tracks: Tracks) -> Tracks:
        if not self.strength:
            return tracks
        stood = tracks.speed < SENSED_STANDS_MPS
        kept = tracks.lost_s <= (1 - self.strength) * np.where(stood, STANDING_COAST_S, COAST_S)
        return _rows(tracks, np.flatnonzero(kept).tolist())


class MergesNeighbours(Fault):
    """Merges two close objects into the larger one."""

    part = DriverPart.PERCEPTION
    cause = "clusters of points are joined, boxes that overlap in the picture suppress each other"
    scale = "closer than 0 to 5 m, side to side"

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Leave out actors that are close to a larger one."""
        least_m = self.between(0.0, 5.0)

        def joined(small: int) -> bool:
            actor = actors[small]
            return any(
                other.length_m * other.width_m > actor.length_m * actor.width_m
                and _apart(actor.x - other.x, actor.y - other.y, other.heading_rad, other.length_m, other.width_m)
                < least_m
                for other in actors
            )

        return tuple(a for k, a in enumerate(actors) if not (least_m and joined(k)))


class UnderratesSpeed(Fault):
    """Underestimates the speeds of others."""

    part = DriverPart.TRACKING
    cause = "a filter that is too smooth, a radar's speed across the line of sight"
    scale = "by 0 to 80 %"

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Report lower speeds."""
        share = 1 - self.between(0.0, 0.8)
        return tuple(replace(a, speed_mps=a.speed_mps * share) for a in actors)


class SlowIsStanding(Fault):
    """Takes slow actors for standing ones."""

    part = DriverPart.TRACKING
    cause = "a threshold against jitter of parked cars"
    scale = "slower than 0 to 5 m/s"

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Report slow actors as standing."""
        most = self.between(0.0, 5.0)
        return tuple(replace(a, speed_mps=0.0) if a.speed_mps < most else a for a in actors)


class StandingIsLeaving(Fault):
    """Takes a standing vehicle for one that is driving off."""

    part = DriverPart.PREDICTION
    cause = "a prediction that was trained at signals: a standing vehicle will drive"
    scale = "believed speed, 0 to 6 m/s"
    source = "NHTSA 23E-029 (a bus ahead, predicted wrongly)"

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Report that standing vehicles move."""
        speed = self.between(0.0, 6.0)
        still = ("pedestrian", "obstacle")
        return tuple(
            replace(a, speed_mps=max(a.speed_mps, speed))
            if a.speed_mps < SENSED_STANDS_MPS and a.kind not in still
            else a
            for a in actors
        )


class HeadingErrors(Fault):
    """Sees wrong headings."""

    part = DriverPart.PERCEPTION
    cause = "the shape that is visible is fitted with a box of the wrong orientation"
    scale = "standard deviation 0 to 25 degrees, one error of each object a second"

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Add an error to each heading."""
        spread, second = math.radians(self.between(0.0, 25.0)), int(observation.time_s)
        return tuple(
            replace(a, heading_rad=a.heading_rad + spread * float(self.random(a.track, second, 1).normal()))
            for a in actors
        )


class JitteringPlaces(Fault):
    """Sees others at jumping positions."""

    part = DriverPart.PERCEPTION
    cause = "two sensors that disagree, and the better one wins anew each second"
    scale = "standard deviation 0 to 1.5 m, one error of each object a second"

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Add an error to each position."""
        spread, second = self.between(0.0, 1.5), int(observation.time_s)
        moved = []
        for a in actors:
            dx, dy = spread * self.random(a.track, second, 2).normal(size=2)
            moved.append(replace(a, x=a.x + float(dx), y=a.y + float(dy)))
        return tuple(moved)


class SnapsToLane(Fault):
    """Does not see that an actor beside it is coming into its lane."""

    part = DriverPart.PREDICTION
    cause = "headings are snapped to the lane that a vehicle is in"
    scale = "0 to 100 % of the angle to its own heading is taken away, up to 40 degrees"

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Turn the headings of actors with nearly the ego's direction."""
        ego, share = observation.ego, self.strength
        reported = []
        for a in actors:
            angle = turned(a, ego)
            same_way = share and abs(angle) < math.radians(40) and a.kind != "pedestrian"
            reported.append(replace(a, heading_rad=a.heading_rad - share * angle) if same_way else a)
        return tuple(reported)


class StraightOn(Fault):
    """Predicts turning actors at a junction straight on."""

    part = DriverPart.PREDICTION
    cause = "constant velocity, or a map without the turning lanes"
    scale = "0 to 100 % of the bend of each crossing stream is taken away"
    source = "recall of Cruise, September 2022 (the way of an oncoming vehicle at a left turn)"

    def change_mission(self, mission: Mission) -> Mission:
        """Straighten the paths of the crossing streams."""
        if not self.strength:
            return mission
        junctions = tuple(replace(j, foes=tuple(self._straight(f) for f in j.foes)) for j in mission.junctions)
        return replace(mission, junctions=junctions)

    def _straight(self, foe: Foe) -> Foe:
        if foe.pedestrian:
            return foe
        path: FloatArray = np.asarray(foe.path, dtype=float)
        lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
        entry = int(np.searchsorted(lengths, foe.entry_s))
        first = max(entry - 1, 0)
        if entry < 1 or entry >= len(path) - 1:
            return foe
        along = path[entry] - path[first]
        norm = np.hypot(*along)
        if norm < 1e-6:
            return foe
        straight = path[entry] + np.outer(lengths[entry:] - lengths[entry], along / norm)
        bent = path.copy()
        bent[entry:] += self.strength * (straight - path[entry:])
        return replace(foe, path=bent)


class LittleSideRoom(Fault):
    """Keeps too little room at the side."""

    part = DriverPart.PERCEPTION
    cause = "mirrors, handlebars and doors are not part of the boxes"
    scale = "others are taken for 0 to 1.6 m narrower"
    least_m: ClassVar[float] = 0.1

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Report smaller widths."""
        less = self.between(0.0, 1.6)
        return tuple(replace(a, width_m=max(a.width_m - less, min(a.width_m, self.least_m))) for a in actors)


class FollowsNear(Fault):
    """Follows too near."""

    part = None
    cause = "a time gap that was set for motorways with connected vehicles"
    scale = "the gap is overrated by 0 to 1.4 s of the ego's speed"

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Move actors ahead with the same direction forwards."""
        ego = observation.ego
        more = self.between(0.0, 1.4) * max(ego.speed_mps, 0.0)
        reported = []
        for a in actors:
            ahead, left = relative(a, ego)
            leads = more and ahead > 0 and abs(left) < 2.0 + 0.1 * ahead and abs(turned(a, ego)) < math.radians(45)
            x, y = a.x + more * math.cos(a.heading_rad), a.y + more * math.sin(a.heading_rad)
            reported.append(replace(a, x=x, y=y) if leads else a)
        return tuple(reported)


def _rows(tracks: Tracks, rows: list[int]) -> Tracks:
    """Return the tracks of some objects."""
    if len(rows) == len(tracks.numbers):
        return tracks
    numbers, kinds = tuple(tracks.numbers[k] for k in rows), tuple(tracks.kinds[k] for k in rows)
    return Tracks(tracks.table[rows], numbers, kinds)


def _apart(dx: float, dy: float, heading_rad: float, length_m: float, width_m: float) -> float:
    """Return the distance from a point (relative to a box's centre) to the box, m."""
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    along, across = abs(dx * cos + dy * sin) - length_m / 2, abs(dy * cos - dx * sin) - width_m / 2
    return math.hypot(max(along, 0.0), max(across, 0.0))
