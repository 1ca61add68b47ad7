"""Bare lines of sight between any two actors: what nothing hides, without a range, a field of view or a chance."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.sensing.settings import STANDARD, ClassRanges
from foresee_dsl.simulate.sensing.sight import Bodies, Sight

FAR_M = 5000.0
"""Farther than any two places of a network lie apart. Ours."""
_ALL_AROUND = replace(
    STANDARD,
    ranges=ClassRanges(**dict.fromkeys(ClassRanges.__dataclass_fields__, FAR_M)),
    field_of_view_rad=math.tau,
    weather=False,
)


class LinesOfSight:
    """Who is in sight of whom at the frame that a simulation is at; the eye is over the middle of its footprint."""

    def __init__(self, simulation: Simulation) -> None:
        """Prepare nothing yet: an eye is prepared when it is first asked for."""
        self._simulation = simulation
        self._sights: dict[int, Sight] = {}
        self._seen: dict[int, tuple[int, frozenset[int]]] = {}
        self._numbers = {actor.id: k for k, actor in enumerate(simulation.actors)}

    def clear(self, eye: str, actor: str) -> bool:
        """Say whether nothing hides an actor from the eyes of another; both are there."""
        k, frame = self._numbers[eye], self._simulation.frame
        if self._seen.get(k, (-1, frozenset()))[0] != frame:
            self._seen[k] = frame, self._look(k)
        return self._numbers[actor] in self._seen[k][1]

    def _look(self, eye: int) -> frozenset[int]:
        simulation = self._simulation
        if eye not in self._sights:
            models = [actor.placed.model for k, actor in enumerate(simulation.actors) if k != eye]
            self._sights[eye] = Sight(Bodies.of(models), simulation.network.buildings, _ALL_AROUND)
        states, _, _ = simulation.state_table.frame()
        x, y, heading = states[eye, :3].tolist()
        seen = self._sights[eye].seen(x, y, heading, np.delete(states, eye, axis=0)[:, :3])
        return frozenset(int(k) + (int(k) >= eye) for k in seen)
