"""What a fault may change: what the driver is told, what it sees, what it remembers, what it commands."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from foresee_dsl.drivers.protocol import (
    Control,
    EgoState,
    JunctionPassage,
    Mission,
    Observation,
    SeenActor,
    SignalColour,
    VehicleLimits,
)
from foresee_dsl.drivers.tracking import Tracker, Tracks

Actors = tuple[SeenActor, ...]
Signals = dict[str, SignalColour]

STEP_S = 0.05
BEFORE_JUNCTION_M = 40.0
"""Ours: a fault of right of way begins this far before the stop line, the stopping distance from 50 km/h at comfort."""
WET_FRICTION = 0.85
"""Ours: below it the road is wet; a dry one has 0.9."""


class Fault:
    """One kind of fault at one strength, from 0 (harmless) to 1 (coarse).

    Every method returns what it was given unless a kind overrides it; at a strength of 0 all of them do so.

    Attributes of a class:
        what: what the driver does wrong. cause: why a real one might. scale: what the strength means.
        source: where such a fault was seen, or "ours".
    """

    what: ClassVar[str]
    cause: ClassVar[str]
    scale: ClassVar[str]
    source: ClassVar[str] = "ours"

    def __init__(self, strength: float) -> None:
        self.strength = strength

    def begin(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Forget everything; a new mission begins."""
        self.task, self.vehicle, self.seed = mission, vehicle, seed

    def told(self, mission: Mission) -> Mission:
        """Return the mission as the driver knows it."""
        return mission

    def believed(self, vehicle: VehicleLimits) -> VehicleLimits:
        """Return the vehicle as the driver knows it."""
        return vehicle

    def settle(self, state: Any) -> None:  # noqa: ANN401 - what the healthy driver keeps from one reset to the next
        """Change what the driver has made of its mission."""

    def seen(self, actors: Actors, observation: Observation) -> Actors:
        """Return a new object list as the driver gets it."""
        return actors

    def shown(self, signals: Signals, observation: Observation) -> Signals:
        """Return the signals as the driver gets them."""
        return signals

    def felt(self, ego: EgoState, observation: Observation) -> EgoState:
        """Return its own state as the driver gets it."""
        return ego

    def done(self, control: Control, observation: Observation) -> Control:
        """Return what the vehicle gets of a command."""
        return control

    def overrides(self, method: str) -> bool:
        """Tell whether this kind has a method of its own."""
        return getattr(type(self), method) is not getattr(Fault, method)

    def between(self, healthy: float, coarse: float) -> float:
        """Return a value that changes evenly with the strength."""
        return healthy + self.strength * (coarse - healthy)

    def shrinking(self, healthy: float, coarse: float) -> float:
        """Return a value that changes by the same factor with each step of the strength."""
        return healthy * (coarse / healthy) ** self.strength if self.strength > 0 else math.inf

    def passage(self, ego: EgoState) -> JunctionPassage | None:
        """Return the junction that the ego is in or comes to, if one is near."""
        s = self.way_s(ego)
        for passage in self.task.junctions:
            if passage.stop_s - BEFORE_JUNCTION_M < s < passage.exit_s:
                return passage
        return None

    def way_s(self, ego: EgoState) -> float:
        """Return how far along its route the ego is, m."""
        nearest = np.hypot(*(self.task.centreline - (ego.x, ego.y)).T).argmin()
        return float(self.task.s[nearest])

    def random(self, *what: int) -> np.random.Generator:
        """Return random numbers that depend on the run's seed and on what they are for alone."""
        return np.random.default_rng([abs(self.seed), *(abs(value) for value in what)])


class Remembering(Tracker):
    """A driver's tracker whose tracks a fault changes."""

    def __init__(self, change: Callable[[Tracks], Tracks]) -> None:
        super().__init__()
        self._change = change

    def update(self, observation: Observation) -> Tracks:
        """Take in an observation, and return the changed tracks."""
        return self._change(super().update(observation))


def relative(actor: SeenActor, ego: EgoState) -> tuple[float, float]:
    """Return how far an actor is ahead of the ego and to its left, m, centre to centre."""
    dx, dy = actor.x - ego.x, actor.y - ego.y
    cos, sin = math.cos(ego.heading_rad), math.sin(ego.heading_rad)
    return dx * cos + dy * sin, dy * cos - dx * sin


def away(actor: SeenActor, ego: EgoState) -> float:
    """Return the distance between an actor and the ego, m."""
    return math.hypot(actor.x - ego.x, actor.y - ego.y)


def turned(actor: SeenActor, ego: EgoState) -> float:
    """Return an actor's heading as the ego sees it, -pi to pi."""
    return math.remainder(actor.heading_rad - ego.heading_rad, math.tau)


def moved(actor: SeenActor, ahead_m: float, heading_rad: float) -> SeenActor:
    """Return an actor at another place, so far on in a direction."""
    if ahead_m == 0:
        return actor
    return replace(actor, x=actor.x + ahead_m * math.cos(heading_rad), y=actor.y + ahead_m * math.sin(heading_rad))
