"""Orders about a vehicle's lateral position in its lane: a change of its `line`, or a distance beside another actor.

A later order to the same actor replaces the earlier one.
"""

from __future__ import annotations

from foresee_dsl.language.model import ChangesLine, KeepsBeside
from foresee_dsl.language.model.actions import WIDEST_LINE_M
from foresee_dsl.language.traversal import si_of, word_of
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.actors.sumo_vehicles import SumoVehicle
from foresee_dsl.simulate.orders.pair import OrderByOther
from foresee_dsl.simulate.trace import STEP_S

THERE_M = 0.05
"""Distance within which a vehicle is on its `line`, m. Ours: it approaches the line asymptotically; five times the
rounding of clips."""


class LateralShift:
    """Moves a vehicle to another `line`: linearly over a given time, or at the usual lateral speed."""

    def __init__(self, simulation: Simulation, actor: SumoVehicle, action: ChangesLine) -> None:
        self._simulation, self._actor = simulation, actor
        self._from_m, self._to_m = actor.line_m, si_of(action.to)
        self._over_s = 0.0 if action.over is None else si_of(action.over)
        self._since_s = simulation.time_s

    def update(self, time_s: float) -> bool:
        """See `speed.Command`."""
        share = 1.0 if self._over_s <= 0 else min(1.0, (time_s + STEP_S - self._since_s) / self._over_s)
        self._actor.line_m = self._from_m + (self._to_m - self._from_m) * share
        return share < 1.0

    def complete(self) -> bool:
        """Return whether the time has passed and the vehicle is on the line."""
        over = self._simulation.time_s >= self._since_s + self._over_s - STEP_S / 100
        return over and abs(self._actor.beside_m - self._to_m) <= THERE_M


class Beside(OrderByOther):
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
