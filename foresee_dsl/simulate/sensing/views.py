"""Pictures that a driver asks for: what a view is given of a run and of a step. Packages add views and draw them.

A view is a function from `StepViews` to an array of uint8, [channels, rows, columns], an entry point of the group
`foresee_dsl.raster_views` (docs/reference/rasters.md). Nothing is drawn, and no view is imported, before a driver asks.
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
"""How far a camera sees in clear air. Ours: a car's width is then a pixel and a half of the view ahead."""


@dataclass(frozen=True, eq=False)
class RunViews:
    """What views know of a run. It can be the key of what a view draws once a run (`weakref.WeakKeyDictionary`).

    Attributes:
        others: models of the other actors, in the order of `StepViews.states`.
        range_m: how far the weather lets a camera see.
    """

    network: RoadNetwork
    mission: Mission
    ego: ModelSpec
    others: Sequence[ModelSpec]
    range_m: float = CAMERA_RANGE_M
    _loaded: dict[str, Callable[..., NDArray[np.uint8]]] = field(default_factory=dict, init=False, repr=False)

    def view(self, name: str) -> Callable[..., NDArray[np.uint8]]:
        """Return an installed view by its name, found once a run: finding one takes 0.1 ms, a picture 0.5 ms.

        Raises:
            DriverError: no installed package draws it; the message names the plug-in that does, if it is one of ours.
        """
        if name not in self._loaded:
            self._loaded[name] = RASTER_VIEWS.load(name)
        return self._loaded[name]


@dataclass(frozen=True, slots=True)
class StepViews:
    """The pictures of one step (`Observation.views`), drawn anew whenever they are asked for.

    Attributes:
        run: what does not change during the run. ego, actors, signals: those of the observation.
        pose: x, y (m), heading (rad) of the ego as it really is. states: [K, >=3] the same of the others, NaN where one
            is absent; not to be changed.
    """

    run: RunViews
    ego: EgoState
    actors: tuple[SeenActor, ...]
    signals: Mapping[str, SignalColour]
    pose: Pose
    states: FloatArray

    @Part.PICTURES.measured
    def draw(self, view: str) -> NDArray[np.uint8]:
        """Return the picture of an installed view by its name, [channels, rows, columns]; see `RunViews.view`."""
        return self.run.view(view)(self)

    @Part.PICTURES.measured
    def birds_eye(self, window: Window | None = None) -> NDArray[np.uint8]:
        """Return the view from above, or only a part of it; see `draw`."""
        return self.run.view("birds_eye")(self, window)

    def forward(self) -> NDArray[np.uint8]:
        """Return the view forward; see `draw`."""
        return self.draw("forward")
