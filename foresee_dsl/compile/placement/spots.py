"""Records of positions: of places, of vehicles on their routes, of actors on their paths, and of an actor on its way
with the places ahead of it, behind it and beside it; and the placements of actors that were computed before."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import assert_never

from foresee_dsl.compile.bundle import ModelSpec, PlacedActor
from foresee_dsl.compile.placement.statements import path_of
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import Points, Polyline
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.compile.tracks import FileTrack
from foresee_dsl.helps import write
from foresee_dsl.language import model as m
from foresee_dsl.language.traversal import si_of, word_of


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


Pose = tuple[float, float, float]
"""A pose: x and y, m, and the heading, rad."""


@dataclass(frozen=True, slots=True)
class PlacedFootprint:
    """An actor's footprint on its way.

    Attributes:
        x, y, heading_rad: pose of the footprint's middle. length_m, width_m: size of the footprint.
        line: its way, which continues straight beyond its ends; None for an actor that has no way, which is treated as
            if it had a straight one.
        s, left_m: position of the middle along the way, and its distance to the left of it (0 without a line).
    """

    x: float
    y: float
    heading_rad: float
    length_m: float
    width_m: float
    line: Polyline | None = None
    s: float = 0.0
    left_m: float = 0.0

    def at(self, onwards_m: float, left_m: float = 0.0) -> Pose:
        """Return the pose `onwards_m` ahead of the middle along the way (negative: behind) and `left_m` to the left."""
        if self.line is not None:
            return self.line.at(self.s + onwards_m, self.left_m + left_m)
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return self.x + onwards_m * cos - left_m * sin, self.y + onwards_m * sin + left_m * cos, self.heading_rad

    def onwards_m(self, place: m.OfActor, *, wheels: bool = True) -> float:
        """Return how far ahead of the middle a place lies along the way, m (negative: behind it)."""
        match place:
            case m.AheadOf():
                return self.length_m / 2 + si_of(place.at)
            case m.BehindOf():
                return -self.length_m / 2 - si_of(place.at)
            case m.Beside():
                return 0.0
            case m.PlaceOf():
                return self.length_m / 2 if wheels else 0.0
            case _:
                assert_never(place)

    def place(self, place: m.OfActor, *, wheels: bool = True) -> Pose:
        """Return the pose of a place relative to this actor; with `wheels`, a vehicle's own place is that of its
        front."""
        match place:
            case m.AheadOf() | m.BehindOf():
                left_m = 0.0 if place.offset is None else si_of(place.offset)
            case m.Beside():
                away_m = self.width_m / 2 + si_of(place.at)
                left_m = away_m if word_of(place.side) == "left" else -away_m
            case m.PlaceOf():
                left_m = 0.0
            case _:
                assert_never(place)
        return self.at(self.onwards_m(place, wheels=wheels), left_m)


# ---- placements that do not have to be computed again ---------------------------------------------------------------

_MOST_PLACEMENTS = 128
"""Maximum number of cached placements, 110 kB each, most of it the line of a route. Ours: those of the four clips for
which a worker counts as warm, with 32 actors each."""


Apart = tuple[bool, bool, FileTrack | None]
"""What a placement depends on besides the statement: whether a trigger starts the actor, whether a trigger makes it
follow a path, and its recorded track."""


class PlacedBefore:
    """The placements by the actors' statements: the children of a clip have the same actors as the clip, except for one
    or two actors that each child changes.

    The placement of an actor with an exact state, on a route or on a path of plain points, depends only on its own
    statement, its model and the network.

    A child shares the statement objects of its clip, so placements are found by the object's id. A statement and its
    network are kept as long as the placement, so that Python does not reuse their ids.
    """

    def __init__(self) -> None:
        self._placements: dict[
            tuple[int, int, ModelSpec, Apart], tuple[m.Ego | m.Actor, RoadNetwork, PlacedActor, OnRoute | None]
        ] = {}

    def get(
        self, actor: m.Ego | m.Actor, spec: ModelSpec, network: RoadNetwork, apart: Apart
    ) -> tuple[PlacedActor, OnRoute | None] | None:
        """Return an actor's placement and its start on its route, if it has one; None if it is not cached.

        `apart`: see `Apart`.
        """
        placement = self._placements.get((id(actor), id(network), spec, apart))
        return placement[2:] if placement is not None else None

    def put(
        self, actor: m.Ego | m.Actor, network: RoadNetwork, apart: Apart, placed: PlacedActor,
        start: OnRoute | None,
    ) -> None:  # fmt: skip
        """Cache the placement of an actor without errors, if it does not depend on other actors."""
        path = path_of(actor)
        if actor.state is None or isinstance(path, m.PathAlong):
            return
        if path is not None and not all(isinstance(p, m.Point) for p in path.points):
            return
        while len(self._placements) >= _MOST_PLACEMENTS:
            del self._placements[next(iter(self._placements))]
        self._placements[id(actor), id(network), placed.model, apart] = actor, network, placed, start


PLACED_BEFORE = PlacedBefore()
"""The cached placements of this process."""
