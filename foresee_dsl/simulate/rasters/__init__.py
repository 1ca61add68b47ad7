"""Pictures for learned drivers and predictors: from above, and forward through a camera (docs/rasters.md)."""

from foresee_dsl.drivers.pictures.layout import BIRDS_EYE_CHANNELS, FORWARD_CHANNELS, GROUP_OF, GROUPS
from foresee_dsl.simulate.rasters.birdseye import Pose, StopLine
from foresee_dsl.simulate.rasters.canvas import Canvas, RecordedFrames, RunViews, StepViews, seen_arrays, stops_of

__all__ = [
    "BIRDS_EYE_CHANNELS",
    "FORWARD_CHANNELS",
    "GROUPS",
    "GROUP_OF",
    "Canvas",
    "Pose",
    "RecordedFrames",
    "RunViews",
    "StepViews",
    "StopLine",
    "seen_arrays",
    "stops_of",
]
