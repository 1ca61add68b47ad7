"""Road geometry for a page: of each network what lies near the runs that the page shows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.topology import Lane
from foresee_dsl.report.page.numbers import CM, line

AROUND_M = 120.0
"""Roads and buildings are shown this far around the egos (ours: the picture at its widest is 200 m across)."""
TOLERANCE_M = 0.05
"""Points of a line that move it by less are left out (ours: half a pixel at the usual 10 px/m)."""


class Roads:
    """The networks of a page's runs, each once, cropped at the end to what is near."""

    def __init__(self) -> None:
        self._networks: dict[int, RoadNetwork] = {}
        self._cells: dict[int, set[tuple[int, int]]] = {}

    def add(self, network: RoadNetwork, track: NDArray[np.float64]) -> str:
        """Note where an ego was, [T, 2] m, and return the id of its network in the page."""
        self._networks.setdefault(id(network), network)
        cells = self._cells.setdefault(id(network), set())
        present = track[~np.isnan(track[:, 0])]
        cells.update((int(x), int(y)) for x, y in np.unique(np.floor(present / AROUND_M), axis=0))
        return f"roads-{list(self._networks).index(id(network))}"

    def as_dict(self) -> dict[str, dict[str, Any]]:
        """Return each network's geometry for the page, by its id."""
        return {
            f"roads-{k}": _geometry(network, self._cells[key])
            for k, (key, network) in enumerate(self._networks.items())
        }


def _geometry(network: RoadNetwork, cells: set[tuple[int, int]]) -> dict[str, Any]:
    near = {(x + i, y + j) for x, y in cells for i in (-1, 0, 1) for j in (-1, 0, 1)}

    def shown(points: Sequence[Sequence[float]]) -> bool:
        """Whether the bounding box of a shape touches a cell that is near."""
        if not points:
            return False
        low, high = np.min(np.array(points)[:, :2], axis=0), np.max(np.array(points)[:, :2], axis=0)
        left, bottom = np.floor(low / AROUND_M).astype(int)
        right, top = np.floor(high / AROUND_M).astype(int)
        return any((x, y) in near for x in range(left, right + 1) for y in range(bottom, top + 1))

    lanes = [lane for lane in network.lanes.values() if not lane.internal and shown(lane.shape)]
    crossings = [crossing for crossing in network.crossings.values() if shown(crossing.lane.shape)]
    return {
        "lanes": [[_kind(lane), round(lane.width_m * CM), _simple(lane.shape)] for lane in lanes],
        "junctions": _outlines(j.polygon for j in network.junctions.values() if shown(j.polygon)),
        "walks": _outlines(area.polygon for area in network.walking_areas.values() if shown(area.polygon)),
        "crossings": [[round(c.lane.width_m * CM), _simple(c.lane.shape)] for c in crossings],
        "buildings": _outlines(outline for outline in network.buildings if shown(outline)),
    }


def _kind(lane: Lane) -> str:
    if lane.parking:
        return "parking"
    return next((kind for kind in ("car", "bicycle", "pedestrian") if kind in lane.kinds), "other")


def _outlines(outlines: Iterable[Sequence[Sequence[float]]]) -> list[list[int]]:
    return [line(outline) for outline in outlines if len(outline) > 2]


def _simple(shape: Sequence[Sequence[float]]) -> list[int]:
    if len(shape) < 3:
        return line(shape)
    import shapely

    return line(shapely.LineString(shape).simplify(TOLERANCE_M).coords)
