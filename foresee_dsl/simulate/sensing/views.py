"""Pictures for learned drivers: the input that a view gets of a run and of a step. Plug-ins provide the views.

A view is a function from `StepViews` to an array of uint8, [channels, rows, columns], and an entry point of the group
`foresee_dsl.raster_views` (docs/reference/rasters.md). A view is imported and drawn only when a driver requests it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.drivers.protocol import EgoState, Mission, SeenActor, SignalColour, Window
from foresee_dsl.errors import DriverError, DriverUnavailableError
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.measuring import Part
from foresee_dsl.plugins import PluginGroup
from foresee_dsl.simulate.sensing.objects import Pose

RASTER_VIEWS = PluginGroup("foresee_dsl.raster_views", "raster view", DriverError, DriverUnavailableError)
CAMERA_RANGE_M = 100.0
"""Range of a camera in clear air, m. Ours: there a car is one and a half pixels wide in the forward view."""


@dataclass(frozen=True, eq=False)
class RunViews:
    """The constant data of a run for views; a view can cache by it (`weakref.WeakKeyDictionary`).

    Attributes:
        others: models of the other actors, in the order of `StepViews.states`.
        range_m: range of a camera in the weather of the run.
    """

    network: RoadNetwork
    mission: Mission
    ego: ModelSpec
    others: Sequence[ModelSpec]
    range_m: float = CAMERA_RANGE_M
    _loaded: dict[str, Callable[..., NDArray[np.uint8]]] = field(default_factory=dict, init=False, repr=False)

    def view(self, name: str) -> Callable[..., NDArray[np.uint8]]:
        """Return an installed view by its name. A view is looked up once a run, because that takes 0.1 ms and a picture
        0.5 ms.

        Raises:
            DriverError: no installed package draws it; the message names the plug-in that does, if it is one of ours.
        """
        if name not in self._loaded:
            self._loaded[name] = RASTER_VIEWS.load(name)
        return self._loaded[name]


class StepViews:
    """The pictures of one step (`Observation.views`); each call draws the picture again.

    It is not a dataclass, because a driver in another process gets the fields of dataclasses, and must get neither the
    road network nor true positions.

    Attributes:
        run: the constant data of the run. ego, actors, signals: as in the observation.
        pose: true x, y (m) and heading (rad) of the ego. states: [K, >=3] the same for the others, NaN where absent; do
            not change them.
    """

    __slots__ = ("actors", "ego", "pose", "run", "signals", "states")

    def __init__(
        self,
        run: RunViews,
        ego: EgoState,
        actors: tuple[SeenActor, ...],
        signals: Mapping[str, SignalColour],
        pose: Pose,
        states: FloatArray,
    ) -> None:
        self.run, self.ego, self.actors, self.signals, self.pose, self.states = run, ego, actors, signals, pose, states

    @Part.PICTURES.measured
    def draw(self, view: str) -> NDArray[np.uint8]:
        """Return the picture of an installed view by its name, [channels, rows, columns]; see `RunViews.view`."""
        return self.run.view(view)(self)

    @Part.PICTURES.measured
    def birds_eye(self, window: Window | None = None) -> NDArray[np.uint8]:
        """Return the view from above, or a part of it; see `draw`."""
        return self.run.view("birds_eye")(self, window)

    def forward(self) -> NDArray[np.uint8]:
        """Return the forward view; see `draw`."""
        return self.draw("forward")
