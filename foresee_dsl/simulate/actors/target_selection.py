"""Target selection of a vehicle that SUMO does not move any more: what is in its way, how far it is and how fast.

Targets are looked for along the vehicle's lane, along the arc of its wheels, and among those about to cross its path.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import cos, hypot, pi, radians, sin, tan
from typing import NamedTuple

from foresee_dsl.compile.roads.polyline import Polyline, wrap
from foresee_dsl.drivers.protocol import VehicleLimits
from foresee_dsl.kernels.boxes import Mover
from foresee_dsl.simulate.actors.dynamics import BicycleState

SIGHT_M = 80.0
"""How far ahead targets are looked for. Ours."""
MARGIN_M = 0.2
"""A body counts as ahead when it comes this near to the swept corridor. Ours."""
STRAYS_M = 1.0
"""Further than this from its lane's centre an actor looks where its wheels point and not along its lane. Ours: a car
in a lane of 3.3 m that is 1 m off has a side on the marking."""
ARC_S, ARC_STRAYING_S = 0.5, 3.0
"""How far along the arc of its wheels it looks, in and out of its lane. Ours: in it, for what has come upon it; out of
it, the time in which any speed in a town is braked away (25 m/s at 8 m/s^2)."""
CROSSING_S = 2.0
"""How far ahead it sees that somebody who crosses will be where it will be. Ours: the time to collision from which UN
R157's careful driver reacts (2 s; see `avoidance.r157.risk`)."""
CROSSES_RAD = radians(30)
"""An actor whose heading differs by at least this much crosses the vehicle's path; the others drive along it or towards
it, on lanes that bend. Ours."""
MOVES_MPS = 0.3
"""A slower actor crosses nothing within that time: 0.6 m. Ours."""
_EVERY_S = 0.1
"""A crossing is looked for at these times; at 20 m/s, each 2 m."""


class Target(NamedTuple):
    """Something in the way: the room up to it (m) and its speed in our direction (m/s)."""

    room_m: float
    speed_mps: float


class TargetSelection:
    """Finds what a vehicle has to brake for.

    Args:
        limits: of the vehicle.
        line: the centreline of its route. line_m: how far to the left of it the vehicle keeps.
    """

    def __init__(self, limits: VehicleLimits, line: Polyline, line_m: float = 0.0) -> None:
        """Look along this line."""
        self._limits, self._line, self._line_m = limits, line, line_m

    def targets(
        self, state: BicycleState, s: float, others: Sequence[Mover], *, strays: bool, yields: bool
    ) -> Iterator[Target]:
        """Yield everything in the way of a vehicle that is `s` along the line.

        `others`: all others; NaN where absent. `strays`: it does not keep its lane now, so that its wheels say where it
        goes. Without `yields`, actors that are about to cross its path are no targets, only those on it.
        """
        arc = tan(state.steer) / self._limits.wheelbase_m
        c, si = cos(state.heading), sin(state.heading)
        for other in others:
            dx, dy = other.x - state.x, other.y - state.y
            if not hypot(dx, dy) <= SIGHT_M:  # NaN is not there
                continue
            along, left = dx * c + dy * si, dy * c - dx * si
            found = None
            if along > 0:
                found = self._on_arc(state, arc, other, along, left, strays=strays)
                found = found or (None if strays else self._in_lane(s, other, along))
            if found is None and yields:
                found = self._crossing(state, arc, s, other, strays=strays)
            if found is not None:
                yield found

    def _on_arc(
        self, state: BicycleState, arc: float, other: Mover, along: float, left: float, *, strays: bool
    ) -> Target | None:
        """What lies on the arc that the wheels now describe; `along`, `left`: where it is in our frame (m).

        A vehicle that keeps its lane looks along the lane: its wheels say little about where it will be in a second.
        """
        facing = state.heading + arc * along
        room = along - self._limits.length_m / 2 - half_extent(other, facing)
        # A sharp arc is left again soon: beyond a radian it says nothing.
        if room > state.speed * (ARC_STRAYING_S if strays else ARC_S) or abs(arc) * along > 1:
            return None
        if abs(left - arc * along * along / 2) > self._reach(other, facing):
            return None
        return Target(room, other.speed * cos(other.heading - facing))

    def _in_lane(self, s: float, other: Mover, along: float) -> Target | None:
        """What stands or drives in its lane."""
        there, beside = self._line.project(other.x, other.y, s + along)
        facing = self._line.at(there)[2]
        if there <= s or abs(beside - self._line_m) > self._reach(other, facing):
            return None
        room = there - s - self._limits.length_m / 2 - half_extent(other, facing)
        return Target(room, other.speed * cos(other.heading - facing))

    def _crossing(self, state: BicycleState, arc: float, s: float, other: Mover, *, strays: bool) -> Target | None:
        """An actor that will be in front of the vehicle if both keep their motion, as a wall at that place."""
        far = (abs(state.speed) + abs(other.speed)) * CROSSING_S + self._limits.length_m + other.length
        if other.speed < MOVES_MPS or hypot(other.x - state.x, other.y - state.y) > far:
            return None
        ex, ey = other.velocity
        half_m = self._limits.length_m / 2
        most_m = half_m + (other.length + other.width) / 2  # no shadow is longer, and most are far beyond
        for k in range(1, round(CROSSING_S / _EVERY_S) + 1):
            way = state.speed * k * _EVERY_S
            x, y, heading = self._on_its_way(state, arc, s, way, strays=strays)
            dx, dy = other.x + ex * k * _EVERY_S - x, other.y + ey * k * _EVERY_S - y
            c, si = cos(heading), sin(heading)
            along = dx * c + dy * si
            if abs(along) > most_m or abs(along) > half_m + half_extent(other, heading):
                continue
            if abs(dy * c - dx * si) > self._reach(other, heading):
                continue
            across = abs(wrap(other.heading - heading))
            # An actor that hits the vehicle's side is not avoided by braking.
            return Target(way, 0.0) if along > 0 and CROSSES_RAD <= across <= pi - CROSSES_RAD else None
        return None

    def _on_its_way(
        self, state: BicycleState, arc: float, s: float, way_m: float, *, strays: bool
    ) -> tuple[float, float, float]:
        if not strays:
            x, y, heading = self._line.at(s + way_m)
            return x - self._line_m * sin(heading), y + self._line_m * cos(heading), heading
        middle = state.heading + arc * way_m / 2
        return state.x + way_m * cos(middle), state.y + way_m * sin(middle), state.heading + arc * way_m

    def _reach(self, other: Mover, facing: float) -> float:
        return self._limits.width_m / 2 + MARGIN_M + half_extent(other, facing + pi / 2)


def half_extent(body: Mover, angle: float) -> float:
    """Return half the length of a body's shadow on a line in direction `angle`, m."""
    turned = angle - body.heading
    return (body.length * abs(cos(turned)) + body.width * abs(sin(turned))) / 2
