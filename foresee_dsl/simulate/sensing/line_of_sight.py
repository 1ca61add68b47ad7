"""Lines of sight between any two actors of a simulation and from the ego of a recorded run, without a driver's
sensors.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.compile.catalogue import CLASS_DEFAULTS
from foresee_dsl.simulate.sensing.settings import STANDARD, ClassRanges, SensorSettings
from foresee_dsl.simulate.sensing.sight import Bodies, Sight
from foresee_dsl.simulate.sensing.weather import Air
from foresee_dsl.simulate.trace import HEADING, Trace, X, Y

if TYPE_CHECKING:
    from foresee_dsl.simulate.actors.simulation import Simulation

FAR_M = 5000.0
"""A range that is longer than any distance within a network, m. Ours."""
_ALL_AROUND = replace(
    STANDARD,
    ranges=ClassRanges(**dict.fromkeys(ClassRanges.__dataclass_fields__, FAR_M)),
    field_of_view_rad=math.tau,
    weather=False,
)


class LinesOfSight:
    """The lines of sight between the actors at the current frame.

    An actor's eye is above the middle of its footprint.
    """

    def __init__(self, simulation: Simulation) -> None:
        """Begin without eyes: the eye of an actor is prepared when it is first needed."""
        self._simulation = simulation
        self._sights: dict[int, Sight] = {}
        self._seen: dict[int, tuple[int, frozenset[int]]] = {}
        self._numbers = {actor.id: k for k, actor in enumerate(simulation.actors)}

    def clear(self, eye: str, actor: str) -> bool:
        """Return whether nothing hides an actor from another one; both must be present."""
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


def sight_of(trace: Trace, bundle: SumoBundle | None = None, sensors: SensorSettings = STANDARD) -> Sight:
    """Return the lines of sight from a run's ego through these sensors, without their noise.

    Without the bundle, no building hides an actor, the air is clear, and every actor has the usual height of its class.
    """
    if bundle is not None:
        scene = bundle.scene
        bodies = Bodies.of([actor.model for actor in scene.actors[1:]])
        return Sight(bodies, bundle.network.buildings, sensors, Air(scene.rain, scene.fog, scene.sun))
    others = trace.actors[1:]
    heights = {str(kind): defaults.height_m for kind, defaults in CLASS_DEFAULTS.items()}
    sizes = np.array([(info.length_m, info.width_m) for info in others], dtype=np.float64).reshape(-1, 2)
    kinds = tuple(info.kind for info in others)
    return Sight(Bodies(kinds, sizes, np.array([heights[kind] for kind in kinds])), ())


def in_view(trace: Trace, other: int, frame: int, sight: Sight) -> bool:
    """Return whether an actor (by its column) is in sight of the ego at a frame."""
    poses = trace.states[frame][:, [X, Y, HEADING]]
    x, y, heading = poses[0].tolist()
    visible = sight.seen(x, y, heading, poses[1:])
    return other - 1 in visible
