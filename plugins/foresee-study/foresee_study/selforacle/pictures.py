"""The pictures of the front camera in a recorded run, two a second: the class of each pixel, and its colours."""

from __future__ import annotations

import numpy as np
from foresee_learned.rasters import FORWARD_CHANNELS, Canvas, RecordedFrames
from foresee_learned.rasters.colours import coloured
from foresee_learned.rasters.layout import FORWARD
from numpy.typing import NDArray

from foresee_dsl.drivers.protocol import SignalColour
from foresee_dsl.exchange.network_parts import signal_states
from foresee_dsl.forecast.protocol import Surroundings
from foresee_dsl.simulate.signals import colour_shown
from foresee_dsl.simulate.trace import STEP_S, Trace

EVERY_S = 0.5
"""Time between two pictures, s: 2 a second, as in the paper's training data (section 4.3.1)."""
ROWS, COLUMNS = 80, 160
"""Size of SelfOracle's pictures (its `IMAGE_HEIGHT`, `IMAGE_WIDTH`)."""
CLASSES = len(FORWARD_CHANNELS)
"""Number of classes of pixels: those of the forward view without the depth, and a class for pixels that show
nothing."""

_ROW_OF = np.arange(ROWS) * FORWARD.rows // ROWS
"""For each row of a picture, the row of the forward view that it shows."""


def looked_at(trace: Trace, every_s: float = EVERY_S) -> NDArray[np.intp]:
    """Return the frames of a run of which pictures are drawn."""
    return np.arange(0, trace.frames, round(every_s / STEP_S))


def classes_seen(trace: Trace, surroundings: Surroundings, frames: NDArray[np.intp]) -> NDArray[np.uint8]:
    """Return what a camera behind the windscreen saw at these frames, [N, 64, 160]: the class of each pixel."""
    ego = trace.actors[0]
    canvas = Canvas.of_mission(surroundings.network, surroundings.mission, (ego.length_m, ego.width_m))
    recorded = RecordedFrames(trace)
    seen = np.empty((len(frames), FORWARD.rows, FORWARD.columns), np.uint8)
    for k, frame in enumerate(frames.tolist()):
        view = canvas.forward(
            recorded.pose(frame), recorded.bodies(frame), recorded.groups, signals_at(trace, surroundings, frame)
        )
        seen[k] = classes_of(view)
    return seen


def classes_of(view: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the class of each pixel of a forward view: [64, 160]."""
    planes = view[: CLASSES - 1]
    return np.where(planes.any(axis=0), planes.argmax(axis=0), CLASSES - 1).astype(np.uint8)


def pictures_of(classes: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the coloured pictures of the classes of pixels [N, 64, 160]: [N, 80, 160, 3]."""
    pictures: NDArray[np.uint8] = PALETTE[classes[:, _ROW_OF]]
    return pictures


def signals_at(trace: Trace, surroundings: Surroundings, frame: int) -> dict[str, SignalColour]:
    """Return the colours of the signals on the ego's route at a frame, by `JunctionPassage.signal`."""
    states = signal_states(surroundings.signals, trace, frame)
    colours: dict[str, SignalColour] = {}
    for passage in surroundings.mission.junctions:
        tls, _, index = (passage.signal or "").rpartition(":")
        if passage.signal is not None and tls in states:
            colours[passage.signal] = colour_shown(states[tls], int(index))
    return colours


def _palette() -> NDArray[np.uint8]:
    """Return the colour of each class, [13, 3], as in the picture of the forward view that people see."""
    each = np.zeros((CLASSES, 1, CLASSES), np.uint8)
    each[np.arange(CLASSES - 1), 0, np.arange(CLASSES - 1)] = 255
    palette: NDArray[np.uint8] = coloured(each)[0]
    return palette


PALETTE = _palette()
