"""The base class of faults: a fault may change a driver's mission, observation, memory and answer."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import ClassVar, Protocol

import numpy as np

from foresee_dsl.drivers.parts import DriverPart
from foresee_dsl.drivers.pdm.route import DriverRoute
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

BEFORE_JUNCTION_M = 40.0
"""Distance before the stop line from which a fault of right of way acts, m. Ours: the comfortable stopping distance
from 50 km/h."""
WET_FRICTION = 0.85
"""Friction coefficient below which a road is wet. Ours: a dry road has 0.9."""


class DriverState(Protocol):
    """The part of a healthy driver's state that faults change; the driver keeps it from one reset to the next."""

    route: DriverRoute
    tracker: Tracker

    def follow(self, route: DriverRoute) -> None:
        """Follow another route."""


class Fault:
    """One kind of fault at one strength, from 0 (no effect) to 1 (full).

    Each method returns its argument unchanged, unless a kind overrides it; at a strength of 0 all methods do so.

    The docstring of a kind is the wrong behaviour.

    Attributes of a class:
        what: the wrong behaviour, from the docstring. cause: a possible cause in a real driver. scale: meaning of the
            strength; a class without it is the base of several kinds.
        source: where such a fault was reported, or "ours".
        part: the part of the driver that the fault is in; None: the planning, which no ideal part replaces.
    """

    what: ClassVar[str]
    cause: ClassVar[str]
    scale: ClassVar[str]
    source: ClassVar[str] = "ours"
    part: ClassVar[DriverPart | None]

    def __init_subclass__(cls) -> None:
        """Take the wrong behaviour from the docstring."""
        words = (cls.__doc__ or "").removesuffix(".")
        cls.what = words[:1].lower() + words[1:]

    def __init__(self, strength: float) -> None:
        self.strength = strength

    def begin(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Reset the fault for a new mission."""
        self.task, self.vehicle, self.seed = mission, vehicle, seed

    def change_mission(self, mission: Mission) -> Mission:
        """Return the mission as the driver knows it."""
        return mission

    def change_vehicle(self, vehicle: VehicleLimits) -> VehicleLimits:
        """Return the vehicle as the driver knows it."""
        return vehicle

    def settle(self, state: DriverState) -> None:
        """Change the state that the driver has derived from its mission."""

    def change_actors(self, actors: Actors, observation: Observation) -> Actors:
        """Return a new object list as the driver gets it."""
        return actors

    def change_signals(self, signals: Signals, observation: Observation) -> Signals:
        """Return the signals as the driver gets them."""
        return signals

    def change_ego(self, ego: EgoState, observation: Observation) -> EgoState:
        """Return the ego's own state as the driver gets it."""
        return ego

    def change_control(self, control: Control, observation: Observation) -> Control:
        """Return the control that reaches the vehicle."""
        return control

    def overrides(self, method: str) -> bool:
        """Return whether this kind overrides a method."""
        return getattr(type(self), method) is not getattr(Fault, method)

    def between(self, healthy: float, coarse: float) -> float:
        """Return a value that changes linearly with the strength: from `healthy` at 0 to `coarse` at 1."""
        return healthy + self.strength * (coarse - healthy)

    def shrinking(self, healthy: float, coarse: float) -> float:
        """Return a value that changes exponentially with the strength: infinite at 0, `coarse` at 1."""
        return healthy * (coarse / healthy) ** self.strength if self.strength > 0 else math.inf

    def passage(self, ego: EgoState) -> JunctionPassage | None:
        """Return the junction that the ego is in or approaches, None if none is near."""
        s = self.way_s(ego)
        for passage in self.task.junctions:
            if passage.stop_s - BEFORE_JUNCTION_M < s < passage.exit_s:
                return passage
        return None

    def way_s(self, ego: EgoState) -> float:
        """Return the ego's length along its route, m."""
        nearest = np.hypot(*(self.task.centreline - (ego.x, ego.y)).T).argmin()
        return float(self.task.s[nearest])

    def random(self, *what: int) -> np.random.Generator:
        """Return a random generator that depends only on the run's seed and on `what` (its purpose)."""
        return np.random.default_rng([abs(self.seed), *(abs(value) for value in what)])


class Remembering(Tracker):
    """A driver's tracker whose tracks a fault changes."""

    def __init__(self, change: Callable[[Tracks], Tracks]) -> None:
        super().__init__()
        self._change = change

    def update(self, observation: Observation) -> Tracks:
        """Process an observation, and return the tracks as the fault changes them."""
        return self._change(super().update(observation))


class Spoilt(Remembering):
    """A driver's ideal tracker, whose tracks are changed by a fault of a later part."""

    def __init__(self, tracker: Tracker, change: Callable[[Actors, Observation], Actors]) -> None:
        super().__init__(lambda tracks: tracks)
        self._tracker, self._spoil = tracker, change

    def update(self, observation: Observation) -> Tracks:
        """Process an observation, and return the tracks as the later part receives them."""
        tracks = self._tracker.update(observation)
        rows = {number: k for k, number in enumerate(tracks.numbers)}
        actors = self._spoil(tracks.seen(), observation)
        table = tracks.table[[rows[actor.track] for actor in actors]].copy()
        for k, actor in enumerate(actors):
            table[k]["x"], table[k]["y"], table[k]["heading"] = actor.x, actor.y, actor.heading_rad
            table[k]["speed"], table[k]["length"], table[k]["width"] = actor.speed_mps, actor.length_m, actor.width_m
        return Tracks(table, tuple(actor.track for actor in actors), tuple(actor.kind for actor in actors))


def relative(actor: SeenActor, ego: EgoState) -> tuple[float, float]:
    """Return the distances of an actor ahead of the ego and to its left, m, between the centres."""
    dx, dy = actor.x - ego.x, actor.y - ego.y
    cos, sin = math.cos(ego.heading_rad), math.sin(ego.heading_rad)
    return dx * cos + dy * sin, dy * cos - dx * sin


def away(actor: SeenActor, ego: EgoState) -> float:
    """Return the distance between an actor and the ego, m."""
    return math.hypot(actor.x - ego.x, actor.y - ego.y)


def turned(actor: SeenActor, ego: EgoState) -> float:
    """Return an actor's heading relative to the ego's, -pi to pi."""
    return math.remainder(actor.heading_rad - ego.heading_rad, math.tau)


def moved(actor: SeenActor, ahead_m: float, heading_rad: float) -> SeenActor:
    """Return an actor moved by `ahead_m` in the direction `heading_rad`."""
    if ahead_m == 0:
        return actor
    return replace(actor, x=actor.x + ahead_m * math.cos(heading_rad), y=actor.y + ahead_m * math.sin(heading_rad))
