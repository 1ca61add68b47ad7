"""Where something is at the first frame: places, vehicles on their routes, actors on their paths."""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl.compile.roads.polyline import Points
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.helps import write


@dataclass(frozen=True, slots=True)
class Spot:
    """A place: m, rad; `heading_rad` is None for bare coordinates.

    `s` is the length along the line of `actor` where the place was given so.
    """

    x: float
    y: float
    heading_rad: float | None = None
    actor: str = ""
    s: float | None = None


@dataclass(frozen=True)
class OnRoute:
    """A vehicle on its route: front bumper, lane, edges from the one it is on, and its line with where it is on it,
    m."""

    x: float
    y: float
    heading_rad: float
    lane: str
    edges: tuple[str, ...]
    line: RouteLine
    s: float


@dataclass(frozen=True)
class OnPath:
    """An actor on its path: centre of the footprint, the path's points, and how far along it is, m."""

    x: float
    y: float
    heading_rad: float
    path: Points
    along_m: float


class CircleError(RouteError):
    """Starts that are counted from each other in a circle of actors, the `members`."""

    def __init__(self, members: tuple[str, ...]) -> None:
        """Say it, once for all of them."""
        circle = " from ".join((*members, members[0]))
        message = f"the places of actors are counted in a circle: {circle}"
        if len(members) == 1:
            message = f"the place of {members[0]} is counted from {members[0]} itself"
        super().__init__(message, "give one of them a place of its own, such as " + write("30 m along ego.route"))
        self.members = frozenset(members)


class UnsettledError(RouteError):
    """A place that is counted from an actor whose own start is impossible, which is reported there."""
