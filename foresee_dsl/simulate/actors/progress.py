"""Lengths along the actors' routes: their progress, and the distances to junctions and to crossings of two routes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import shapely
from shapely.geometry.base import BaseGeometry

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import Polyline
from foresee_dsl.compile.roads.route_line import Passage
from foresee_dsl.kernels.arrays import Records
from foresee_dsl.kernels.lines import project, vertices
from foresee_dsl.simulate.actors.guided_vehicles import GuidedVehicle
from foresee_dsl.simulate.actors.moved_actors import PathActor
from foresee_dsl.simulate.actors.states import SimulatedActor

AROUND_M = 2.0
"""Margin around a junction within which two routes count as meeting in it, m. Ours: crossings lie at the junction's
edge."""

BESIDE_M = 8.0
"""A place is passed by an actor if it is at most this far beside the actor's line, m. Ours: slightly more than two
lanes."""


class Progress:
    """Lengths along the routes and paths of a run's actors; each actor is projected at most once per frame."""

    def __init__(self, network: RoadNetwork, actors: Sequence[SimulatedActor]) -> None:
        self._network = network
        self._lines: dict[str, Polyline] = {}
        for actor in actors:
            line = actor.follower.line if isinstance(actor, PathActor) else actor.placed.line
            if isinstance(actor, GuidedVehicle) and actor.guide is not None:
                line = actor.guide.follower.line
            if line is not None:
                self._lines[actor.id] = line
        self._vertices: dict[str, Records] = {}
        self._last: dict[str, tuple[int, float, float]] = {}
        self._spans: dict[tuple[str, str], tuple[float, float] | None] = {}

    def of(self, actor: SimulatedActor, frame: int) -> tuple[float, float]:
        """Return the length of an actor's centre along its line, and its distance to the left of it, m; NaN without a
        line."""
        last = self._last.get(actor.id)
        if last is not None and last[0] == frame:
            return last[1], last[2]
        line = self._lines.get(actor.id)
        if line is None:
            return math.nan, math.nan
        if isinstance(actor, PathActor):
            s, lateral = actor.along, 0.0
        else:
            points = self._vertices.get(actor.id)
            if points is None:
                points = self._vertices[actor.id] = vertices(line.points, line.s, line.heading)
            s, lateral = project(actor.x, actor.y, last[1] if last is not None else math.nan, points)
        self._last[actor.id] = (frame, s, lateral)
        return s, lateral

    def front(self, actor: SimulatedActor, frame: int) -> float:
        """Return the length of an actor's front (of a pedestrian: centre) along its line, m."""
        s, _ = self.of(actor, frame)
        return s if actor.placed.model.kind == "pedestrian" else s + actor.length / 2

    def span(self, actor: SimulatedActor, junction: str) -> tuple[float, float] | None:
        """Return the lengths at which an actor's line enters and leaves a junction, m; None if it passes elsewhere."""
        key = (actor.id, junction)
        if key not in self._spans:
            self._spans[key] = self._find_span(actor, junction)
        return self._spans[key]

    def to_junction(self, actor: SimulatedActor, junction: str, frame: int) -> float:
        """Return the distance from an actor's front to a junction, m, negative inside; NaN if it passes elsewhere."""
        span = self.span(actor, junction)
        return math.nan if span is None else span[0] - self.front(actor, frame)

    def ahead(self, actor: SimulatedActor, frame: int, within_m: float) -> Iterable[tuple[Passage, float]]:
        """Return the junctions that an actor has not left, each with the distance to it (m, negative inside)."""
        line = actor.placed.line
        if line is None:
            return
        s, _ = self.of(actor, frame)
        front = self.front(actor, frame)
        for passage in line.passages:
            if passage.exit_s > s and passage.entry_s - front <= within_m:
                yield passage, passage.entry_s - front

    def set_line(self, actor: SimulatedActor, line: Polyline) -> None:
        """Measure an actor's progress along another line from now on."""
        self._lines[actor.id] = line
        self._vertices.pop(actor.id, None)
        self._last.pop(actor.id, None)
        self._spans = {key: span for key, span in self._spans.items() if key[0] != actor.id}

    def along(self, actor: SimulatedActor, x: float, y: float) -> float:
        """Return the length of a place along an actor's line, m; NaN if the actor has no line, or does not pass the
        place.
        """
        line = self._lines.get(actor.id)
        if line is None:
            return math.nan
        s, beside = line.project(x, y)
        return s if abs(beside) <= BESIDE_M and 0.0 <= s <= line.length_m else math.nan

    def ahead_of(self, actor: SimulatedActor, other: SimulatedActor) -> float:
        """Return how far another actor's centre is ahead of an actor's centre, along the actor's line, m; NaN without a
        line.
        """
        line = self._lines.get(actor.id)
        if line is None:
            return math.nan
        return line.project(other.x, other.y)[0] - line.project(actor.x, actor.y)[0]

    def beside(self, actor: SimulatedActor, other: SimulatedActor) -> float:
        """Return how far another actor's centre is to the left of an actor's line, m; NaN without a line."""
        line = self._lines.get(actor.id)
        return math.nan if line is None else line.project(other.x, other.y)[1]

    def inside(self, actor: SimulatedActor, frame: int) -> float:
        """Return how far an actor's front is inside its current junction, m; 0 outside junctions."""
        if not actor.lane.startswith(":"):
            return 0.0
        return max(0.0, next((-room for _, room in self.ahead(actor, frame, 0.0)), 0.0))

    def meeting(self, actor: SimulatedActor, other: SimulatedActor, junction: str) -> tuple[float, float] | None:
        """Return the lengths along both lines of the first point at which they meet in a junction, m.

        None if an actor has no line, or a line does not pass the junction.
        """
        a, b = self._lines.get(actor.id), self._lines.get(other.id)
        if a is None or b is None:
            return None
        area = shapely.buffer(self._polygon(junction), AROUND_M)
        mine = shapely.intersection(shapely.LineString(a.points), area)
        theirs = shapely.intersection(shapely.LineString(b.points), area)
        if mine.is_empty or theirs.is_empty:
            return None
        shared = shapely.intersection(mine, theirs)
        if shared.is_empty:  # the lines run side by side without crossing: take their nearest points
            near = shapely.get_coordinates(shapely.shortest_line(mine, theirs))
            return a.project(*near[0].tolist())[0], b.project(*near[1].tolist())[0]
        points = shapely.get_coordinates(shared)
        return min((a.project(x, y)[0], b.project(x, y)[0]) for x, y in points.tolist())

    def _find_span(self, actor: SimulatedActor, junction: str) -> tuple[float, float] | None:
        route = actor.placed.line
        if route is not None and not isinstance(actor, PathActor):
            s, _ = self.of(actor, -1)
            passages = route.over(junction)
            passage = next((p for p in passages if p.exit_s > s), None) or (passages[-1] if passages else None)
            return (passage.entry_s, passage.exit_s) if passage is not None else None
        line = self._lines.get(actor.id)
        if line is None:
            return None
        inside = shapely.intersection(shapely.LineString(line.points), self._polygon(junction))
        if inside.is_empty:
            return None
        at = [line.project(x, y)[0] for x, y in shapely.get_coordinates(inside).tolist()]
        return min(at), max(at)

    def _polygon(self, junction: str) -> BaseGeometry:
        return shapely.make_valid(shapely.Polygon(self._network.outline(junction)))
