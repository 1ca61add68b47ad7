"""Faults of signals and right of way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import ClassVar

from foresee_dsl.drivers.parts import DriverPart
from foresee_dsl.drivers.protocol import Foe, JunctionPassage, Mission, Observation, SeenActor, VehicleLimits
from foresee_faults.fault import Actors, Fault, Signals, away, turned


class RunsAmber(Fault):
    """Drives on when the signal has become amber or red."""

    part = DriverPart.RULES
    cause = "the time to the stop line is taken from a plan that accelerates"
    scale = "takes it for green for 0 to 5 s after the change"
    source = "NHTSA 23V-085 (entering a junction on a steady amber)"

    def begin(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Forget the colours."""
        super().begin(mission, vehicle, seed)
        self._green_s: dict[str, float] = {}

    def change_signals(self, signals: Signals, observation: Observation) -> Signals:
        """Keep green for some seconds."""
        for key, colour in signals.items():
            if colour == "green":
                self._green_s[key] = observation.time_s
        until_s = observation.time_s - self.between(0.0, 5.0)
        return {
            key: "green" if self._green_s.get(key, -math.inf) > until_s else colour for key, colour in signals.items()
        }


class OverTheLine(Fault):
    """Stops beyond the stop line."""

    part = DriverPart.RULES
    cause = "the line's place in the map is that of the old marking"
    scale = "0 to 4 m"

    def change_mission(self, mission: Mission) -> Mission:
        """Move the stop lines forwards, at most to just before the junction's end."""
        on = self.between(0.0, 4.0)
        moved = tuple(replace(j, stop_s=max(min(j.stop_s + on, j.exit_s - 1.0), j.stop_s)) for j in mission.junctions)
        return replace(mission, junctions=moved)


