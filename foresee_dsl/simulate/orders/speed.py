"""Orders that set an actor's speed for a while: a change of speed, a stop, a meeting; and the change of a vehicle's
`line` in its lane.

A later order to the same actor replaces the earlier one.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

from foresee_dsl.compile.bundle import TimedValue
from foresee_dsl.compile.roads.network import StopPlace
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.language.model import ChangesLine, Meets
from foresee_dsl.language.traversal import si_of, word_of
from foresee_dsl.simulate.actors.guided_vehicles import GuidedVehicle
from foresee_dsl.simulate.actors.moved_actors import PathActor
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import SimulatedActor
from foresee_dsl.simulate.actors.sumo_vehicles import SumoVehicle
from foresee_dsl.simulate.recorder import Recorder
from foresee_dsl.simulate.trace import STEP_S

STOPS_WITH_MPS2 = 3.0
"""Braking of an actor that `stops`, m/s^2. Ours: the upper end of comfortable braking (ISO 15622 allows 3.5 m/s^2)."""
COMMITS_M = 15.0
"""Distance before the junction from which an actor with the order `meets` keeps its speed, m. Ours: about one second at
50 km/h; a later change of speed would reveal it."""
COMMITS_WALKING_M = 2.0
"""As `COMMITS_M`, for pedestrians and bicycles on a path, m. Ours: one or two paces of reaction."""
MET_M = 6.0
"""Distance inside the junction up to which an actor with the order `meets` keeps its speed, m. Ours: most junctions of
two-lane roads are 12 m to 20 m wide."""
CREEPS_MPS = 1.0
"""Lowest speed of an actor near the junction of its order `meets`, or near the place where it is to stop, m/s: an actor
that halted before the junction or place would stay there."""
WAITS_MPS = 3.0
"""The other actor's time of arrival is computed with at least this speed, m/s. Ours: with 1 m/s, a waiting ego and an
actor that times itself by the ego both creep up to the junction and wait for each other (a right turn into traffic took
25 s in scenario 9)."""
HASTE = 1.3
"""Maximum speed of an actor with the order `meets`, as a multiple of its cruising speed (defined by the language)."""
HALTS_M = 0.3
"""An actor is halted when it is this far from the place where it is to stop, m. Ours: from the speed that it has there,
it stops within 0.3 m at 3 m/s^2."""
MISSED_M = 5.0
"""An actor that is farther than this beyond its stop has missed it and drives on, m. Ours: about a car's length, the
stopping distance from 20 km/h."""
BOUND_FROM_M = 60.0
"""An actor that is to ignore a rule at a junction begins to ignore it this far before the junction, m. Ours: SUMO's
cars begin to brake for a red signal within their stopping distance, 35 m at 65 km/h."""
THERE_M = 0.05
"""Distance within which a vehicle is on its `line`, m. Ours: it approaches the line asymptotically; five times the
rounding of clips."""


class Command(Protocol):
    """An order that sets an actor's speed, or its lateral position, for a while; a later one replaces it."""

    def update(self, time_s: float) -> bool:
        """Set the speed or position for the step that begins now; return False when the order has ended."""
        ...

    def complete(self) -> bool:
        """Return whether the order is complete, so that the action after `then` can begin (see `model.Then`)."""
        ...


class Ramp:
    """An order to change the speed linearly; the final speed becomes the actor's cruising speed."""

    def __init__(self, simulation: Simulation, actor: SimulatedActor, to_mps: float, over_s: float) -> None:
        self._simulation, self._actor, self._to, self._over = simulation, actor, to_mps, over_s
        self._since, self._from = simulation.time_s, actor.speed

    def update(self, time_s: float) -> bool:
        """See `Command`."""
        share = 1.0 if self._over <= 0 else min(1.0, (time_s + STEP_S - self._since) / self._over)
        self._simulation.order_speed(self._actor, self._from + (self._to - self._from) * share)
        if share < 1.0:
            return True
        self._simulation.cruise_mps[self._actor.id] = self._to
        return False

    def complete(self) -> bool:
        """Return whether the duration has passed or, without a duration, whether the target speed is reached."""
        if self._over > 0:
            return self._simulation.time_s >= self._since + self._over - STEP_S / 100
        return abs(self._actor.speed - self._to) < STANDS_MPS


class LateralShift:
    """Moves a vehicle to another `line`: linearly over a given time, or at the usual lateral speed."""

    def __init__(self, simulation: Simulation, actor: SumoVehicle, action: ChangesLine) -> None:
        self._simulation, self._actor = simulation, actor
        self._from_m, self._to_m = actor.line_m, si_of(action.to)
        self._over_s = 0.0 if action.over is None else si_of(action.over)
        self._since_s = simulation.time_s

    def update(self, time_s: float) -> bool:
        """See `Command`."""
        share = 1.0 if self._over_s <= 0 else min(1.0, (time_s + STEP_S - self._since_s) / self._over_s)
        self._actor.line_m = self._from_m + (self._to_m - self._from_m) * share
        return share < 1.0

    def complete(self) -> bool:
        """Return whether the time has passed and the vehicle is on the line."""
        over = self._simulation.time_s >= self._since_s + self._over_s - STEP_S / 100
        return over and abs(self._actor.beside_m - self._to_m) <= THERE_M


