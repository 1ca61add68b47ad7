"""Vehicles that follow a path or a recorded track for a part of the run and are driven by SUMO before and after it, and
the changes between path and SUMO.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import replace

from foresee_dsl.compile.bundle import PlacedActor, TrackPlayback
from foresee_dsl.compile.placement.paths import joined_way
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import XY, Points, line_of
from foresee_dsl.compile.roads.route_line import RouteLine
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.compile.roads.topology import LaneKind
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.simulate.actors.moved_actors import PathActor
from foresee_dsl.simulate.actors.path_groups import PathGroup
from foresee_dsl.simulate.actors.states import StateTable
from foresee_dsl.simulate.actors.sumo_vehicles import SumoVehicle
from foresee_dsl.simulate.actors.track_followers import TrackActor, TrackGroup
from foresee_dsl.simulate.trace import STEP_S
from foresee_dsl.simulate.world import World

GOES_ON_M = 20.0
"""If a vehicle joins the lanes at the end of its path, the path is extended along the lanes by this length, m. Ours:
longer than one step at any speed plus the length of a lorry, whose heading is computed over its length."""
_EVERY_M = 2.0
THERE_M = 0.1
"""A reversing vehicle that stands within this distance of the end of its path has arrived, m. Ours."""


class GuidedVehicle(SumoVehicle):
    """A vehicle that SUMO drives except while it follows a path.

    Attributes:
        leaves_track: whether it was told to leave its recorded track.
        guide: the actor on the path whose position the vehicle takes over, None while SUMO drives it.
        way: the line of the edges that the vehicle joins at the path's end; None if it stays at the end. route: these
            edges.
        ends_m: length of its path, m. backs: whether it reverses along its path.
    """

    __slots__ = (
        "_edge", "_friction", "_group", "_roads", "_world", "backs", "ends_m", "guide", "leaves_track", "route", "way",
    )  # fmt: skip

    def __init__(self, actor: PlacedActor, world: World, network: RoadNetwork, edge: str, friction: float) -> None:
        """Place the actor as the scene says: on a path, or on the lanes."""
        self._world, self._roads, self._edge, self._friction = world, network, edge, friction
        self.guide: PathActor | None = None
        self.way: RouteLine | None = None
        self.route, self.backs = actor.route, False
        self.ends_m, self.leaves_track = math.inf, False
        if actor.control != "path":
            super().__init__(actor, network)
            return
        half = actor.model.length_m / 2
        front = actor.x + half * math.cos(actor.heading_rad), actor.y + half * math.sin(actor.heading_rad)
        super().__init__(replace(actor, control="sumo", x=front[0], y=front[1], lane=""), network)
        if actor.playback is not None:
            self._follow_track(actor, actor.playback)
            return
        self.follow(actor.path, actor.line, along_m=actor.along_m, speed_mps=actor.speed_mps, timing=actor.timing)

    def _follow_track(self, actor: PlacedActor, playback: TrackPlayback) -> None:
        """Follow the recorded track from the first frame on."""
        guide = TrackActor(actor, playback, self._world, self._edge, self._friction)
        self.guide = guide
        self._group: PathGroup = TrackGroup((guide,), (0,), StateTable((guide,)), self._roads)
        self._take_state(guide)

    @property
    def on_track(self) -> bool:
        """Whether the vehicle follows its recorded track, also before the track's beginning and after its end."""
        return isinstance(self.guide, TrackActor) and self.guide.follows

    @property
    def leaves_now(self) -> bool:
        """Whether the vehicle is to leave its track here, if the lanes that it joins are near."""
        waits = isinstance(self.guide, TrackActor) and self.guide.clock.waits
        return self.leaves_track and self.present and self.way is None and not waits

    def join_from_track(self, kind: LaneKind) -> None:
        """Find the way that the vehicle takes when it leaves its track here; there is none if its lanes are too far
        away.

        The way begins on the lane nearest to its front, as that of a vehicle in a clip does.
        """
        with contextlib.suppress(RouteError):
            self.route, self.way = joined_way(self._roads, self.placed.route, self.front, kind)
            self.ends_m = 0.0

    def follow(
        self, path: Points, way: RouteLine | None, *, along_m: float = 0.0, speed_mps: float, timing: float = 1.0
    ) -> None:
        """Follow a path, beginning `along_m` from its start; its speeds are multiplied by `timing`."""
        self.way, self.ends_m, self.backs = way, line_of(path).length_m, False
        placed = replace(
            self.placed,
            control="path",
            path=_going_on(path, way),
            along_m=along_m,
            x=self.x,
            y=self.y,
            heading_rad=self.heading,
            speed_mps=speed_mps,
            timing=timing,
            walk_stops=(),
            playback=None,
        )
        before, self.guide = self.guide, PathActor(placed, self._world, self._edge, self._friction)
        if before is not None:
            # SUMO's world already contains the vehicle, so the new path takes over its stand-in.
            self.guide.stand_in = before.stand_in
        self._group = PathGroup((self.guide,), (0,), StateTable((self.guide,)), self._roads)
        self.along = along_m
        self.lane = ""

    @property
    def joins_now(self) -> bool:
        """Whether the vehicle reaches the end of its path in the next step, and SUMO drives it from there."""
        guide = self.guide
        if self.backs:
            return guide is not None and guide.along >= self.ends_m - THERE_M and guide.speed < STANDS_MPS
        return guide is not None and self.way is not None and guide.along + guide.speed * STEP_S >= self.ends_m

    @property
    def arrived(self) -> bool:
        """Whether the vehicle has reached the end of its path and stays there."""
        return self.guide is not None and self.way is None and self.guide.follower.arrived

    def back_up(self, length_m: float) -> None:
        """Let the vehicle, which stands, reverse along its lane by `length_m`; afterwards SUMO drives it as before."""
        line = self.placed.line
        if line is None:
            return
        s, beside = line.project(self.x, self.y)
        count = max(math.ceil(length_m / _EVERY_M), 1)
        poses = [line.at(s - length_m * k / count, beside) for k in range(1, count + 1)]
        path = ((self.x, self.y), *((x, y) for x, y, _ in poses))
        self.follow(path, None, speed_mps=self.placed.backs_mps)
        self.way, self.backs = line, True
        self.placed = replace(self.placed, backs_mps=0.0)

    @property
    def room_m(self) -> float:
        """Return the remaining length of its path, m."""
        return self.ends_m - self.along

    def step_on_path(self) -> None:
        """Move the vehicle along its path by one step."""
        if self.guide is not None:
            self._group.move()
            guide = self.guide
            if self.backs:
                heading = math.remainder(guide.heading + math.pi, math.tau)
                self.move(guide.x, guide.y, heading, -guide.speed, -guide.acceleration, guide.yaw_rate)
            else:
                self._take_state(guide)
            self.along = guide.along if guide.present else math.nan

    def _take_state(self, guide: PathActor) -> None:
        """Take over the state of the actor on the path; both are present or absent together."""
        self.present = guide.present
        if guide.present:
            self.move(guide.x, guide.y, guide.heading, guide.speed, guide.acceleration, guide.yaw_rate)
            self.along = guide.along

    def leave(self) -> None:
        """Stop following a path or a track, because the vehicle leaves the world."""
        if self.guide is not None:
            self._group.drop(self.guide)

    def show(self) -> None:
        """Make the vehicle visible to those that SUMO drives, while it follows its path."""
        if self.guide is not None and self.present:
            self._group.show()

    def hand_over(self) -> PlacedActor | None:
        """Take the vehicle off its path, and return it as SUMO must place it at the end of the next step: in the middle
        of its lane.

        None if it does not join lanes.
        """
        guide, way = self.guide, self.way
        if guide is None or way is None:
            return None
        x, y = self.front
        ahead_x, ahead_y = x, y
        if not self.backs:
            self._group.move()  # its position at the end of the step
            ahead_x, ahead_y = guide.front
        s, _ = way.project(ahead_x, ahead_y)
        lane = self._roads.lanes[way.lane_at(s)]
        at_x, at_y, heading = way.at(s)
        back_x, back_y, back_heading = way.at(way.project(x, y)[0])
        record, edge = self.record, lane.edge
        record["front_x"], record["front_y"] = x, y
        record["sumo_x"], record["sumo_y"] = back_x, back_y
        record["offset"] = (y - back_y) * math.cos(back_heading) - (x - back_x) * math.sin(back_heading)
        guide.stand_in.hide()
        self.guide, self.along, self.lane, self.backs = None, math.nan, lane.id, False
        route = self.route[self.route.index(edge) :] if edge in self.route else self.route
        self.placed = replace(self.placed, route=route, line=way, lane=lane.id, playback=None)
        return replace(self.placed, x=at_x, y=at_y, heading_rad=heading, speed_mps=guide.speed)


def _going_on(path: Points, way: RouteLine | None) -> Points:
    """Return a path extended by `GOES_ON_M` along the lanes that it joins at its end."""
    if way is None:
        return path
    s, _ = way.project(*path[-1])
    count = int(min(GOES_ON_M, way.length_m - s - 0.1) // _EVERY_M)
    ahead: list[XY] = [way.at(s + (k + 1) * _EVERY_M)[:2] for k in range(max(count, 0))]
    return (*path, *ahead)
