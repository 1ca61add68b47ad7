"""Finds free places and paths for added actors, on lanes and sidewalks around the ego's start."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from foresee_dsl.compile.bundle import ModelSpec, PlacedActor, SumoBundle
from foresee_dsl.compile.placement.background_traffic import random_route
from foresee_dsl.compile.placement.checks import footprint
from foresee_dsl.compile.placement.statements import lane_kind
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, Points, Polyline
from foresee_dsl.compile.roads.topology import Lane, LaneKind
from foresee_dsl.compile.roads.walkways import walkways
from foresee_study.fuzz import settings as s

STEP_M = 1.0
"""Spacing of the candidate places, m (ours)."""
BESIDE_M = 1.5
"""Distance of pedestrians from the rightmost lane on roads without sidewalks, m (ours: a verge)."""


@dataclass(frozen=True)
class LanePlace:
    """A place on a lane: position of an actor's front along it, m."""

    lane: Lane
    along_m: float

    @property
    def pose(self) -> tuple[float, float, float]:
        """Return x, y (m) and heading (rad) of the place."""
        return self.lane.line.at(self.along_m)


class Around:
    """The places around the ego's start in a scene, and the actors that occupy some of them.

    Args:
        bundle: the compiled parent.
        rng: source of all random choices.
        gone: an actor that is moved, so that its present place counts as free.
    """

    def __init__(self, bundle: SumoBundle, rng: np.random.Generator, gone: str = "") -> None:
        self.network: RoadNetwork = bundle.network
        self.rng = rng
        ego = bundle.scene.ego
        self._start = ego.x, ego.y
        self._route = frozenset(ego.route)
        self._others = [actor for actor in bundle.scene.actors if actor.id != gone]
        self._taken = [shapely.Polygon(footprint(actor)) for actor in self._others]

    def on_lanes(self, spec: ModelSpec, *, blocks: bool = False) -> Iterator[LanePlace]:
        """Yield places on lanes for a model, in random order.

        `blocks`: whether the actor stands there for the whole run; a place on the ego's route then needs another lane
        beside it.
        """
        places = self._lane_places(lane_kind(spec), blocks=blocks)
        for k in self.rng.permutation(len(places))[: s.PLACES_TRIED]:
            yield places[int(k)]

    def on_foot(self, *, blocks: bool = False) -> Iterator[XY]:
        """Yield places on sidewalks or on the road, in random order; `blocks` as in `on_lanes`."""
        if float(self.rng.random()) < s.ROAD_SHARE:
            road = self._lane_places("car", blocks=blocks)
            for k in self.rng.permutation(len(road))[: s.PLACES_TRIED]:
                lane = road[int(k)].lane
                beside = float(self.rng.uniform(-lane.width_m / 2, lane.width_m / 2))
                x, y, _ = lane.line.at(road[int(k)].along_m, beside)
                yield x, y
        places = self._walk_places
        for k in self.rng.permutation(len(places))[: s.PLACES_TRIED]:
            yield places[int(k)]

    def on_ground(self) -> XY | None:
        """Return the centre of a slippery patch on a lane, m, as far from the ego as actors are placed; None without a
        place.
        """
        places = [place for place in self._lane_places("car") if place.lane.speed_mps > 0]
        if not places:
            return None
        x, y, _ = places[int(self.rng.integers(len(places)))].pose
        return x, y

    def is_free(self, actor: PlacedActor) -> bool:
        """Return whether an actor has free space around it and, if it is a vehicle, enough free lane before and behind
        it.
        """
        box = shapely.Polygon(footprint(actor))
        if any(box.distance(other) < s.ROOM_M for other in self._taken):
            return False
        if actor.control == "sumo" or actor.model.kind != "pedestrian":
            ahead = _stretched(actor)
            return not any(ahead.intersects(other) for other in self._taken)
        return True

    def straight_on(self, start: XY, heading_rad: float, spec: ModelSpec) -> Points | None:
        """Return the path of a vehicle that drives straight on, up to the point where it has left the road.

        None if it is too short or leads through a building.
        """
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        length_m = s.LINEAR_M
        marks = np.arange(0.0, s.LINEAR_M, STEP_M)
        x, y = start[0] + marks * cos, start[1] + marks * sin
        off = np.flatnonzero(~shapely.contains_xy(self.network.drivable, x, y))
        if len(off):
            length_m = float(marks[off[0]]) + spec.length_m
        way = (start, (start[0] + length_m * cos, start[1] + length_m * sin))
        if length_m < s.LINEAR_LEAST_M or self.network.wall_on_the_way(way) is not None:
            return None
        return way

    def walks_on(self, start: XY) -> Points | None:
        """Return the path of a pedestrian who walks straight on in a random direction; None if a building is in the
        way."""
        heading = float(self.rng.uniform(-math.pi, math.pi))
        way = (start, (start[0] + s.WALK_M * math.cos(heading), start[1] + s.WALK_M * math.sin(heading)))
        return way if self.network.wall_on_the_way(way) is None else None

    def walks_about(self, start: XY, length_m: float) -> Points | None:
        """Return a random walk over sidewalks and crossings; None without sidewalks."""
        return walkways(self.network).walk(start, length_m, self.rng)

    def route(self, place: LanePlace, missing_m: float, kind: LaneKind) -> tuple[str, ...]:
        """Return a random route from a place on, of this length or up to the end of the network."""
        missing_m -= place.lane.line.length_m - place.along_m
        return random_route(self.network, self.rng, place.lane, missing_m, kind, most_edges=math.inf)

    def _near(self, x: float, y: float) -> bool:
        return s.NEAREST_M <= math.hypot(x - self._start[0], y - self._start[1]) <= s.FARTHEST_M

    def _lane_places(self, kind: LaneKind, *, blocks: bool = False) -> list[LanePlace]:
        near = []
        for edge in self.network.edges.values():
            lanes = edge.for_kind(kind)
            if not lanes or (blocks and edge.id in self._route and len(edge.drivable) < 2):
                continue
            for lane in lanes[:1] if kind == "bicycle" else lanes:  # bicycles keep to the right
                marks = np.arange(STEP_M, lane.line.length_m, STEP_M)
                places = (LanePlace(lane, float(mark)) for mark in marks if not lane.fault)
                near += [place for place in places if self._near(*place.pose[:2])]
        return near

    @cached_property
    def _walk_places(self) -> list[XY]:
        ways = walkways(self.network)
        points = [xy for way in ways.sidewalks for xy in Polyline.of(ways.shapes[way]).xy]
        if not points:
            points = list(self._verges())
        return [(float(x), float(y)) for x, y in points if self._near(float(x), float(y))]

    def _verges(self) -> Iterator[XY]:
        for edge in self.network.edges.values():
            lane = edge.drivable[0]
            for mark in np.arange(0.0, lane.line.length_m, STEP_M):
                x, y, _ = lane.line.at(float(mark), -lane.width_m / 2 - BESIDE_M)
                yield x, y


def _stretched(actor: PlacedActor) -> shapely.Polygon:
    """Return an actor's footprint with free lane in front of and behind it."""
    corners: Sequence[XY] = footprint(actor)
    back = s.QUEUE_M * math.cos(actor.heading_rad), s.QUEUE_M * math.sin(actor.heading_rad)
    front_left, rear_left, rear_right, front_right = corners
    return shapely.Polygon(
        [
            (front_left[0] + back[0], front_left[1] + back[1]),
            (rear_left[0] - back[0], rear_left[1] - back[1]),
            (rear_right[0] - back[0], rear_right[1] - back[1]),
            (front_right[0] + back[0], front_right[1] + back[1]),
        ]
    )
