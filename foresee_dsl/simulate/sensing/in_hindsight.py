"""What the ego's sensors could see in a recorded run."""

from __future__ import annotations

import numpy as np

from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.compile.catalogue import CLASS_DEFAULTS
from foresee_dsl.simulate.sensing.settings import STANDARD
from foresee_dsl.simulate.sensing.sight import Bodies, Sight
from foresee_dsl.simulate.sensing.weather import Air
from foresee_dsl.simulate.trace import HEADING, Trace, X, Y


def sight_of(trace: Trace, bundle: SumoBundle | None = None) -> Sight:
    """Return the lines of sight from a run's ego: the sensors of the drivers under test, without their noise.

    Without the bundle: no buildings, clear air, and every actor as high as its class usually is.
    """
    if bundle is not None:
        scene = bundle.scene
        bodies = Bodies.of([actor.model for actor in scene.actors[1:]])
        return Sight(bodies, bundle.network.buildings, STANDARD, Air(scene.rain, scene.fog, scene.sun))
    others = trace.actors[1:]
    heights = {str(kind): defaults.height_m for kind, defaults in CLASS_DEFAULTS.items()}
    sizes = np.array([(info.length_m, info.width_m) for info in others], dtype=np.float64).reshape(-1, 2)
    kinds = tuple(info.kind for info in others)
    return Sight(Bodies(kinds, sizes, np.array([heights[kind] for kind in kinds])), ())


def in_view(trace: Trace, other: int, frame: int, sight: Sight) -> bool:
    """Say whether an actor (its column) is in sight from the ego at a frame."""
    poses = trace.states[frame][:, [X, Y, HEADING]]
    x, y, heading = poses[0].tolist()
    visible = sight.seen(x, y, heading, poses[1:])
    return other - 1 in visible
