"""Shows SUMO the actors that SUMO does not move: the ego, followers of paths, steered vehicles and standing bodies."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from foresee_dsl.simulate.actors.doors import OpenDoor
from foresee_dsl.simulate.actors.guided_vehicles import GuidedVehicle
from foresee_dsl.simulate.actors.moved_actors import EgoVehicle, StaticActor, SteeredVehicle
from foresee_dsl.simulate.actors.path_groups import PathGroup
from foresee_dsl.simulate.actors.states import SimulatedActor
from foresee_dsl.simulate.actors.sumo_vehicles import SumoVehicle
from foresee_dsl.simulate.triggers.progress import Progress
from foresee_dsl.simulate.world import BodyMotion, World

OFF_LANE_M = 1.8
"""Lateral distance to a lane's centreline up to which the ego is on that lane, m. Ours: about half a lane."""


class ShownActors:
    """The actors that SUMO does not move and whose positions it gets in every step.

    Attributes:
        paths: the groups that have actors.
        joined: vehicles that SUMO drives from this step on, at the end of their path.
    """

    def __init__(
        self, ego: EgoVehicle, actors: Iterable[SimulatedActor], paths: Sequence[PathGroup], progress: Progress,
        world: World,
    ) -> None:  # fmt: skip
        """Select the actors to show from all actors; `paths`: the groups of the actors that follow paths or tracks."""
        self.ego, self._progress, self._world = ego, progress, world
        self.paths = tuple(group for group in paths if len(group))
        actors = list(actors)
        self.guided = [actor for actor in actors if isinstance(actor, GuidedVehicle)]
        self.steered = [actor for actor in actors if isinstance(actor, SteeredVehicle)]
        bodies = (actor for actor in actors if isinstance(actor, StaticActor))
        self._in_the_way = [body for body in bodies if body.positions or isinstance(body, OpenDoor)]
        self.joined: list[SumoVehicle] = []

    def show(self, frame: int) -> None:
        """Tell SUMO where the actors that it does not move will be at the end of the next step."""
        self.show_ego(frame)
        self.show_others()

    def show_ego(self, frame: int, ahead_s: float = 0.0) -> None:
        """Tell SUMO the ego's position, or its position `ahead_s` later at its current speed."""
        ego = self.ego
        x, y, heading, speed, *_ = ego.row()
        half, way, cos, sin = ego.length / 2, speed * ahead_s, math.cos(heading), math.sin(heading)
        front_x, front_y = x + half * cos + way * cos, y + half * sin + way * sin
        self._world.bodies.place(ego.id, front_x, front_y, heading, self._lane_ahead(frame))

    def _lane_ahead(self, frame: int) -> str:
        """Return the lane that the ego's front is on; "" if it is not on a lane of its route."""
        line = self.ego.placed.line
        if line is None:
            return ""
        s, lateral = self._progress.of(self.ego, frame)
        return line.lane_at(s + self.ego.length / 2) if abs(lateral) <= OFF_LANE_M else ""

    def show_others(self) -> None:
        """Tell SUMO where all shown actors except the ego are."""
        for group in self.paths:
            group.show()
        for guided in self.guided:
            guided.show()
        for static in self._in_the_way:
            static.stand_in.show(static.positions)
        for steered in self.steered:
            if steered.taken is not None and steered.present:
                x, y = steered.front
                self._world.bodies.place(steered.id, x, y, steered.heading)

    def motions(self) -> list[BodyMotion]:
        """Return the speeds that the shown actors must have in SUMO after the next step: SUMO derives other speeds from
        how far they moved.
        """
        bodies: list[SimulatedActor] = [self.ego, *self.joined]
        if self.steered:
            bodies += [actor for actor in self.steered if actor.taken is not None and actor.present]
        motions = []
        for body in bodies:
            _, _, _, speed, acceleration, *_ = body.row()
            motions.append((body.id, speed, acceleration))
        for group in self.paths:
            motions += group.motions()
        for static in self._in_the_way:
            motions += static.stand_in.motions()
        for guided in self.guided:
            if guided.guide is not None:
                motions += guided.guide.stand_in.motions()
        return motions

    def hide(self, actor: StaticActor) -> None:
        """Remove a standing actor from SUMO."""
        actor.stand_in.hide()
        self._in_the_way = [other for other in self._in_the_way if other is not actor]

    def find_ego_lane(self, frame: int) -> None:
        """Set the ego's `lane` from its position."""
        line = self.ego.placed.line
        if line is not None:
            s, lateral = self._progress.of(self.ego, frame)
            self.ego.lane = line.lane_at(s) if abs(lateral) <= OFF_LANE_M else ""
