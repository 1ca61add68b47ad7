"""Road geometry for a page: of each network what lies near the runs that the page shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.report.page.numbers import line

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
    from foresee_dsl.report.ground import Layer, ground_of, lines_of, rings_of, zebra

    near = {(x + i, y + j) for x, y in cells for i in (-1, 0, 1) for j in (-1, 0, 1)}

    def shown(points: Sequence[Sequence[float]], wide_m: float) -> bool:
        """Whether the bounding box of a shape touches a cell that is near."""
        if not points:
            return False
        low = np.min(np.array(points)[:, :2], axis=0) - wide_m
        high = np.max(np.array(points)[:, :2], axis=0) + wide_m
        left, bottom = np.floor(low / AROUND_M).astype(int)
        right, top = np.floor(high / AROUND_M).astype(int)
        return any((x, y) in near for x in range(left, right + 1) for y in range(bottom, top + 1))

    ground = ground_of(network, shown)
    found: dict[str, Any] = {}
    for layer, shape in ground.items():
        finer = zebra(shape) if layer is Layer.CROSSING else shape.simplify(TOLERANCE_M)
        parts = lines_of(finer) if layer in (Layer.MARKING, Layer.STOP_LINE) else rings_of(finer)
        found[layer.value] = [line(part.tolist()) for part in parts]
    return found
