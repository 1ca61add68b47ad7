"""Records of positions at the first frame: of places, of vehicles on their routes, and of actors on their paths."""

from __future__ import annotations

from dataclasses import dataclass

from foresee_dsl.compile.roads.polyline import Points
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.helps import write


@dataclass(frozen=True, slots=True)
class Spot:
    """The position of a place, m; `heading_rad` is None for coordinates.

    If the place refers to the line of `actor`, `s` is its position along that line, m.
    """

    x: float
    y: float
    heading_rad: float | None = None
    actor: str = ""
    s: float | None = None


@dataclass(frozen=True)
class OnRoute:
    """A vehicle on its route: position of the front bumper, m, lane, edges from the current one on, its line, and its
    position `s` along the line, m."""

    x: float
    y: float
    heading_rad: float
    lane: str
    edges: tuple[str, ...]
    line: RouteLine
    s: float


@dataclass(frozen=True)
class OnPath:
    """An actor on its path: middle of the footprint, m, points of the path, and position along it, m."""

    x: float
    y: float
    heading_rad: float
    path: Points
    along_m: float


class CircleError(RouteError):
    """Raised if the starts of several actors, the `members`, refer to each other in a circle."""

    def __init__(self, members: tuple[str, ...]) -> None:
        """Create the error for a circle; `members` are in the order of their references."""
        circle = " from ".join((*members, members[0]))
        message = f"the places of actors refer to each other in a circle: {circle}"
        if len(members) == 1:
            message = f"the place of {members[0]} refers to {members[0]} itself"
        super().__init__(
            message,
            "give one of them a place that does not refer to another actor, such as " + write("30 m along ego.route"),
        )
        self.members = frozenset(members)


class UnsettledError(RouteError):
    """Raised if a place refers to an actor whose own start is impossible; the error is reported at that actor."""
