"""Orders that set an actor's motion by another actor: a gap, the other's speed, a distance beside it, or arrival at a
place at the same time.

The speed depends only on the positions and speeds of both actors, so a clip that begins while such an order is active
continues as its parent did.
"""

from __future__ import annotations

import math

from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.language.model import KeepsBeside, KeepsGap, MatchesSpeed
from foresee_dsl.language.model.actions import WIDEST_LINE_M
from foresee_dsl.language.traversal import si_of, word_of
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import SimulatedActor
from foresee_dsl.simulate.actors.sumo_vehicles import SumoVehicle
from foresee_dsl.simulate.orders.speed import THERE_M, WAITS_MPS
from foresee_dsl.simulate.trace import STEP_S

CLOSES_S = 1.5
"""Time constant with which an actor corrects the error of its gap, s. Ours: with 1 s a car oscillates about the gap,
because its speed follows orders 0.3 s late; with 3 s it needs 10 s to reach the gap."""
HAS_GAP_M = 0.5
"""Error of the gap below which the gap is reached, m. Ours: a tenth of the smallest gap that scenarios order."""
KEEPS_SPEED_S = 0.25
"""An actor that is to arrive at a place together with another actor keeps its speed during the last seconds before the
place; this is their duration, s. Ours: the remaining distance is then too short to compute a speed from."""


class OrderByOther:
    """An order that sets an actor's motion by that of another actor, for a duration or until the end of the run."""

    def __init__(
        self, simulation: Simulation, actor: SimulatedActor, action: KeepsGap | MatchesSpeed | KeepsBeside
    ) -> None:
        self._simulation, self._actor, self._other = simulation, actor, simulation.by_id[action.other]
        self._until_s = None if action.duration is None else simulation.time_s + si_of(action.duration)

    def complete(self) -> bool:
        """Return whether the duration has passed or, without a duration, whether the actor moves as ordered."""
        if self._until_s is not None:
            return self._over(self._simulation.time_s)
        return not self._other.present or self._reached()

    def _reached(self) -> bool:
        """Return whether the actor moves as ordered."""
        raise NotImplementedError

    def _over(self, time_s: float) -> bool:
        return self._until_s is not None and time_s >= self._until_s - STEP_S / 100


class Gap(OrderByOther):
    """An order to keep a gap behind or ahead of another actor: a distance, or a time at the speed of the rear actor."""

    def __init__(self, simulation: Simulation, actor: SimulatedActor, action: KeepsGap) -> None:
        super().__init__(simulation, actor, action)
        self._gap, self._timed = si_of(action.gap), action.gap_is_time
        self._leads = action.way == "leads"
        simulation.close_up(actor, on=True)

    def update(self, time_s: float) -> bool:
        """See `speed.Command`."""
        if self._over(time_s) or not self._other.present:
            self.release()
            self._simulation.order_speed(self._actor, self._simulation.cruise_mps[self._actor.id])
            return False
        missing = self._missing_m()
        if not math.isnan(missing):
            speed_mps = self._other.speed + (missing if self._leads else -missing) / CLOSES_S
            self._simulation.order_speed(self._actor, max(0.0, speed_mps))
        return True

    def release(self) -> None:
        """Restore the actor's usual distance to others."""
        self._simulation.close_up(self._actor, on=False)

    def _reached(self) -> bool:
        return abs(self._missing_m()) <= HAS_GAP_M

    def _missing_m(self) -> float:
        """Return by how much the gap must grow, m; NaN if the actors have no common line along which to measure it."""
        ahead = self._simulation.progress.ahead_of(self._actor, self._other)
        gap = (-ahead if self._leads else ahead) - (self._actor.length + self._other.length) / 2
        behind = self._other if self._leads else self._actor
        return (self._gap * behind.speed if self._timed else self._gap) - gap