class Stop:
    """An order to brake comfortably to a stop, to stand for a time or to the end of the run, and then to drive as
    before.
    """

    def __init__(self, simulation: Simulation, actor: SimulatedActor, duration_s: float | None) -> None:
        self._simulation, self._actor, self._duration = simulation, actor, duration_s
        self._pace = actor.speed
        self._stands_since: float | None = None
        self._resumed = False

    def update(self, time_s: float) -> bool:
        """See `Command`."""
        if self._stands_since is None and self._actor.speed < STANDS_MPS:
            self._stands_since = time_s
        if self._over(time_s):
            self._simulation.order_speed(self._actor, self._simulation.cruise_mps[self._actor.id])
            self._resumed = True
            return False
        self._pace = max(0.0, self._pace - STOPS_WITH_MPS2 * STEP_S)
        self._simulation.order_speed(self._actor, self._pace)
        return True

    def complete(self) -> bool:
        """Return whether the actor drives again, which ends the order."""
        return self._resumed

    def _over(self, time_s: float) -> bool:
        if self._stands_since is None or self._duration is None:
            return False
        return time_s >= self._stands_since + self._duration - STEP_S / 100


class Halt:
    """An order to stop with the front at a place on the route, to stand there for a time or to the end of the run, and
    then to drive on.

    The speed depends only on the distance to the place, so a clip that begins during the order continues in the same
    way.
    """

    def __init__(
        self, simulation: Simulation, actor: SimulatedActor, place: StopSpot, duration_s: float | None
    ) -> None:
        self._simulation, self._actor, self._place, self._duration = simulation, actor, place, duration_s
        self._resumed = False
        self.stands_s: float | None = None
        """Time from which the actor stands at the place, s; None before it does."""

    @property
    def missed(self) -> bool:
        """Whether the place lies behind the actor, or not on its route."""
        room = self._room()
        return math.isnan(room) or room < -MISSED_M

    def update(self, time_s: float) -> bool:
        """See `Command`."""
        room, cruise = self._room(), self._simulation.cruise_mps[self._actor.id]
        if self.stands_s is None and self._actor.speed < STANDS_MPS and room <= max(self._place.long_m, HALTS_M):
            self.stands_s = time_s
        if self.stands_s is not None and self._duration is not None:
            self._resumed = time_s >= self.stands_s + self._duration - STEP_S / 100
        if self._resumed or not self._actor.present:
            self._simulation.order_speed(self._actor, cruise)
            return False
        if self._place.stop is not None and self.stands_s is None:
            for lane in (*self._place.stop.beside, self._place.stop.lane):
                self._simulation.keep_to_lane(self._actor, lane.id)
        free = math.sqrt(2 * STOPS_WITH_MPS2 * max(room, 0.0))
        pace = 0.0 if self.stands_s is not None or room < HALTS_M else min(cruise, max(free, CREEPS_MPS))
        self._simulation.order_speed(self._actor, pace)
        return True

    def complete(self) -> bool:
        """Return whether the actor drives again, which ends the order."""
        return self._resumed

    def _room(self) -> float:
        """Return the distance from the actor's front to the place, m."""
        stop = self._place.stop
        if stop is not None and self._actor.lane.rpartition("_")[0] == stop.lane.edge:
            # During a change of lane, the line of a clip begins on the lane that the actor changes to and leads back
            # from it, so it is longer than the lane. The distance is therefore measured along the stop's own lane.
            return stop.pos_m - stop.lane.line.project(*self._actor.front)[0]
        return self._place.s - self._simulation.progress.front(self._actor, self._simulation.frame)


class Reverse:
    """An order to brake to a stop, to reverse along the lane by a length, and to drive on as before."""

    def __init__(self, simulation: Simulation, actor: GuidedVehicle, length_m: float, speed_mps: float) -> None:
        self._simulation, self._actor, self._length, self._speed = simulation, actor, length_m, speed_mps
        self._pace, self._backs, self._over = actor.speed, False, False

    def update(self, time_s: float) -> bool:
        """See `Command`."""
        del time_s
        actor, simulation = self._actor, self._simulation
        self._over = self._over or not actor.present or (self._backs and not actor.backs)
        if self._over:
            simulation.order_speed(actor, simulation.cruise_mps[actor.id])
            return False
        if not self._backs and actor.speed < STANDS_MPS and actor.guide is None:
            simulation.back_up(actor, self._length)
            self._backs = actor.backs
            if not self._backs:  # a vehicle that is not on a lane cannot reverse along it
                self._over = True
                return False
        if self._backs:
            free = math.sqrt(2 * STOPS_WITH_MPS2 * max(actor.room_m, 0.0))
            simulation.order_speed(actor, min(self._speed, free) if actor.room_m > HALTS_M / 10 else 0.0)
            return True
        self._pace = max(0.0, self._pace - STOPS_WITH_MPS2 * STEP_S)
        simulation.order_speed(actor, self._pace)
        return True

    def complete(self) -> bool:
        """Return whether the actor drives on, which ends the order."""
        return self._over


