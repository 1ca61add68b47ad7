"""Argoverse 2 motion forecasting: a scenario of 11 s at 10 Hz (`scenario_ID.parquet`) with its map
(`log_map_archive_ID.json`). Source: Wilson et al., "Argoverse 2", NeurIPS 2021, and the data set's user guide.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from foresee_recordings.maps.argoverse import lanes_of
from foresee_recordings.maps.network import network_of
from foresee_recordings.readers.classes import Shape, usual_shape
from foresee_recordings.readers.parquet import rows_of
from foresee_recordings.readers.samples import Samples
from foresee_recordings.reading import Request
from foresee_recordings.recording import RecordedMap, Recording, RecordingError

_STEP_S = 0.1
"""Time between two samples, s (the data set's user guide: 10 Hz)."""
_TEXTS = ("track_id", "object_type")
_NUMBERS = ("timestep", "position_x", "position_y", "heading", "velocity_x", "velocity_y")
_KINDS: Mapping[str, str] = {
    "vehicle": "car", "pedestrian": "pedestrian", "motorcyclist": "motorcycle", "cyclist": "bicycle", "bus": "bus",
    "riderless_bicycle": "bicycle",
}  # fmt: skip
"""Our kinds of the data set's types; `static`, `background`, `construction` and `unknown` have no known size."""


class ArgoverseReader:
    """Argoverse 2 motion forecasting."""

    what: ClassVar[str] = "a scenario of Argoverse 2 motion forecasting (scenario_ID.parquet), or its folder"
    numbers: ClassVar[tuple[str, ...]] = ()

    def recognises(self, path: Path, head: bytes) -> bool:
        """Return whether a file, or the only one in a folder, has the name of a scenario."""
        if path.is_dir():
            return len(_scenarios_in(path)) == 1
        return path.name.startswith("scenario_") and head.startswith(b"PAR1")

    def read(self, request: Request) -> Recording:
        """Read the samples of the request; times begin at 0."""
        file = _scenario_file(request.path)
        samples = Samples(request)
        shapes: dict[str, Shape] = {}
        others: Counter[str] = Counter()
        for actor, type_, step, x, y, heading, vx, vy in rows_of(file, _TEXTS, _NUMBERS):
            time_s = step * _STEP_S
            if not samples.wants(actor, time_s):
                continue
            kind = _KINDS.get(type_)
            if kind is None:
                others[type_[:30]] += 1
            elif samples.add(actor, time_s, x, y, heading, math.hypot(vx, vy)):
                shapes.setdefault(actor, usual_shape(kind))
        for type_, count in others.most_common(8):
            samples.left_out[f"samples of objects of the type {type_}, whose size is not known"] += count
        samples.note("The data set has no sizes: those that are usual for the classes are used.")
        return samples.recording("argoverse", shapes, source=file, roads=_roads(request, file, samples))


def _roads(request: Request, file: Path, samples: Samples) -> RecordedMap | None:
    """Return the network of the map beside a scenario, unless the request names another one."""
    beside = file.with_name(f"log_map_archive_{file.stem.removeprefix('scenario_')}.json")
    if request.map_file is not None or not beside.exists():
        return None
    lane_map = lanes_of(beside)
    for what, count in lane_map.left_out.items():
        samples.left_out[what] += count
    try:
        return network_of(lane_map)
    except RecordingError as err:
        samples.note(f"The map {beside.name} was left out: {err}")
        return None


def _scenarios_in(folder: Path) -> list[Path]:
    return sorted(folder.glob("scenario_*.parquet"))


def _scenario_file(path: Path) -> Path:
    if not path.is_dir():
        return path
    files = _scenarios_in(path)
    if len(files) != 1:
        raise RecordingError(f"{path} has {len(files)} files scenario_ID.parquet: name one")
    return files[0]
