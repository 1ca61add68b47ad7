"""Lanes of Argoverse 2 maps (`log_map_archive_ID.json`): segments with borders, which run in the driving direction.

Source: the data set's user guide, "Map API". Coordinates are the city's, m, as in the scenario.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from foresee_dsl.files import read_outside
from foresee_recordings.maps.lanes import Lane, LaneMap, LaneType
from foresee_recordings.recording import FloatArray, RecordingError

_TYPES: dict[str, LaneType] = {"VEHICLE": "road", "BUS": "bus", "BIKE": "bicycle"}
_CROSSINGS = "pedestrian crossings"


def lanes_of(path: Path) -> LaneMap:
    """Return the lanes of a map.

    Raises:
        RecordingError: it cannot be read, or is not a map of Argoverse 2.
    """
    try:
        document = json.loads(read_outside(path))
        segments = {str(segment["id"]): segment for segment in document["lane_segments"].values()}
        left_out = Counter({_CROSSINGS: len(document.get("pedestrian_crossings", {}))})
        lanes = {id_: _lane(segment, segments) for id_, segment in segments.items()}
    except OSError as err:
        raise RecordingError(f"{path} cannot be read: {err.strerror or err}") from err
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as err:
        raise RecordingError(f"{path} is not a map of Argoverse 2, or a damaged one: {err!r:.200}") from err
    return LaneMap(lanes, dict(+left_out), ("The map has no speed limits and no signs; signals are not in it.",))


def _lane(segment: Any, segments: Mapping[str, Any]) -> Lane:  # noqa: ANN401  any value of JSON
    return Lane(
        id=str(segment["id"]),
        left=_border(segment["left_lane_boundary"]),
        right=_border(segment["right_lane_boundary"]),
        predecessors=tuple(str(id_) for id_ in segment["predecessors"] if str(id_) in segments),
        successors=tuple(str(id_) for id_ in segment["successors"] if str(id_) in segments),
        left_neighbour=_neighbour(segment, "left", segments),
        right_neighbour=_neighbour(segment, "right", segments),
        type=_TYPES.get(segment["lane_type"], "road"),
    )


def _border(points: Any) -> FloatArray:  # noqa: ANN401
    """Return a border, [N, 2] m.

    Raises:
        ValueError: it has fewer than two points, or a coordinate that is not finite.
    """
    border = np.array([(float(point["x"]), float(point["y"])) for point in points])
    if len(border) < 2 or not np.isfinite(border).all():
        raise ValueError("a border of a lane has fewer than two points")
    return border


def _neighbour(segment: Any, side: str, segments: Mapping[str, Any]) -> str:  # noqa: ANN401
    """Return the lane beside a segment in its direction, otherwise ""; lanes of opposite directions are left neighbours
    of each other."""
    id_ = str(segment.get(f"{side}_neighbor_id"))
    other = "right" if side == "left" else "left"
    back = segments[id_].get(f"{other}_neighbor_id") if id_ in segments else None
    return id_ if str(back) == str(segment["id"]) else ""
