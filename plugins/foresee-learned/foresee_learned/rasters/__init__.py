"""Pictures for learned drivers and predictors: from above, and forward through a camera (docs/reference/rasters.md)."""

from foresee_learned.rasters.birdseye import Pose, StopLine
from foresee_learned.rasters.canvas import Canvas, RecordedFrames, canvas_of, seen_arrays, stops_of
from foresee_learned.rasters.layout import BIRDS_EYE_CHANNELS, FORWARD_CHANNELS, GROUP_OF, GROUPS

__all__ = [
    "BIRDS_EYE_CHANNELS",
    "FORWARD_CHANNELS",
    "GROUPS",
    "GROUP_OF",
    "Canvas",
    "Pose",
    "RecordedFrames",
    "StopLine",
    "canvas_of",
    "seen_arrays",
    "stops_of",
]
