"""What an ego may wait for: the junctions and the actor ahead on its route, and the actors close in front of it.

The judge of a run computes it from the simulation, a story from the trace; both give the same input.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from foresee_dsl.compile.bundle import Scene
from foresee_dsl.compile.roads.route_line import Passage
from foresee_dsl.compile.roads.topology import Movement
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.simulate.trace import HEADING, SPEED, X, Y

AHEAD_M = 30.0
"""A signal or an actor at most this far ahead along the ego's route is a reason for the ego to wait, m. Ours: a stopped
queue of four cars and the gap before it; an ego farther back has another car in front."""
CLOSE_AHEAD_M = 15.0
"""An actor in front that is at most this far away is a reason to wait even if it is beside the route, m. Ours: two car
lengths plus the width of a crossing."""
BESIDE_M = 0.8
"""Lateral clearance below which another actor still blocks the ego, m. Ours: the clearance that drivers leave to a
pedestrian."""


class Leader(NamedTuple):
    """An actor in the ego's way: the gap between the two bodies along the ego's route, m, and the actor's column."""

    gap_m: float
    column: int


@dataclass(frozen=True, eq=False)
class WayAhead:
    """What is ahead of the ego at one frame, by the true positions of all actors.

    Attributes:
        scene: the compiled scene.
        states: [A, 7] the columns of `Trace.states` for all actors of the scene, NaN where absent.
        along_m, left_m: length of the ego's centre along the line of its route, and its distance to the left of it.
        colour: returns the present colour of a movement's signal; "" if the movement has no signal.
    """

    scene: Scene
    states: FloatArray
    along_m: float
    left_m: float
    colour: Callable[[Movement], str]

    def junctions(self) -> Iterator[tuple[Passage, float]]:
        """Yield the junctions within `AHEAD_M` that the ego has not left, each with the distance from the ego's front
        to it, m, negative inside.
        """
        line = self.scene.ego.line
        front_m = self.along_m + self.scene.ego.model.length_m / 2
        for passage in line.passages if line is not None else ():
            if passage.exit_s > self.along_m and passage.entry_s - front_m <= AHEAD_M:
                yield passage, passage.entry_s - front_m

    def stop_signal(self) -> tuple[Passage, float, str] | None:
        """Return the next junction with a signal, the distance to it, m, and the signal's colour if that is red or
        amber; None otherwise.
        """
        for passage, room_m in self.junctions():
            if room_m >= 0 and (colour := self.colour(passage.movement)):
                return (passage, room_m, colour) if colour in ("red", "amber") else None
        return None

    def leader(self) -> Leader | None:
        """Return the nearest actor in the way along the ego's route; None without one within `AHEAD_M`."""
        ego, line = self.scene.ego, self.scene.ego.line
        leaders = []
        for column, (x, y) in enumerate(self.states[1:, [X, Y]].tolist(), start=1):
            if line is None or np.isnan(x):
                continue
            model = self.scene.actors[column].model
            s, left_m = line.project(x, y)
            gap_m = s - self.along_m - (ego.model.length_m + model.length_m) / 2
            beside_m = abs(left_m - self.left_m) - (ego.model.width_m + model.width_m) / 2
            if s > self.along_m and gap_m <= AHEAD_M and beside_m <= BESIDE_M:
                leaders.append(Leader(gap_m, column))
        return min(leaders, key=lambda each: (each.gap_m, self.scene.actors[each.column].id), default=None)

    def may_wait(self) -> bool:
        """Return whether the ego drives or has a reason to wait: a signal that is not green, or an actor in front that
        is not a static object.
        """
        ego = self.states[0]
        if ego[SPEED] >= STANDS_MPS or self.stop_signal() is not None:
            return True
        dx, dy = self.states[:, X] - ego[X], self.states[:, Y] - ego[Y]
        in_front = dx * np.cos(ego[HEADING]) + dy * np.sin(ego[HEADING]) > 0  # False for the ego and where absent
        close = in_front & (np.hypot(dx, dy) <= CLOSE_AHEAD_M)
        return any(actor.control != "static" for actor, near in zip(self.scene.actors, close, strict=True) if near)