class Unlooking(Fault):
    """At some junctions, some actors are seen only when they are near."""

    part = DriverPart.RULES
    range_m: ClassVar[float] = 60.0
    least_m: ClassVar[float] = 4.0

    def looks_away(self, passage: JunctionPassage, actor: SeenActor, observation: Observation) -> bool:
        """Return whether the driver does not look for this actor here."""
        raise NotImplementedError

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Leave out the actors for which the driver does not look."""
        passage = self.passage(observation.ego)
        if passage is None:
            return actors
        range_m, ego = self.shrinking(self.range_m, self.least_m), observation.ego
        return tuple(a for a in actors if away(a, ego) <= range_m or not self.looks_away(passage, a, observation))


class NoYieldRight(Unlooking):
    """Turns right without looking for pedestrians and cyclists."""

    cause = "they come from behind the planner's region of interest"
    scale = "sees them there within 40 m to 2 m"
    range_m, least_m = 40.0, 2.0

    def looks_away(self, passage: JunctionPassage, actor: SeenActor, observation: Observation) -> bool:
        """Return whether the actor is a pedestrian or cyclist, at a right turn."""
        return passage.turn == "right" and actor.kind in ("pedestrian", "bicycle")


class OvertrustsSignals(Unlooking):
    """Does not look for crossing vehicles when its signal is green."""

    cause = "red for them is taken for certain"
    scale = "sees them there within 60 m to 5 m"
    range_m, least_m = 60.0, 5.0

    def looks_away(self, passage: JunctionPassage, actor: SeenActor, observation: Observation) -> bool:
        """Return whether the actor is a crossing vehicle while the signal is green."""
        across = math.radians(45) < abs(turned(actor, observation.ego)) < math.radians(135)
        green = passage.signal is not None and observation.signals.get(passage.signal) == "green"
        return green and across and actor.kind != "pedestrian"


class IgnoresRightPriority(Unlooking):
    """Does not look for vehicles from the right at junctions without signals."""

    cause = "the map has no sign there, so it is taken for a main road"
    scale = "sees them there within 60 m to 5 m"
    range_m, least_m = 60.0, 5.0

    def looks_away(self, passage: JunctionPassage, actor: SeenActor, observation: Observation) -> bool:
        """Return whether the actor is a vehicle that drives to the left, relative to the ego."""
        angle = turned(actor, observation.ego)
        return passage.signal is None and math.radians(30) < angle < math.radians(150) and actor.kind != "pedestrian"


class MovedConflicts(Fault):
    """The driver expects vehicles with priority too late, because their conflict zone is moved along their path."""

    part = DriverPart.RULES
    most_m: ClassVar[float]
    slower: ClassVar[float] = 0.0
    """Share by which the speed of oncoming vehicles is underestimated near such a junction, at full strength."""

    def concerns(self, passage: JunctionPassage, foe: Foe) -> bool:
        """Return whether the fault affects a stream."""
        raise NotImplementedError

    def change_mission(self, mission: Mission) -> Mission:
        """Move the conflict zones of the streams that the fault affects."""
        on = self.between(0.0, self.most_m)
        return with_foes(mission, lambda j, f: self._later(f, on) if self.concerns(j, f) else f)

    @staticmethod
    def _later(foe: Foe, on: float) -> Foe:
        first, last = foe.conflict_path_s
        return replace(foe, conflict_path_s=(first + on, last + on), entry_s=foe.entry_s + on)


class SmallGapLeft(MovedConflicts):
    """Turns left into gaps in the oncoming traffic that are too small."""

    cause = "a gap that was tuned on a test ground, where oncoming cars are slow"
    scale = "takes oncoming vehicles for 0 to 30 m farther away and 0 to 70 % slower, before left turns"
    source = "recall of Cruise, September 2022 (an unprotected left turn)"
    most_m, slower = 30.0, 0.7

    def concerns(self, passage: JunctionPassage, foe: Foe) -> bool:
        """Return whether the stream has vehicles with priority, at a left turn."""
        return passage.turn == "left" and foe.has_priority and not foe.pedestrian

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Report lower speeds of oncoming vehicles."""
        passage, ego = self.passage(observation.ego), observation.ego
        if passage is None or passage.turn != "left" or not self.strength:
            return actors
        share = 1 - self.slower * self.strength
        return tuple(
            replace(a, speed_mps=a.speed_mps * share) if abs(turned(a, ego)) > math.radians(100) else a for a in actors
        )


class IgnoresCrossings(Fault):
    """Does not give way at crossings until a pedestrian is in its lane."""

    part = DriverPart.RULES
    cause = "the crossing is missing in the map, or its marking is worn"
    scale = "the stretch in which it gives way, from the lane and a stride on both sides to nothing"
    air_m: ClassVar[float] = 0.8

    def change_mission(self, mission: Mission) -> Mission:
        """Narrow the stretch along the crossing; at full strength it is empty, and no pedestrian has priority."""
        return with_foes(mission, lambda _, f: self._narrow(f) if f.pedestrian else f)

    def _narrow(self, foe: Foe) -> Foe:
        first, last = foe.conflict_path_s
        less = self.strength * ((last - first) / 2 + self.air_m)
        return replace(
            foe, conflict_path_s=(first + less, last - less), has_priority=foe.has_priority and self.strength < 1
        )


class IgnoresPriority(MovedConflicts):
    """Pulls out in front of vehicles with priority."""

    cause = "arrival times from the middle of the lane's length, not of the vehicle"
    scale = "takes vehicles with priority for 0 to 50 m farther away, at all junctions"
    most_m = 50.0

    def concerns(self, passage: JunctionPassage, foe: Foe) -> bool:
        """Return whether the stream has vehicles with priority."""
        return foe.has_priority and not foe.pedestrian


def with_foes(mission: Mission, change: Callable[[JunctionPassage, Foe], Foe]) -> Mission:
    """Return a mission in which each crossing stream is replaced by the result of `change`."""
    junctions = tuple(replace(j, foes=tuple(change(j, foe) for foe in j.foes)) for j in mission.junctions)
    return replace(mission, junctions=junctions)
