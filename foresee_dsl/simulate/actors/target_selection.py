"""Finds what a vehicle that Python took over from SUMO must brake for: the bodies in its way, their distances and
speeds.

Targets are searched along the vehicle's lane, along the arc of its wheels, and among actors about to cross its path.
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
"""Distance within which targets are searched, m. Ours."""
MARGIN_M = 0.2
"""Width added to both sides of the vehicle's corridor: a body within it is a target, m. Ours."""
STRAYS_M = 1.0
"""Distance from its lane's centre above which a vehicle searches along the arc of its wheels instead of its lane, m.
Ours: a car in a lane of 3.3 m that is 1 m off touches the marking with one side."""
ARC_S, ARC_STRAYING_S = 0.5, 3.0
"""A vehicle searches along the arc of its wheels as far as it drives in this time, s: the first value holds while it
keeps its lane, the second while it does not. Ours: in its lane it needs to search only very near; out of its lane it
needs the time to stop from any speed in a town (25 m/s at 8 m/s^2)."""
CROSSING_S = 2.0
"""Time for which the paths of crossing actors are predicted, s. Ours: the time to collision at which UN R157's careful
driver reacts (2 s; see `avoidance.r157.risk`)."""
CROSSES_RAD = radians(30)
"""An actor crosses the vehicle's path if the lines of their headings form at least this angle, rad; with a smaller
angle it drives along the path, or towards the vehicle, on lanes that bend. Ours."""
MOVES_MPS = 0.3
"""An actor slower than this does not count as crossing, m/s: within `CROSSING_S` it moves only 0.6 m. Ours."""
_EVERY_S = 0.1
"""Time between two moments at which crossing actors are predicted, s; at 20 m/s a vehicle drives 2 m in this time."""


class Target(NamedTuple):
    """A body in the way: the free distance up to it (m) and its speed in the vehicle's direction (m/s)."""

    room_m: float
    speed_mps: float


class TargetSelection:
    """Finds the bodies that a vehicle has to brake for.

    Args:
        limits: limits of the vehicle.
        line: the centreline of the vehicle's route. line_m: distance to the left of this line that the vehicle keeps,
            m.
    """

    def __init__(self, limits: VehicleLimits, line: Polyline, line_m: float = 0.0) -> None:
        """Search for targets along this line."""
        self._limits, self._line, self._line_m = limits, line, line_m

    def targets(
        self, state: BicycleState, s: float, others: Sequence[Mover], *, strays: bool, yields: bool
    ) -> Iterator[Target]:
        """Yield all targets of a vehicle that is `s` along the line.

        `others`: all other bodies; NaN where absent. `strays`: the vehicle does not keep its lane now, so that its
        wheels determine its path. Without `yields`, only bodies in its path are targets, not those about to cross it.
        """
        arc = tan(state.steer) / self._limits.wheelbase_m
        c, si = cos(state.heading), sin(state.heading)
        for other in others:
            dx, dy = other.x - state.x, other.y - state.y
            if not hypot(dx, dy) <= SIGHT_M:  # the comparison is False for NaN, so this skips absent bodies too
                continue
            along, left = dx * c + dy * si, dy * c - dx * si
            target = None
            if along > 0:
                target = self._on_arc(state, arc, other, along, left, strays=strays)
                target = target or (None if strays else self._in_lane(s, other, along))
            if target is None and yields:
                target = self._crossing(state, arc, s, other, strays=strays)
            if target is not None:
                yield target

    def _on_arc(
        self, state: BicycleState, arc: float, other: Mover, along: float, left: float, *, strays: bool
    ) -> Target | None:
        """Return the body as a target if it lies on the arc of the current wheel angle.

        `along`, `left`: the body's position in the vehicle's frame (m). A vehicle that keeps its lane searches only a
        short arc: its wheel angle says little about its position a second later.
        """
        facing = state.heading + arc * along
        room = along - self._limits.length_m / 2 - half_extent(other, facing)
        # A vehicle does not stay on a sharp arc for long: after a turn of one radian the arc predicts nothing.
        if room > state.speed * (ARC_STRAYING_S if strays else ARC_S) or abs(arc) * along > 1:
            return None
        if abs(left - arc * along * along / 2) > self._reach(other, facing):
            return None
        return Target(room, other.speed * cos(other.heading - facing))

    def _in_lane(self, s: float, other: Mover, along: float) -> Target | None:
        """Return the body as a target if it stands or drives in the vehicle's lane."""
        there, beside = self._line.project(other.x, other.y, s + along)
        facing = self._line.at(there)[2]
        if there <= s or abs(beside - self._line_m) > self._reach(other, facing):
            return None
        room = there - s - self._limits.length_m / 2 - half_extent(other, facing)
        return Target(room, other.speed * cos(other.heading - facing))

    def _crossing(self, state: BicycleState, arc: float, s: float, other: Mover, *, strays: bool) -> Target | None:
        """Return an actor that will be in front of the vehicle, if both keep their motion, as a standing target."""
        far = (abs(state.speed) + abs(other.speed)) * CROSSING_S + self._limits.length_m + other.length
        if other.speed < MOVES_MPS or hypot(other.x - state.x, other.y - state.y) > far:
            return None
        ex, ey = other.velocity
        half_m = self._limits.length_m / 2
        # The distance of the centres gives a bound of the distance of the footprints, which excludes most moments
        # cheaply.
        most_m = half_m + (other.length + other.width) / 2
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
            # Braking does not avoid an actor that hits the vehicle's side, so it is not a target.
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
    """Return half the length of a body's projection onto a line in direction `angle`, m."""
    turned = angle - body.heading
    return (body.length * abs(cos(turned)) + body.width * abs(sin(turned))) / 2