class Match(OrderByOther):
    """An order to drive at another actor's current speed, times a factor, plus a difference."""

    def __init__(self, simulation: Simulation, actor: SimulatedActor, action: MatchesSpeed) -> None:
        super().__init__(simulation, actor, action)
        self._factor = 1.0 if action.factor is None else si_of(action.factor)
        self._more = 0.0 if action.more is None else si_of(action.more)

    def update(self, time_s: float) -> bool:
        """See `speed.Command`."""
        if self._over(time_s) or not self._other.present:
            self._simulation.order_speed(self._actor, self._simulation.cruise_mps[self._actor.id])
            return False
        self._simulation.order_speed(self._actor, self._target_mps())
        return True

    def _reached(self) -> bool:
        return abs(self._actor.speed - self._target_mps()) < STANDS_MPS

    def _target_mps(self) -> float:
        return max(0.0, self._other.speed * self._factor + self._more)


class SideGap(OrderByOther):
    """Keeps a lateral distance to another actor, at most `WIDEST_LINE_M` from its lane's centreline."""

    def __init__(self, simulation: Simulation, actor: SumoVehicle, action: KeepsBeside) -> None:
        super().__init__(simulation, actor, action)
        self._vehicle = actor
        apart_m = si_of(action.room) + (actor.width + self._other.width) / 2
        self._apart_m = apart_m if word_of(action.side) == "left" else -apart_m

    def update(self, time_s: float) -> bool:
        """See `speed.Command`."""
        if self._over(time_s):
            return False
        if self._other.present:
            line_m = self._vehicle.beside_m + self._missing_m()
            self._vehicle.line_m = max(-WIDEST_LINE_M, min(WIDEST_LINE_M, line_m))
        return True

    def _reached(self) -> bool:
        return abs(self._missing_m()) <= THERE_M

    def _missing_m(self) -> float:
        """Return the lateral shift to the left that gives the ordered distance, m."""
        line, frame = self._simulation.progress, self._simulation.frame
        here, there = line.of(self._actor, frame)[1], line.beside(self._actor, self._other)
        return there + self._apart_m - here


class Synchrony:
    """An order to reach a place when another actor reaches its own place.

    `places`: lengths of the two places along the actors' lines, m; NaN where an actor does not pass its place.
    """

    def __init__(
        self,
        simulation: Simulation,
        actor: SimulatedActor,
        other: SimulatedActor,
        places: tuple[float, float],
        final_mps: float | None,
    ) -> None:
        self._simulation, self._actor, self._other = simulation, actor, other
        self._own_s, self._their_s = places
        self._final = final_mps

    @property
    def there(self) -> bool:
        """Whether the actor has reached its place, or never will."""
        room = self._room(self._actor, self._own_s)
        return math.isnan(room) or room <= 0.0 or not self._actor.present

    def update(self, time_s: float) -> bool:
        """See `speed.Command`."""
        del time_s
        simulation, name = self._simulation, self._actor.id
        if self.there:
            if self._final is not None:
                simulation.cruise_mps[name] = self._final
            simulation.order_speed(self._actor, simulation.cruise_mps[name])
            return False
        simulation.order_speed(self._actor, self._target_mps())
        return True

    def complete(self) -> bool:
        """Return whether the actor has reached its place, or never will."""
        return self.there

    def _target_mps(self) -> float:
        """Return the speed for the next step, m/s."""
        theirs = self._room(self._other, self._their_s)
        now, cruise = self._actor.speed, self._simulation.cruise_mps[self._actor.id]
        if math.isnan(theirs) or not self._other.present:
            return cruise
        time_s = theirs / max(self._other.speed, WAITS_MPS)
        own = self._room(self._actor, self._own_s)
        if time_s <= 0.0:
            return self._actor.placed.model.max_speed_mps
        if time_s <= KEEPS_SPEED_S:
            return max(now, own / KEEPS_SPEED_S / 2)
        if self._final is None:
            return own / time_s
        # The speed changes linearly twice: to `halfway` in half the remaining time, then to the final speed. `halfway`
        # is such that the remaining distance takes exactly the remaining time.
        halfway = max((4 * own / time_s - now - self._final) / 2, 0.0)
        return max(now + (halfway - now) / (time_s / 2) * STEP_S, 0.0) if time_s > 2 * STEP_S else self._final

    def _room(self, actor: SimulatedActor, s: float) -> float:
        return s - self._simulation.progress.front(actor, self._simulation.frame)
