"""Orders that set an actor's speed by another actor: a gap to keep, a place to be at when the other is at its own.

What they ask for depends on where both are and how fast, and on nothing else: a clip that begins in between continues
in the same way.
"""

from __future__ import annotations

import math

from foresee_dsl.language.model import KeepsGap, MatchesSpeed
from foresee_dsl.language.traversal import si_of
from foresee_dsl.simulate.actors.moved_actors import STANDS_MPS
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.states import Actor
from foresee_dsl.simulate.orders.speed import WAITS_MPS
from foresee_dsl.simulate.trace import STEP_S

CLOSES_S = 1.5
"""What a gap is too wide or too narrow is made up for with this time constant. Ours: with 1 s a car swings round the
gap, as its speed follows 0.3 s late; with 3 s it needs 10 s."""
HAS_GAP_M = 0.5
"""An actor has the gap that it keeps when it is that near to it. Ours: a tenth of the nearest that people write."""
KEEPS_SPEED_S = 0.25
"""In the last quarter of a second before its place an actor that synchronises keeps its speed. Ours: what is left of
the way says little then."""


class Gap:
    """Keeps a distance, or a time at the speed of the one behind, behind another actor or ahead of it."""

    def __init__(self, simulation: Simulation, actor: Actor, action: KeepsGap) -> None:
        self._simulation, self._actor, self._other = simulation, actor, simulation.by_id[action.other]
        self._gap, self._timed = si_of(action.gap), action.gap_is_time
        self._leads = action.way == "leads"
        self._until_s = None if action.duration is None else simulation.time_s + si_of(action.duration)
        simulation.close_up(actor, on=True)

    def update(self, time_s: float) -> bool:
        """See `speed.Command`."""
        if self._over(time_s) or not self._other.present:
            self.release()
            self._simulation.order_speed(self._actor, self._simulation.cruise_mps[self._actor.id])
            return False
        missing = self._missing_m()
        if not math.isnan(missing):
            asked = self._other.speed + (missing if self._leads else -missing) / CLOSES_S
            self._simulation.order_speed(self._actor, max(0.0, asked))
        return True

    def release(self) -> None:
        """Let it keep its usual distance again."""
        self._simulation.close_up(self._actor, on=False)

    def complete(self) -> bool:
        """Whether the time is over; without one, whether it has the gap."""
        if self._until_s is not None:
            return self._over(self._simulation.time_s)
        return not self._other.present or abs(self._missing_m()) <= HAS_GAP_M

    def _over(self, time_s: float) -> bool:
        return self._until_s is not None and time_s >= self._until_s - STEP_S / 100

    def _missing_m(self) -> float:
        """How much wider the gap is to become, m; NaN where it has no way along which it could be measured."""
        ahead = self._simulation.progress.ahead_of(self._actor, self._other)
        gap = (-ahead if self._leads else ahead) - (self._actor.length + self._other.length) / 2
        behind = self._other if self._leads else self._actor
        return (self._gap * behind.speed if self._timed else self._gap) - gap


class Match:
    """Has another actor's speed at each moment, times a ratio, and so much more."""

    def __init__(self, simulation: Simulation, actor: Actor, action: MatchesSpeed) -> None:
        self._simulation, self._actor, self._other = simulation, actor, simulation.by_id[action.other]
        self._factor = 1.0 if action.factor is None else si_of(action.factor)
        self._more = 0.0 if action.more is None else si_of(action.more)
        self._until_s = None if action.duration is None else simulation.time_s + si_of(action.duration)

    def update(self, time_s: float) -> bool:
        """See `speed.Command`."""
        if self._over(time_s) or not self._other.present:
            self._simulation.order_speed(self._actor, self._simulation.cruise_mps[self._actor.id])
            return False
        self._simulation.order_speed(self._actor, self._asked())
        return True

    def complete(self) -> bool:
        """Whether the time is over; without one, whether it has that speed."""
        if self._until_s is not None:
            return self._over(self._simulation.time_s)
        return not self._other.present or abs(self._actor.speed - self._asked()) < STANDS_MPS

    def _over(self, time_s: float) -> bool:
        return self._until_s is not None and time_s >= self._until_s - STEP_S / 100

    def _asked(self) -> float:
        return max(0.0, self._other.speed * self._factor + self._more)


class Synchrony:
    """Comes to a place when another actor comes to another one.

    `own_s`, `their_s`: the lengths along the lines of both, m; NaN where one does not come there.
    """

    def __init__(
        self, simulation: Simulation, actor: Actor, other: Actor, places: tuple[float, float], final_mps: float | None
    ) -> None:
        self._simulation, self._actor, self._other = simulation, actor, other
        self._own_s, self._their_s = places
        self._final = final_mps

    @property
    def there(self) -> bool:
        """Whether it has come to its place, or never will."""
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
        simulation.order_speed(self._actor, self._asked())
        return True

    def complete(self) -> bool:
        """Whether it is at its place."""
        return self.there

    def _asked(self) -> float:
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
        # Linearly to a speed at half the time, and from there to the final one: so the way takes the time.
        halfway = max((4 * own / time_s - now - self._final) / 2, 0.0)
        return max(now + (halfway - now) / (time_s / 2) * STEP_S, 0.0) if time_s > 2 * STEP_S else self._final

    def _room(self, actor: Actor, s: float) -> float:
        return s - self._simulation.progress.front(actor, self._simulation.frame)
