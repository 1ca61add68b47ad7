"""Bodies that SUMO's world contains but does not drive: the ego, stand-ins for bodies beside the lanes, steered
vehicles.

Positions are SUMO's: those of the middle of the front bumper.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING

from foresee_dsl.errors import SimulationError
from foresee_dsl.simulate.vehicle_reader import VehicleReader

if TYPE_CHECKING:
    from types import ModuleType

GHOST_TYPE = "ghost"
"""The vehicle type of stand-ins for bodies that SUMO does not drive; 0.5 m long, in every types file."""
MATCH_M = 5.0
"""Radius within which SUMO's moveToXY searches for a lane, m. Ours: a call takes 5 us with 5 m, 33 us with SUMO's
default 100 m."""


class MovedBodies:
    """The vehicles of SUMO's world that are moved from outside, in every step."""

    def __init__(
        self,
        sumo: ModuleType,
        errors: tuple[type[Exception], ...],
        route_of: Callable[[tuple[str, ...]], str],
        reader: VehicleReader,
    ) -> None:
        """Begin without bodies.

        `errors`: the exceptions that SUMO raises. `route_of`: a function that returns SUMO's name of a route of edges.
        """
        self._sumo, self._errors, self._route_of, self._reader = sumo, errors, route_of, reader
        self._bodies: dict[str, tuple[str, tuple[str, ...], float | None]] = {}

    def clear(self) -> None:
        """Drop all bodies, because SUMO's world was emptied."""
        self._bodies.clear()

    def adopt(self, vehicle: str, model: str, route: tuple[str, ...]) -> None:
        """Take over a vehicle that SUMO's world already contains, so that it is moved from outside from now on."""
        self._bodies[vehicle] = (model, route, None)

    def forget(self, vehicle: str) -> None:
        """Stop moving a vehicle; does nothing if it was not moved."""
        self._bodies.pop(vehicle, None)

    def add(self, vehicle: str, model: str, route: tuple[str, ...], length_m: float | None = None) -> None:
        """Add a body that is moved from outside; `place` must be called for it before every step.

        `model`: its vehicle type. `route`: the route on which SUMO's vehicles expect it. `length_m`: its length if it
        differs from that of the type.
        """
        self._bodies[vehicle] = (model, route, length_m)
        self._put_in(vehicle)

    def place(self, vehicle: str, x_front: float, y_front: float, heading_rad: float, lane: str = "") -> None:
        """Set the position of a moved vehicle's front at the end of the next step (m, rad).

        `lane`: the lane that it is on; without it SUMO searches near the last lane, so that the result depends on
        earlier positions.
        """
        where = (*edge_and_index(lane), x_front, y_front, degrees(heading_rad), 2, MATCH_M)
        try:
            self._sumo.vehicle.moveToXY(vehicle, *where)
        except self._errors:
            # SUMO removes a vehicle that reaches the end of its route, but the body is still in the scene, so it is
            # added again.
            try:
                self._put_in(vehicle)
                self._sumo.vehicle.moveToXY(vehicle, *where)
            except self._errors as err:
                place = f"({x_front:.2f} m, {y_front:.2f} m)"
                raise SimulationError(f"SUMO cannot place {vehicle} at {place}: {err}") from err

    def correct_lane_order(self) -> None:
        """Restore the order of a lane's vehicles after moved bodies have passed, or were passed by, another vehicle.

        SUMO 1.28 does not expect that vehicles moved from outside pass each other: it keeps the order of arrival, and a
        follower does not see vehicles in front of its wrong leader (measured: a truck drove through a parked car that
        the ego had passed). This function can be deleted once SUMO's `lane.getLastStepVehicleIDs` is in order of
        position without it. Bodies must be placed again before the next step.
        """
        for lane in self._reader.disordered(tuple(self._bodies)):
            self._correct(lane)

    def _correct(self, lane: str) -> None:
        vehicle = self._sumo.vehicle
        queue = self._sumo.lane.getLastStepVehicleIDs(lane)
        places = list(map(vehicle.getLanePosition, queue))
        for k in [k for k in range(1, len(queue)) if places[k] < places[k - 1]]:
            bodies = [name for name in (queue[k], queue[k - 1]) if name in self._bodies]
            # A stand-in is inserted again rather than the ego: SUMO would treat the ego as just arrived at a junction,
            # which would change the right of way.
            for name in sorted(bodies, key=lambda name: self._bodies[name][0] != GHOST_TYPE)[:1]:
                vehicle.remove(name)
                self._put_in(name)

    def _put_in(self, vehicle: str) -> None:
        model, route, length_m = self._bodies[vehicle]
        self._sumo.vehicle.add(vehicle, self._route_of(route), typeID=model)
        self._sumo.vehicle.setLaneChangeMode(vehicle, 0)
        if length_m is not None:
            self._sumo.vehicle.setLength(vehicle, length_m)


def degrees(heading_rad: float) -> float:
    """Return a heading in SUMO's unit: degrees clockwise from north."""
    return (90.0 - math.degrees(heading_rad)) % 360.0


@lru_cache(maxsize=4096)
def edge_and_index(lane: str) -> tuple[str, int]:
    """Return the edge of a lane and the lane's index on it; "" and -1 for ""."""
    edge, _, index = lane.rpartition("_")
    return edge, int(index or -1)
