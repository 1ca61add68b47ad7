"""Where an actor is at a moment: what every kind of actor has in common while a run goes on."""

from __future__ import annotations

import math
from typing import NamedTuple

from foresee_dsl.compile.bundle import PlacedActor
from foresee_dsl.simulate.collision import Box, Mover
from foresee_dsl.simulate.dynamics import BicycleState, centre_of_front


class Mobile:
    """An actor's footprint now; the runner's other modules change it in place (20 actors, 20 times a second).

    Attributes:
        placed: the actor as the scene has it.
        x, y: centre of the footprint, m. heading: rad, counter-clockwise from east. speed: m/s. acceleration: m/s^2.
        yaw_rate: rad/s. steer: front wheels, rad, left positive.
        lane: SUMO's id of the lane it is on, or "".
        along: path-followers: m along their path; NaN for the others.
        present: False before it comes and after it has gone.
    """

    __slots__ = (
        "acceleration",
        "along",
        "heading",
        "id",
        "lane",
        "length",
        "placed",
        "present",
        "speed",
        "steer",
        "width",
        "x",
        "y",
        "yaw_rate",
    )

    def __init__(self, actor: PlacedActor) -> None:
        """Stand where the scene places it."""
        self.placed = actor
        self.id = actor.id
        self.length = actor.model.length_m
        self.width = actor.model.width_m
        self.heading = actor.heading_rad
        self.x, self.y = actor.x, actor.y
        if actor.control in ("ego", "sumo"):  # placed by the front bumper
            self.x, self.y = centre_of_front(actor.x, actor.y, actor.heading_rad, self.length)
        self.speed = actor.speed_mps
        self.acceleration = actor.acceleration_mps2
        self.yaw_rate = 0.0
        self.steer = actor.steer_rad
        self.lane = actor.lane
        self.along = math.nan
        self.present = True

    @property
    def front(self) -> tuple[float, float]:
        """The middle of the front bumper, m."""
        half = self.length / 2
        return self.x + half * math.cos(self.heading), self.y + half * math.sin(self.heading)

    @property
    def box(self) -> Box:
        """The footprint."""
        return Box(self.x, self.y, self.heading, self.length, self.width)

    @property
    def mover(self) -> Mover:
        """The footprint with its speed."""
        return Mover(self.x, self.y, self.heading, self.speed, self.length, self.width)

    def bicycle(self) -> BicycleState:
        """The same as a bicycle's state."""
        return BicycleState(self.x, self.y, self.heading, self.speed, self.acceleration, self.yaw_rate, self.steer)

    def become(self, state: BicycleState) -> None:
        """Take over a bicycle's state."""
        self.x, self.y, self.heading = state.x, state.y, math.remainder(state.heading, math.tau)
        self.speed, self.acceleration = state.speed, state.acceleration
        self.yaw_rate, self.steer = state.yaw_rate, state.steer


class VehicleState(NamedTuple):
    """A vehicle as SUMO sees it; x, y: middle of the FRONT bumper, m; speed m/s; acceleration m/s^2."""

    x: float
    y: float
    speed_mps: float
    acceleration_mps2: float
    lane: str