class StopSpot(NamedTuple):
    """The place where an actor stops, as a length along its line, m; NaN if the actor does not pass there.

    For a bus stop the record also has the stop, and how far before the stop's end an actor still counts as standing at
    the stop, m.
    """

    s: float
    stop: StopPlace | None = None
    long_m: float = 0.0


class Braking:
    """An order to brake at a fixed rate for a time, from when the actor first moves (with `acts`: at once); afterwards
    the actor drives as before.
    """

    def __init__(
        self, simulation: Simulation, actor: SimulatedActor, brakes: TimedValue, *, acts: bool = False
    ) -> None:
        self._simulation, self._actor, self._brakes = simulation, actor, brakes
        self.acts = acts
        """Whether the order brakes the actor now."""
        self._harder = acts
        if acts:
            simulation.brake_harder(actor, brakes.value)

    def update(self, time_s: float) -> bool:
        """See `Command`."""
        if time_s >= self._brakes.until_s - STEP_S / 100 or not self._actor.present:
            self.release()
            return False
        if time_s >= self._brakes.from_s - STEP_S / 100 and (self.acts or self._actor.speed >= STANDS_MPS):
            self.acts = True
            rate = self._simulation.braking(self._actor, self._brakes.value)
            pace = max(0.0, self._actor.speed - rate * STEP_S)
            stands = pace < STANDS_MPS and rate == self._brakes.value  # a slippery patch allows no such last step
            self._simulation.brake(self._actor, 0.0 if stands else pace)
        return True

    def release(self) -> None:
        """Let the actor drive on as before."""
        if self.acts and self._actor.present:
            self._simulation.brake(self._actor, None)
            if self._harder:
                self._simulation.brake_harder(self._actor, 0.0)
        self.acts = False

    def complete(self) -> bool:
        """Return whether the time has passed."""
        return self._simulation.time_s >= self._brakes.until_s - STEP_S / 100


class Meeting:
    """An order to reach a point of a junction shortly before or after another actor.

    The speed is planned again in every step; near the junction the actor keeps its speed until it is well inside. The
    plan depends only on the state of both actors, and the kept speed is recorded, so a clip that begins during the
    order continues in the same way.
    """

    def __init__(self, simulation: Simulation, recorder: Recorder, actor: SimulatedActor, meets: Meets) -> None:
        self._simulation, self._recorder, self._actor = simulation, recorder, actor
        self._other, self._junction = simulation.by_id[meets.other], word_of(meets.junction)
        self._points = simulation.progress.meeting(actor, self._other, self._junction)
        self._gap_s = si_of(meets.gap) * (1 if meets.order == "after" else -1)
        self.keeps_mps: float | None = None
        """The speed that the actor keeps near the junction, m/s; None before it does."""

    def update(self, time_s: float) -> bool:
        """See `Command`."""
        if self.over():
            self._recorder.event(time_s, self._actor.id, "met", {"junction": self._junction})
            self._simulation.order_speed(self._actor, self._simulation.cruise_mps[self._actor.id])
            return False
        if self.keeps_mps is None:
            pace = self.pace_mps()
            self._simulation.order_speed(self._actor, pace)
            if self._near():
                self.keeps_mps = pace
                detail = {"junction": self._junction, "speed_mps": pace}
                self._recorder.event(time_s, self._actor.id, "keeps_speed", detail)
        return True

    def complete(self) -> bool:
        """Return whether the actor has left the junction, or does not pass it at all."""
        span = self._simulation.progress.span(self._actor, self._junction)
        return span is None or self._simulation.progress.front(self._actor, self._simulation.frame) >= span[1]

    def pace_mps(self) -> float:
        """Return the speed that the order sets now, m/s, without the actor's `timing`."""
        simulation, actor, other, timing = self._simulation, self._actor, self._other, self._actor.placed.timing
        cruise = simulation.cruise_mps[actor.id] / timing
        fastest = HASTE * cruise
        if self._near():
            return min(max(actor.speed / timing, CREEPS_MPS), fastest)
        if self._points is None or not other.present:
            return cruise
        own = self._points[0] - simulation.progress.front(actor, simulation.frame)
        theirs = self._points[1] - simulation.progress.front(other, simulation.frame)
        if own <= 0 or theirs <= 0:
            return cruise
        arrival = theirs / max(other.speed, WAITS_MPS) + self._gap_s
        return min(own / arrival, fastest) if arrival > 0 else fastest

    def over(self) -> bool:
        """Return whether the order has ended: the actor is well inside the junction, has left the world, or does not
        pass the junction.
        """
        room = self._room()
        return math.isnan(room) or room <= -MET_M or not self._actor.present

    def _near(self) -> bool:
        return self._room() <= (COMMITS_WALKING_M if isinstance(self._actor, PathActor) else COMMITS_M)

    def _room(self) -> float:
        return self._simulation.progress.to_junction(self._actor, self._junction, self._simulation.frame)
